"""Makes a memory of a trained encoder and its plans."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from planners.memory.encoder.training import TrainedEncoder
from planners.memory.memory import Memory
from planners.memory.plans.cell_masks import masks_of
from planners.memory.plans.sweeps import sweep_plans
from planners.world.problem import Plan
from planners.world.vehicles.vehicle import CAR, Vehicle


def build_memory(
    trained: TrainedEncoder,
    plans: Sequence[Plan],
    class_name: str,
    vehicle: Vehicle = CAR,
    metadata: dict[str, Any] | None = None,
) -> Memory:
    """Make a memory.

    Args:
        trained: the encoder and its readout.
        plans: the N plans that the encoder was trained for, in the same order.
        class_name: of the problems.
        vehicle: that drives the plans.
        metadata: JSON values to keep with the memory.
    """
    sweeps = sweep_plans(plans, vehicle)
    return Memory(
        class_name=class_name,
        vehicle=vehicle,
        plans=tuple(plans),
        sweeps=sweeps,
        masks=masks_of(sweeps),
        centroids=trained.centroids,
        vectors=trained.vectors,
        biases=trained.biases,
        objective=trained.settings.objective,
        weights=trained.weights,
        metadata=metadata or {},
    )
