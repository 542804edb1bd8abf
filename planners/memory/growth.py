"""Growth: makes a memory of many plans with an encoder that was trained on few, without training again.

The encoder stays as it is. Some problems of the class are embedded, and each plan is checked in each of them.
The plan's centroid and its row of the readout follow from that in closed form. So a plan costs only its
checks, rows of other plans do not change, and what was learned about obstacles serves new plans, too.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from planners.memory.memory import Memory
from planners.memory.plans.cell_masks import CELL_SCORES, masks_of
from planners.memory.plans.free import free_plans
from planners.memory.plans.sweeps import sweep_plans
from planners.memory.ranking.inverted_lists import FROM_PLANS, list_readout
from planners.memory.ranking.readout import NO_PLAN_ODDS, mean_embeddings, nearest_readout
from planners.world.arrays import Flags, Floats, Floats32
from planners.world.geometry.collision import scene_of
from planners.world.geometry.occupancy import occupancy_of
from planners.world.jit import lean
from planners.world.problem import Plan, Problem

EVEN_CELLS = 5  # blocked cells: a plan with so many is about as often free as not
RIDGE = 1e-3  # of the mean variance of an embedding's numbers; 1e-4 to 1e-1 measured alike


class Moments(NamedTuple):
    """Sums over problems: row ``i + 1`` of those in which plan i is free, row 0 of those in which none is."""

    counts: Floats  # [N + 1] problems
    sums: Floats  # [N + 1, D] of their embeddings
    squares: Floats  # [N + 1] of the squared lengths of their embeddings


def grow(memory: Memory, plans: Sequence[Plan], problems: Sequence[Problem]) -> Memory:
    """Make a memory of other plans with the encoder of a memory.

    Args:
        memory: whose encoder is used; its own plans are kept only if they are among ``plans``.
        plans: N plans to store.
        problems: canonical problems to derive the readout from, each checked with all plans; some 2,000 are
            enough (docs/studies/growth.md).

    Raises:
        ValueError: There are no problems, or no plans.
    """
    if not problems or not plans:
        raise ValueError(
            f"a memory of {len(plans)} plans cannot be read out from {len(problems)} problems: give some"
        )
    sweeps = sweep_plans(plans, memory.vehicle)
    embeddings = np.stack([memory.encoder(occupancy_of(problem)) for problem in problems])
    moments = moments_of(
        embeddings, (free_plans(sweeps, scene_of(problem)) for problem in problems), len(plans)
    )
    centroids = mean_embeddings(moments.sums, moments.counts).astype(np.float32)
    if memory.objective == "triplet":
        vectors, biases = nearest_readout(centroids, scatter(moments, centroids))
    else:
        vectors, biases = beside_cells(*ridge_readout(embeddings, moments))
    return replace(
        memory,
        plans=plans,
        sweeps=sweeps,
        masks=masks_of(sweeps),
        centroids=centroids,
        vectors=vectors,
        biases=biases,
        lists=list_readout(vectors, biases) if len(plans) >= FROM_PLANS else None,
    )


def moments_of(embeddings: Floats32, labels: Iterable[Flags], plans: int) -> Moments:
    """Sum up n problems: ``embeddings [n, D]`` and, one after another, which plans are free ``[N]``."""
    width = embeddings.shape[1]
    moments = Moments(np.zeros(plans + 1), np.zeros((plans + 1, width)), np.zeros(plans + 1))
    for embedding, free in zip(embeddings.astype(np.float64), labels, strict=True):
        _add(embedding, float(embedding @ embedding), free, not free.any(), moments)
    return moments


@lean
def _add(embedding: Floats, square: float, free: Flags, none: bool, moments: Moments) -> None:
    for row in range(free.shape[0] + 1):
        if none if row == 0 else free[row - 1]:
            moments.counts[row] += 1.0
            moments.squares[row] += square
            for k in range(embedding.shape[0]):
                moments.sums[row, k] += embedding[k]


def scatter(moments: Moments, centroids: Floats32) -> float:
    """The mean squared distance of problems to the centroids ``[N + 1, D]`` of their free plans."""
    present = moments.counts > 0
    lengths = np.square(centroids[present].astype(np.float64)).sum(1)
    spread = moments.squares[present] - moments.counts[present] * lengths
    return float(spread.sum() / moments.counts[present].sum())


def ridge_readout(embeddings: Floats32, moments: Moments) -> tuple[Floats32, Floats32]:
    """Vectors ``[N + 1, D]`` and biases ``[N + 1]`` by ridge regression of "this plan is free" on embeddings.

    Scores estimate probabilities. Row 0 is "no plan is free".
    """
    count, width = embeddings.shape
    mean = embeddings.mean(0, dtype=np.float64)
    centred = embeddings - mean
    covariance = centred.T @ centred / count
    covariance += (RIDGE * np.trace(covariance) / width + np.finfo(np.float64).tiny) * np.eye(width)
    shares = moments.counts / count
    products = moments.sums / count - shares[:, np.newaxis] * mean
    vectors = np.linalg.solve(covariance, products.T).T
    biases = shares - vectors @ mean
    return np.ascontiguousarray(vectors, np.float32), biases.astype(np.float32)


def beside_cells(vectors: Floats32, biases: Floats32) -> tuple[Floats32, Floats32]:
    """Turn a readout of probabilities into logits, to which ``Memory.scores`` adds what blocked cells tell.

    A probability p has about the logit 4 (p - 1/2). A plan with ``EVEN_CELLS`` blocked cells is to have it as
    it is; row 0 is to win only by clear odds.
    """
    vectors, biases = 4.0 * vectors, 4.0 * (biases - 0.5)
    biases[0] -= np.log(NO_PLAN_ODDS)
    biases[1:] -= CELL_SCORES[EVEN_CELLS]
    return vectors.astype(np.float32), biases.astype(np.float32)
