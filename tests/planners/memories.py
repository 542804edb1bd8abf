"""Memories without training: masks and exact checks find their plans, the encoder knows nothing."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from planners.memory.encoder.encoder import Architecture, initial_weights
from planners.memory.memory import Memory
from planners.memory.plans.cell_masks import masks_of
from planners.memory.plans.sweeps import sweep_plans
from planners.solve import solve
from planners.world.arrays import Floats
from planners.world.problem import Plan, Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, Vehicle


def memory_of(
    problems: Iterable[Problem], vehicle: Vehicle = CAR, metadata: dict[str, Any] | None = None
) -> Memory:
    """A memory of Follow's plans for ``problems``, those that it solves."""
    attempts = [solve(problem, "follow", vehicle=vehicle) for problem in problems]
    plans = [attempt.plan for attempt in attempts if attempt.plan is not None]
    return memory_of_plans(plans, np.zeros(len(plans) + 1), vehicle, metadata)


def memory_of_plans(
    plans: Sequence[Plan],
    biases: Sequence[float] | Floats,
    vehicle: Vehicle = CAR,
    metadata: dict[str, Any] | None = None,
) -> Memory:
    """A memory that ranks its plans by ``biases``, whatever the problem; row 0 is "no plan"."""
    sweeps = sweep_plans(plans, vehicle)
    network = Architecture(channels=(2, 2), hidden=(4,), dimensions=3)
    zeros = np.zeros((len(plans) + 1, 3), np.float32)
    return Memory(
        class_name="test",
        vehicle=vehicle,
        plans=tuple(plans),
        sweeps=sweeps,
        masks=masks_of(sweeps),
        centroids=zeros,
        vectors=zeros,
        biases=np.array(biases, np.float32),
        objective="labels",
        weights=initial_weights(network, generator(0)),
        metadata=metadata or {},
    )
