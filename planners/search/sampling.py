"""Where a planner's samples come from: anywhere, a disc, or near a guiding plan."""

from __future__ import annotations

import math

import numpy as np

from planners.search.outcome import Guide
from planners.world.jit import inlined, lean
from planners.world.problem import Floats


@inlined
def in_disc(x: float, y: float, radius: float, rng: np.random.Generator) -> tuple[float, float]:
    """A uniform point of the disc around (x, y), metres."""
    angle = 2.0 * math.pi * rng.random()
    r = radius * math.sqrt(rng.random())
    return x + r * math.cos(angle), y + r * math.sin(angle)


@inlined
def in_bounds(bounds: Floats, rng: np.random.Generator) -> tuple[float, float]:
    """A uniform point of the bounds ``[4]``, metres."""
    return (
        bounds[0] + (bounds[2] - bounds[0]) * rng.random(),
        bounds[1] + (bounds[3] - bounds[1]) * rng.random(),
    )


@lean
def guided(
    guide: Guide, goal: Floats, bounds: Floats, near_m: float, far_m: float, rng: np.random.Generator
) -> tuple[float, float]:
    """A point near plan i with probability b_i, of the goal disc with b_goal, else anywhere in the bounds.

    Near: around a uniformly drawn state of the plan, within a radius of U(near_m, far_m) (paper, III-D).
    """
    draw = rng.random()
    for i in range(guide.probabilities.shape[0]):
        draw -= guide.probabilities[i]
        if draw < 0.0:
            first = guide.starts[i]
            point = guide.points[first + int(rng.random() * (guide.starts[i + 1] - first))]
            return in_disc(point[0], point[1], near_m + (far_m - near_m) * rng.random(), rng)
    if draw < guide.goal_probability:
        return in_disc(goal[0], goal[1], goal[2], rng)
    return in_bounds(bounds, rng)
