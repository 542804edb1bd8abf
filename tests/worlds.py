"""Small worlds for tests: boxes strewn between start and goal, and walls placed on purpose."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from planners.world.arrays import Floats
from planners.world.problem import BOUNDS, CANONICAL_GOAL, CANONICAL_START, GOAL_RADIUS, Problem, obstacles_of

SHARED = Path(__file__).parents[2] / "shared" / "worlds"  # real worlds, where they lie beside the repository


def box(x: float, y: float, angle: float, half_length: float, half_width: float) -> Floats:
    """A rectangle ``[4, 2]`` around (x, y)."""
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [half_length, half_width]
    cos, sin = np.cos(angle), np.sin(angle)
    return corners @ np.array([[cos, sin], [-sin, cos]]) + [x, y]


def problem_of(polygons: list[Floats], name: str = "test") -> Problem:
    """A canonical problem with each convex polygon an obstacle of its own."""
    return Problem(
        name,
        "test",
        CANONICAL_START,
        CANONICAL_GOAL,
        GOAL_RADIUS,
        BOUNDS,
        obstacles_of([[polygon] for polygon in polygons]),
    )


def strewn(seed: int, count: int) -> Problem:
    """``count`` boxes at random, clear of start and goal."""
    rng = np.random.default_rng(seed)
    polygons: list[Floats] = []
    while len(polygons) < count:
        x, y = rng.uniform(-5.0, 55.0, 2)
        if min(np.hypot(x, y), np.hypot(x - 50.0, y - 50.0)) > 5.0:
            polygons.append(box(x, y, rng.uniform(0, np.pi), *rng.uniform(0.5, 2.2, 2)))
    return problem_of(polygons, f"strewn-{seed}-{count}")


def walled_goal() -> Problem:
    """A goal that nothing can reach: four walls around it."""
    return problem_of(
        [
            box(50 + dx, 50 + dy, 0.0, *half)
            for dx, dy, half in ((-4, 0, (0.5, 5)), (4, 0, (0.5, 5)), (0, -4, (5, 0.5)), (0, 4, (5, 0.5)))
        ],
        "walled-goal",
    )
