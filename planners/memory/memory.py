"""The memory: stored plans, and what finds those that may fit a problem."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from planners.memory.encoder.encoder import Encoder, Weights, to_onnx
from planners.memory.encoder.forward_pass import Forward, forward_of
from planners.memory.library.plan_library import PlanLibrary
from planners.memory.plans.cell_masks import CELL_SCORES, rank_by_cells
from planners.memory.plans.free import START_TOLERANCE
from planners.memory.plans.plan_arrays import store_plans
from planners.memory.plans.sweeps import PlanSweeps
from planners.memory.ranking.inverted_lists import InvertedLists
from planners.memory.ranking.readout import nearest_readout
from planners.world.arrays import Floats32, Integers
from planners.world.driving_cost import cost_of
from planners.world.geometry.occupancy import Bits
from planners.world.problem import Plan
from planners.world.vehicles.vehicle import Vehicle, state_size
from planners.world.workspace import Workspace


@dataclass(frozen=True, eq=False)
class Memory:
    """Stored plans, and what finds them: masks, encoder, centroids, readout. Plan ``i`` has row ``i + 1``."""

    class_name: str
    vehicle: Vehicle
    plans: Sequence[Plan]  # N plans in the canonical frame
    sweeps: PlanSweeps  # the swept boxes of these plans
    masks: Bits  # [N, 64] the cells of the occupancy grid that each plan sweeps, a bit each
    centroids: Floats32  # [N + 1, D] mean embedding of each plan's problems; row 0: of the problems S_0
    vectors: Floats32  # [N + 1, D] readout
    biases: Floats32  # [N + 1] readout
    objective: str  # what the encoder was trained for: "triplet" or "labels"
    weights: Weights  # of the encoder
    metadata: dict[str, Any] = field(default_factory=dict)  # JSON values
    lists: InvertedLists | None = None  # over the readout of very many plans

    def __post_init__(self) -> None:
        plans = len(self.plans)
        for name, extra in (("masks", 0), ("centroids", 1), ("vectors", 1), ("biases", 1)):
            rows, wanted = len(getattr(self, name)), plans + extra
            if rows != wanted:
                raise ValueError(
                    f"Memory has {rows} rows of {name}; {plans} plans need {wanted}. "
                    "Were they built together?"
                )

    @functools.cached_property
    def scales(self) -> tuple[float, ...]:
        """The scales of the problems that it was made of: real metres in a canonical metre."""
        return tuple(self.metadata.get("scales", (1.0,)))

    @functools.cached_property
    def encoder(self) -> Encoder:
        """The encoder for many grids at once."""
        return Encoder(to_onnx(self.weights))

    @functools.cached_property
    def forward(self) -> Forward:
        """The encoder for the bits ``[64]`` of one grid."""
        return forward_of(self.weights)

    @functools.cached_property
    def nearest(self) -> tuple[Floats32, Floats32]:
        """Vectors ``[N + 1, D]`` and biases ``[N + 1]`` that score plans by how near their centroids are."""
        return nearest_readout(self.centroids, 0.0)

    @functools.cached_property
    def costs(self) -> Floats32:
        """What it costs to drive each plan, ``[N]`` seconds: how long it takes, if nothing else counts."""
        return np.array([cost_of(plan, self.vehicle) for plan in self.plans], np.float32)

    @functools.cached_property
    def by_cost(self) -> Integers:
        """All plans ``[N]``, the cheapest to drive first."""
        return np.argsort(self.costs, kind="stable").astype(np.int32)

    @functools.cached_property
    def library(self) -> PlanLibrary:
        """The plans as a library, whose parts answer questions that are not canonical."""
        plans = store_plans(self.plans, state_size(self.vehicle))
        names = tuple(f"{self.class_name}-{number}" for number in range(len(plans)))
        return PlanLibrary(self.class_name, self.vehicle, plans, names, self.scales)

    @functools.cached_property
    def heading(self) -> float | None:
        """The heading (radians) that all stored plans begin with; None if they do not agree."""
        headings = self.sweeps.first_poses[:, 2]
        return float(headings[0]) if len(headings) and np.ptp(headings) <= START_TOLERANCE else None

    def begins_with(self, heading: float) -> bool:
        """Whether all stored plans begin with this heading (radians)."""
        return self.heading is not None and abs(heading - self.heading) <= START_TOLERANCE

    def scores(
        self,
        embedding: Floats32,
        bits: Bits,
        workspace: Workspace | None = None,
        among: Integers | None = None,
    ) -> Floats32:
        """Score "no plan" and plans for a problem, by the readout and what their blocked cells tell.

        A readout of the triplet objective knows distances, to which cells have nothing to add.

        Args:
            embedding: ``[D]`` of the problem.
            bits: ``[64]`` the cells of the problem that are not free.
            workspace: the caller's buffers; by default new ones.
            among: ``[n]`` the plans to score; by default all N.

        Returns:
            Scores ``[n + 1]``, "no plan" first.
        """
        rows = slice(None) if among is None else np.concatenate(([0], among + 1))
        scores: Floats32 = self.vectors[rows] @ embedding + self.biases[rows]
        if self.objective == "labels":
            masks = self.masks if among is None else self.masks[among]
            scores[1:] += CELL_SCORES[rank_by_cells(masks, bits, workspace).cells]
        return scores


def scale_fault(memory: Memory | PlanLibrary, scale: float) -> str | None:
    """Return why a memory cannot be used for problems of a scale, or None if it can."""
    if scale in memory.scales:
        return None
    scales = " and ".join(f"{each:g}" for each in memory.scales)
    return (
        f"memory of {memory.class_name} was made of problems of scale {scales}, expected {scale:g}: make "
        "one of that scale"
    )
