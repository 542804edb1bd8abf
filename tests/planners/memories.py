"""Memories without training: masks and exact checks find their plans, the encoder knows nothing."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from planners.memory.encoder.encoder import Architecture, initial_weights
from planners.memory.memory import Memory
from planners.memory.plans.cell_masks import masks_of
from planners.memory.plans.sweeps import sweep_plans
from planners.search.registry import plan
from planners.solve import solve
from planners.world.arrays import Floats
from planners.world.problem import Plan, Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, Vehicle
from tests.worlds import box, problem_of, strewn


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


def memory_that_prefers(biases: Sequence[float]) -> Memory:
    """Five plans through strewn boxes, ranked by ``biases`` whatever the problem; row 0 is "no plan"."""
    found = [plan("follow", strewn(seed, 30), generator(seed)).plan for seed in range(5)]
    return memory_of_plans([each for each in found if each is not None], biases)


@functools.cache
def shared_memory() -> Memory:
    return memory_that_prefers([-1, 1, 2, 3, 4, 5])


def blocked_everywhere() -> Problem:
    """A wall with one gap that no plan of ``memory_that_prefers`` takes."""
    return problem_of([box(10, -2, 2.35, 4, 1), box(24, 30, 2.35, 30, 0.5)], "wall")
