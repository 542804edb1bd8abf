"""Recall: embed a problem's occupancy grid, and take the stored plans that score best.

Both training objectives rank by an inner product and a bias, one row a plan: for the triplet objective
``w = c, b = -|c|^2 / 2``, whose order is that of the distance to the centroids; for the label objective the
learned vector and bias. Row 0 stands for "no stored plan is free": where it scores best, nothing is recalled.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from planners.memory.encoder import Encoder, Floats32, Weights, to_onnx
from planners.memory.inverted_lists import InvertedLists
from planners.memory.labels import PlanSweeps
from planners.memory.masks import Masks
from planners.world.occupancy import Grid
from planners.world.problem import Integers, Plan
from planners.world.vehicle import Vehicle


@dataclass(frozen=True, eq=False)
class Memory:
    """Stored plans and what finds them: masks, encoder, centroids, readout. Plan ``i`` is row ``i + 1``."""

    class_name: str
    vehicle: Vehicle
    plans: Sequence[Plan]  # N plans in the canonical frame
    sweeps: PlanSweeps  # the same plans' swept boxes
    masks: Masks  # [N, 64] and the cells of the occupancy grid that these meet, a bit each
    centroids: Floats32  # [N + 1, D] mean embedding of each plan's problems; row 0: of the S_0 problems
    vectors: Floats32  # [N + 1, D] readout
    biases: Floats32  # [N + 1] readout
    objective: str  # what the encoder was trained for: "triplet" or "labels"
    weights: Weights  # of the encoder
    metadata: dict[str, Any] = field(default_factory=dict)  # JSON values only
    lists: InvertedLists | None = None  # over the readout of very many plans

    def __post_init__(self) -> None:
        rows = len(self.plans) + 1
        if len(self.masks) != len(self.plans):
            raise ValueError(
                f"Memory has masks of {len(self.masks)} plans, {len(self.plans)} are stored. Were they built "
                "together?"
            )
        for name in ("centroids", "vectors", "biases"):
            if len(getattr(self, name)) != rows:
                raise ValueError(
                    f"Memory has {len(getattr(self, name))} rows of {name}, {len(self.plans)} plans need "
                    f"{rows} (row 0 is 'no plan'). Were they built together?"
                )

    @functools.cached_property
    def encoder(self) -> Encoder:
        """What runs the encoder."""
        return Encoder(to_onnx(self.weights))


def scores(memory: Memory, embedding: Floats32) -> Floats32:
    """Score ``[N + 1]`` of every row for one embedding ``[D]``; higher is better, row 0 is "no plan"."""
    result: Floats32 = memory.vectors @ embedding + memory.biases
    return result


def nearest(memory: Memory, embedding: Floats32, k: int) -> tuple[int, ...]:
    """The (at most) ``k`` best plans for an embedding ``[D]``, best first; none where row 0 scores best."""
    if k < 1:
        raise ValueError(f"top k is {k}, it must be at least 1")
    row_scores = scores(memory, embedding)
    plan_scores = row_scores[1:]
    if plan_scores.size == 0 or row_scores[0] > plan_scores.max():
        return ()
    worst = max(plan_scores.size - k, 0)
    best = np.flatnonzero(plan_scores >= np.partition(plan_scores, worst)[worst])
    best = best[np.argsort(-plan_scores[best], kind="stable")]
    return tuple(int(i) for i in best[:k])


def recall(memory: Memory, grid: Grid, k: int) -> tuple[int, ...]:
    """The (at most) ``k`` best plans for an occupancy grid ``[64, 64]``, best first."""
    return nearest(memory, memory.encoder(grid), k)


def rank(memory: Memory, grid: Grid) -> tuple[Integers, bool]:
    """All plans ``[N]``, best first, and whether "no plan" scores better than each of them."""
    row_scores = scores(memory, memory.encoder(grid))
    order = np.argsort(-row_scores[1:], kind="stable").astype(np.int32)
    return order, bool(order.size == 0 or row_scores[0] > row_scores[1:].max())
