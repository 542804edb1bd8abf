"""A small world for memory tests: a few driven plans, and boxes strewn at random."""

from __future__ import annotations

import math

import numpy as np
import pytest

from planners.memory.plans.experience import Experience
from planners.memory.plans.free import free_plans
from planners.memory.plans.sweeps import sweep_plans
from planners.world.geometry.collision import scene_of
from planners.world.problem import (
    BOUNDS,
    CANONICAL_START,
    CAR,
    GOAL_RADIUS,
    Obstacles,
    Plan,
    Problem,
    obstacles_of,
)
from planners.world.randomness import generator
from planners.world.vehicles.dynamics import simulate
from tests.worlds import box


def boxes(rng: np.random.Generator, count: int = 12) -> Obstacles:
    """Boxes and two-piece crosses anywhere but around the start."""
    groups = []
    while len(groups) < count:
        x, y = rng.uniform(-5.0, 55.0, 2)
        if math.hypot(x, y) < 7.0:
            continue
        angle, length, width = rng.uniform(0.0, math.pi), rng.uniform(0.5, 3.0), rng.uniform(0.3, 1.5)
        group = [box(x, y, angle, length, width)]
        if rng.random() < 0.3:
            group.append(box(x, y, angle, width, length))
        groups.append(group)
    return obstacles_of(groups)


def driven(rng: np.random.Generator, steps: int = 220) -> Plan:
    """A plan that sets off from the canonical start and wags to and fro."""
    controls = np.zeros((steps, 2))
    controls[:15, 0] = 2.0
    controls[:, 1] = 0.12 * np.sin(np.arange(steps) / rng.uniform(15.0, 25.0) + rng.uniform(0.0, 0.4))
    return Plan(simulate(np.array([*CANONICAL_START, 0.0, 0.0]), controls, CAR), controls)


def problem_around(plan: Plan, obstacles: Obstacles, name: str) -> Problem:
    x, y = plan.states[-1, :2]
    return Problem(name, "boxes", CANONICAL_START, (float(x), float(y)), GOAL_RADIUS, BOUNDS, obstacles)


def make_experiences(count: int) -> list[Experience]:
    made: list[Experience] = []
    attempt = 0
    while len(made) < count:
        rng = generator(11, "experience", attempt)
        attempt += 1
        plan = driven(rng)
        problem = problem_around(plan, boxes(rng), f"boxes-{len(made)}")
        if free_plans(sweep_plans([plan]), scene_of(problem))[0]:
            made.append(Experience(problem, plan))
    return made


@pytest.fixture(scope="session")
def experiences() -> list[Experience]:
    return make_experiences(8)


@pytest.fixture(scope="session")
def draw():
    return boxes
