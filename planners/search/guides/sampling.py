"""Where planners sample: anywhere, in a disc, or along a guiding path."""

from __future__ import annotations

import math

from numba.np.random.generator_core import next_double
from numpy.random import BitGenerator

from planners.search.query import Guide
from planners.world.arrays import Floats
from planners.world.jit import inlined, lean


@inlined
def uniform(rng: BitGenerator) -> float:
    """The number from 0 to 1 that a generator with these random bits would draw next.

    Kernels take the bits of a generator, since Numba leaks a reference to a generator with each call of a
    kernel that counts no references.
    """
    number: float = next_double(rng)
    return number


@inlined
def in_disc(x: float, y: float, radius: float, rng: BitGenerator) -> tuple[float, float]:
    """A uniform point of a disc around (x, y), in metres."""
    angle = 2.0 * math.pi * uniform(rng)
    r = radius * math.sqrt(uniform(rng))
    return x + r * math.cos(angle), y + r * math.sin(angle)


@inlined
def in_bounds(bounds: Floats, rng: BitGenerator) -> tuple[float, float]:
    """A uniform point of the bounds ``[4]``, in metres."""
    return (
        bounds[0] + (bounds[2] - bounds[0]) * uniform(rng),
        bounds[1] + (bounds[3] - bounds[1]) * uniform(rng),
    )


@lean
def guided(
    guide: Guide, goal: Floats, bounds: Floats, near_m: float, far_m: float, rng: BitGenerator
) -> tuple[float, float, float, float]:
    """Draw where to extend from and where to, x and y each: along path i of the guide with probability b_i.

    The first point lies around a uniformly drawn point of the path, within a radius U(near_m, far_m), the
    second around one of the ``guide.lead`` points after it. With probability b_goal the target lies in the
    goal disc, else anywhere in the bounds, and what is nearest to the target is extended. It is, too, if
    there is no lead: the first point is the target then. (So does the paper, III-D. That says where to be,
    but not in which direction to go on, and is slower than no guide: docs/planners.md.)
    """
    draw = uniform(rng)
    for i in range(guide.probabilities.shape[0]):
        draw -= guide.probabilities[i]
        if draw < 0.0:
            first = guide.starts[i]
            count = guide.starts[i + 1] - first
            chosen = int(uniform(rng) * count)
            ahead = chosen
            if guide.lead > 0:
                ahead = min(chosen + 1 + int(uniform(rng) * guide.lead), count - 1)
            radius = near_m + (far_m - near_m) * uniform(rng)
            x, y = in_disc(guide.points[first + chosen, 0], guide.points[first + chosen, 1], radius, rng)
            if guide.lead == 0:
                return x, y, x, y
            to_x, to_y = in_disc(guide.points[first + ahead, 0], guide.points[first + ahead, 1], near_m, rng)
            return x, y, to_x, to_y
    if draw < guide.goal_probability:
        x, y = in_disc(goal[0], goal[1], goal[2], rng)
    else:
        x, y = in_bounds(bounds, rng)
    return x, y, x, y
