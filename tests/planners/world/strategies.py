"""What the world's tests draw: convex polygons, poses, problems."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from planners.world.arrays import Floats
from planners.world.problem import (
    BOUNDS,
    CANONICAL_GOAL,
    CANONICAL_START,
    GOAL_RADIUS,
    Obstacles,
    Problem,
    obstacles_of,
)

angles = st.floats(-math.pi, math.pi)
seeds = st.integers(0, 2**32 - 1)


def convex_polygon(rng: np.random.Generator, reach: float) -> Floats:
    """A convex polygon ``[n, 2]`` around 0: a random hull, sometimes flattened to a thin sliver."""
    points = rng.normal(size=(int(rng.integers(3, 9)), 2))
    points *= reach * np.array([1.0, rng.choice([1.0, 0.3, 0.01])])
    turn = rng.uniform(-math.pi, math.pi)
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    return points[ConvexHull(points).vertices] @ rotation.T


def clutter(rng: np.random.Generator, count: int) -> Obstacles:
    """Convex obstacles anywhere in the canonical window, some reaching out of it."""
    return obstacles_of(
        [[convex_polygon(rng, rng.uniform(0.3, 3.0)) + rng.uniform(-8.0, 58.0, 2)] for _ in range(count)]
    )


def problem_with(obstacles: Obstacles, bounds: tuple[float, float, float, float] = BOUNDS) -> Problem:
    """A canonical problem with these obstacles."""
    return Problem("test", "test", CANONICAL_START, CANONICAL_GOAL, GOAL_RADIUS, bounds, obstacles)


def box_corners(x: float, y: float, heading: float, half_length: float, half_width: float) -> Floats:
    """Corners ``[4, 2]`` of a box around (x, y), counter-clockwise."""
    cos, sin = math.cos(heading), math.sin(heading)
    local = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (half_length, half_width)
    return local @ np.array([[cos, sin], [-sin, cos]]) + (x, y)
