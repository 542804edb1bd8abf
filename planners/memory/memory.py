"""The memory: stored plans, and what finds those that may fit a problem."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from planners.memory.encoder.encoder import Encoder, Weights, to_onnx
from planners.memory.encoder.forward_pass import Forward, forward_of
from planners.memory.plans.fit import START_TOLERANCE
from planners.memory.plans.sweeps import PlanSweeps
from planners.memory.ranking.inverted_lists import InvertedLists
from planners.world.arrays import Floats32
from planners.world.geometry.occupancy import Bits
from planners.world.problem import Plan
from planners.world.vehicles.vehicle import Vehicle


@dataclass(frozen=True, eq=False)
class Memory:
    """Stored plans and what finds them: masks, encoder, centroids, readout. Plan ``i`` is row ``i + 1``."""

    class_name: str
    vehicle: Vehicle
    plans: Sequence[Plan]  # N plans in the canonical frame
    sweeps: PlanSweeps  # the same plans' swept boxes
    masks: Bits  # [N, 64] and the cells of the occupancy grid that these meet, a bit each
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
    def scales(self) -> tuple[float, ...]:
        """Of the problems whose plans it holds: metres of the world outside in a canonical metre."""
        return tuple(self.metadata.get("scales", (1.0,)))

    @functools.cached_property
    def encoder(self) -> Encoder:
        """The encoder for many grids at once."""
        return Encoder(to_onnx(self.weights))

    @functools.cached_property
    def forward(self) -> Forward:
        """The encoder for the bits of one grid."""
        return forward_of(self.weights)

    @functools.cached_property
    def heading(self) -> float | None:
        """The heading (radians) that all stored plans begin with; None if they do not agree."""
        headings = self.sweeps.first_poses[:, 2]
        return float(headings[0]) if len(headings) and np.ptp(headings) <= START_TOLERANCE else None

    def begins_with(self, heading: float) -> bool:
        """Whether all stored plans begin with this heading (radians)."""
        return self.heading is not None and abs(heading - self.heading) <= START_TOLERANCE


def scale_fault(memory: Memory, scale: float) -> str | None:
    """Why a memory has nothing to say of problems of a scale, or None."""
    if scale in memory.scales:
        return None
    made = " and ".join(f"{each:g}" for each in memory.scales)
    return (
        f"memory of {memory.class_name} was made of problems of scale {made}, asked was {scale:g}: make one "
        "of that scale"
    )
