"""How the three problem classes place their obstacles: settings and a kernel for each.

Every obstacle has a site of its own in the class and is drawn around it. That makes a class worth
remembering: in clutter that is placed anew each time no plan ever fits twice (docs/decisions/0002).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planners.world.classes import shapes
from planners.world.jit import jit
from planners.world.problem import BOUNDS, Obstacles

MIDDLE = (25.0, 25.0)  # metres: half-way between start and goal
ARC_PART = math.radians(15.0)  # the most that a quad of an arc turns; its chord is within 1 % of the arc
_R2_X, _R2_Y = 0.7548776662466927, 0.5698402909980532  # golden ratios of the plane, for evenly spread sites


class Scatter(NamedTuple):
    """Small shapes near sites: triangles, boxes, regular polygons, crosses, L and Z."""

    sites: int  # evenly spread over the bounds, the same ones in every draw: the density
    presence: float  # probability that a site has a shape
    jitter_m: float  # farthest that a shape lies from its site, in x and in y
    radius_min_m: float
    radius_max_m: float
    strays: int  # further shapes, anywhere


class Curves(NamedTuple):
    """Arcs of concentric circles around the middle, with gaps, and some small shapes."""

    curves: int
    inner_m: float  # radius of the innermost curve
    outer_m: float  # radius of the outermost
    segments: int  # of the innermost curve; each next one has one more
    gap_m: float  # separation among the segments of a curve
    slip_m: float  # farthest that a curve's gaps move along it
    shift_m: float  # farthest that the common centre lies from the middle, in x and in y
    presence: float  # probability of each segment
    thickness_m: float
    small: Scatter


class Random(NamedTuple):
    """Small shapes all over."""

    shapes: Scatter


class Trap(NamedTuple):
    """Bug traps between start and goal, open towards the start, and some small shapes."""

    width_m: float  # of the trap in the middle
    flank_m: float  # of the traps on its two sides
    gap_m: float  # passage between neighbouring traps
    depth_m: float  # of the arms
    thickness_m: float
    jitter_m: float  # farthest that a trap lies from its site, in x and in y
    turn: float  # largest turn of a trap, radians
    small: Scatter


@jit
def _around(rng: np.random.Generator, centre: float, reach: float) -> float:
    """A number drawn evenly within ``reach`` of ``centre``."""
    return centre + reach * (2.0 * rng.random() - 1.0)


@jit
def _scatter(canvas: shapes.Canvas, scatter: Scatter, rng: np.random.Generator) -> None:
    """Draw the small shapes of a scatter."""
    side = BOUNDS[2] - BOUNDS[0]
    for i in range(scatter.sites + scatter.strays):
        x = BOUNDS[0] + side * ((0.5 + (i + 1) * _R2_X) % 1.0)
        y = BOUNDS[1] + side * ((0.5 + (i + 1) * _R2_Y) % 1.0)
        x = _around(rng, x, scatter.jitter_m)
        y = _around(rng, y, scatter.jitter_m)
        present = rng.random() < scatter.presence
        if i >= scatter.sites:
            x = BOUNDS[0] + side * rng.random()
            y = BOUNDS[1] + side * rng.random()
            present = True
        shape = int(rng.integers(0, shapes.SHAPES))
        angle = 2.0 * math.pi * rng.random()
        radius = scatter.radius_min_m + (scatter.radius_max_m - scatter.radius_min_m) * rng.random()
        sides = int(rng.integers(5, 11))
        if present:
            shapes.add_shape(canvas, shape, x, y, angle, radius, sides)
            shapes.end_obstacle(canvas)


@jit
def draw_curves(settings: Curves, rng: np.random.Generator) -> Obstacles:
    """Draw the obstacles of a Curves problem."""
    canvas = shapes.new_canvas()
    x = _around(rng, MIDDLE[0], settings.shift_m)
    y = _around(rng, MIDDLE[1], settings.shift_m)
    for curve in range(settings.curves):
        share = curve / max(settings.curves - 1, 1)
        radius = settings.inner_m + share * (settings.outer_m - settings.inner_m)
        segments = settings.segments + curve
        pitch = 2.0 * math.pi / segments
        sweep = pitch - settings.gap_m / radius
        begin = math.pi / 4.0 + 0.5 * pitch * (curve % 2) + _around(rng, 0.0, settings.slip_m) / radius
        parts = math.ceil(sweep / ARC_PART)
        for segment in range(segments):
            if rng.random() < settings.presence:
                shapes.add_arc(
                    canvas, x, y, radius, begin + segment * pitch, sweep, settings.thickness_m, parts
                )
                shapes.end_obstacle(canvas)
    _scatter(canvas, settings.small, rng)
    return shapes.finished(canvas)


@jit
def draw_random(settings: Random, rng: np.random.Generator) -> Obstacles:
    """Draw the obstacles of a Random problem."""
    canvas = shapes.new_canvas()
    _scatter(canvas, settings.shapes, rng)
    return shapes.finished(canvas)


@jit
def draw_trap(settings: Trap, rng: np.random.Generator) -> Obstacles:
    """Draw the obstacles of a Trap problem."""
    canvas = shapes.new_canvas()
    to_flank = 0.5 * (settings.width_m + settings.flank_m) + settings.gap_m
    for side in (0, -1, 1):
        across = side * to_flank * math.sqrt(0.5)
        x = _around(rng, MIDDLE[0] - across, settings.jitter_m)
        y = _around(rng, MIDDLE[1] + across, settings.jitter_m)
        angle = _around(rng, math.pi / 4.0, settings.turn)
        width = settings.width_m if side == 0 else settings.flank_m
        shapes.add_trap(canvas, x, y, angle, width, settings.depth_m, settings.thickness_m)
        shapes.end_obstacle(canvas)
    _scatter(canvas, settings.small, rng)
    return shapes.finished(canvas)
