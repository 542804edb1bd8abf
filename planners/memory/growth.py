"""Growth: a memory of many plans whose encoder was trained on few, without training again.

The encoder stays as it is. Some problems of the class are embedded, and each plan is checked in each of them:
from that alone follow the plan's centroid and its row of the readout, in closed form. So a plan costs its
checks, rows of other plans stay as they were, and what was learned about obstacles serves new plans too.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from planners.memory.memory import Memory
from planners.memory.plans.cell_masks import masks_of
from planners.memory.plans.fit import free_plans
from planners.memory.plans.sweeps import sweep_plans
from planners.memory.ranking.inverted_lists import FROM_PLANS, list_readout
from planners.memory.ranking.readout import NO_PLAN_ODDS, mean_embeddings, nearest_readout
from planners.world.arrays import Flags, Floats, Floats32
from planners.world.geometry.collision import scene_of
from planners.world.geometry.occupancy import occupancy_of
from planners.world.jit import lean
from planners.world.problem import Plan, Problem

RIDGE = 1e-3  # of the mean variance of an embedding's numbers; measured: between 1e-4 and 1e-1 all is alike


class Moments(NamedTuple):
    """What n problems say of N plans: row ``i + 1`` sums over the problems in which plan i is free.

    Row 0 sums over the problems in which none of the plans is free.
    """

    counts: Floats  # [N + 1] problems
    sums: Floats  # [N + 1, D] their embeddings
    squares: Floats  # [N + 1] the embeddings' squared lengths


def grow(memory: Memory, plans: Sequence[Plan], problems: Sequence[Problem]) -> Memory:
    """A memory of ``plans`` with the encoder of ``memory``, read out by what canonical ``problems`` say.

    Some 2,000 problems are enough (docs/growth.md); each takes a check of all plans. A memory's own plans
    are kept only if they are among ``plans``. No problems, or no plans: ValueError.
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
        vectors, biases = ridge_readout(embeddings, moments)
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
    """Sum up n problems: ``embeddings [n, D]`` and, one after another, which of N plans are free ``[N]``."""
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
    """Mean squared distance of a problem to the centroids of its free plans."""
    met = moments.counts > 0
    lengths = np.square(centroids[met].astype(np.float64)).sum(1)
    spread = moments.squares[met] - moments.counts[met] * lengths
    return float(spread.sum() / moments.counts[met].sum())


def ridge_readout(embeddings: Floats32, moments: Moments) -> tuple[Floats32, Floats32]:
    """Vectors ``[N + 1, D]`` and biases: the ridge regression of "this plan is free" (1 or 0) on embeddings.

    Scores estimate probabilities. Where no plan is free in a problem, row 0 is to win only by clear odds:
    its bias is lowered by the difference that these odds make.
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
    biases[0] -= (NO_PLAN_ODDS - 1.0) / (NO_PLAN_ODDS + 1.0)
    return np.ascontiguousarray(vectors, np.float32), biases.astype(np.float32)
