"""The exact gap between a box and a convex piece, its axis, and what nearness costs."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from planners.world.arrays import Box, Floats
from planners.world.geometry.collision import NORMAL_X, NORMAL_Y, OFFSET, Scene, X, Y
from planners.world.jit import inlined, jit, lean
from planners.world.trigonometry import length

FIXED_NORMAL: Final = -1  # kind of an axis that stays where it is while the box moves
AHEAD, BEHIND, LEFT, RIGHT = range(4)  # kinds of axes that are a side of the box and turn with it
Axis = tuple[int, float, float, float]  # kind; normal (x, y) and offset, or the piece's corner (x, y) and 0


class Barrier(NamedTuple):
    """What it costs to be near an obstacle.

    A gap below the range costs ``strength (gap / range - 1 - log(gap / range))``.

    Where it is smaller than ``contact`` the parabola that fits there goes on, so that a blocked state has a
    cost, too.
    """

    strength: float  # metres of driving
    range_m: float
    margin_m: float  # taken off every gap
    widest_hitch: float  # radians
    contact: float  # metres


@inlined
def extent(nx: float, ny: float, box: Box) -> float:
    """How far a box reaches from its centre along a unit normal, in metres."""
    _, _, cos, sin, half_length, half_width = box
    return half_length * abs(nx * cos + ny * sin) + half_width * abs(ny * cos - nx * sin)


@inlined
def gap_along(axis: Axis, box: Box) -> float:
    """The gap of a box along an axis that ``widest_gap`` gave for a box near it, in metres."""
    kind, p, q, offset = axis
    x, y, cos, sin, half_length, half_width = box
    if kind == FIXED_NORMAL:
        return p * x + q * y - extent(p, q, box) - offset
    ahead = (p - x) * cos + (q - y) * sin
    left = (q - y) * cos - (p - x) * sin
    if kind == AHEAD:
        return ahead - half_length
    elif kind == BEHIND:
        return -ahead - half_length
    elif kind == LEFT:
        return left - half_width
    else:
        return -left - half_width


@inlined
def gap_slope(axis: Axis, box: Box) -> Box:
    """How ``gap_along`` changes with each of the six numbers of a box."""
    kind, p, q, _ = axis
    x, y, cos, sin, half_length, half_width = box
    if kind == FIXED_NORMAL:
        ahead = p * cos + q * sin
        left = q * cos - p * sin
        # where a side is parallel to the obstacle both turns bring it nearer; this is the left one's slope
        along = half_length if ahead > 0.0 or (ahead == 0.0 and left > 0.0) else -half_length
        across = half_width if left > 0.0 or (left == 0.0 and ahead < 0.0) else -half_width
        return p, q, -along * p - across * q, across * p - along * q, -abs(ahead), -abs(left)
    elif kind == AHEAD:
        return -cos, -sin, p - x, q - y, -1.0, 0.0
    elif kind == BEHIND:
        return cos, sin, x - p, y - q, -1.0, 0.0
    elif kind == LEFT:
        return sin, -cos, q - y, x - p, 0.0, -1.0
    else:
        return -sin, cos, y - q, p - x, 0.0, -1.0


@inlined
def wall(k: int, bounds: Floats) -> Axis:
    """The inner side of one of the four ``bounds [4]`` as an axis."""
    if k == 0:
        return FIXED_NORMAL, 1.0, 0.0, bounds[0]
    elif k == 1:
        return FIXED_NORMAL, 0.0, 1.0, bounds[1]
    elif k == 2:
        return FIXED_NORMAL, -1.0, 0.0, -bounds[2]
    else:
        return FIXED_NORMAL, 0.0, -1.0, -bounds[3]


@lean
def widest_gap(box: Box, first: int, last: int, edges: Floats, enough: float) -> tuple[float, Axis]:
    """The gap between a box and the piece of the edges ``first`` to before ``last``, and its axis.

    It is the distance in metres if they are apart, and less than 0 by how deep they meet if they do. At
    ``enough`` metres or more the search ends, and the gap is at least that.
    """
    x, y, cos, sin, half_length, half_width = box
    best = -math.inf
    kind = FIXED_NORMAL
    p = 1.0
    q = 0.0
    offset = 0.0
    for i in range(first, last):
        nx = edges[i, NORMAL_X]
        ny = edges[i, NORMAL_Y]
        gap = nx * x + ny * y - edges[i, OFFSET] - extent(nx, ny, box)
        if gap > best:
            best = gap
            p = nx
            q = ny
            offset = edges[i, OFFSET]
            if gap >= enough:
                return best, (kind, p, q, offset)
    nearest = math.inf
    apart = False  # whether the corners of box and piece are nearer to each other than to sides
    toward_x = 0.0
    toward_y = 0.0
    least_ahead = math.inf
    most_ahead = -math.inf
    least_left = math.inf
    most_left = -math.inf
    corners = (first, first, first, first)
    for i in range(first, last):
        dx = edges[i, X] - x
        dy = edges[i, Y] - y
        ahead = dx * cos + dy * sin
        left = dy * cos - dx * sin
        if ahead < least_ahead:
            least_ahead = ahead
            corners = (i, corners[1], corners[2], corners[3])
        if ahead > most_ahead:
            most_ahead = ahead
            corners = (corners[0], i, corners[2], corners[3])
        if left < least_left:
            least_left = left
            corners = (corners[0], corners[1], i, corners[3])
        if left > most_left:
            most_left = left
            corners = (corners[0], corners[1], corners[2], i)
        beyond_u = ahead - min(max(ahead, -half_length), half_length)
        beyond_w = left - min(max(left, -half_width), half_width)
        distance = beyond_u * beyond_u + beyond_w * beyond_w
        if distance < nearest:
            nearest = distance
            apart = beyond_u != 0.0 and beyond_w != 0.0
            toward_x = beyond_u * cos - beyond_w * sin
            toward_y = beyond_u * sin + beyond_w * cos
    sides = (
        least_ahead - half_length,
        -most_ahead - half_length,
        least_left - half_width,
        -most_left - half_width,
    )
    for k in range(4):
        if sides[k] > best:
            best = sides[k]
            kind = k
    if kind != FIXED_NORMAL:
        p = edges[corners[kind], X]
        q = edges[corners[kind], Y]
        offset = 0.0
    if apart and best > 0.0:
        metres = math.sqrt(nearest)
        nx = -toward_x / metres
        ny = -toward_y / metres
        top = -math.inf
        for i in range(first, last):
            top = max(top, nx * edges[i, X] + ny * edges[i, Y])
        gap = nx * x + ny * y - extent(nx, ny, box) - top
        if gap > best:
            best = gap
            kind = FIXED_NORMAL
            p = nx
            q = ny
            offset = top
    return best, (kind, p, q, offset)


@inlined
def nearness(gap: float, barrier: Barrier) -> tuple[float, float, float]:
    """What a gap (metres, or radians) costs, with its first and second derivative; see ``Barrier``."""
    strength = barrier.strength
    range_m = barrier.range_m
    if gap >= range_m:
        return 0.0, 0.0, 0.0
    at = max(gap, barrier.contact)
    value = strength * (at / range_m - 1.0 - math.log(at / range_m))
    slope = strength * (1.0 / range_m - 1.0 / at)
    curvature = strength / (at * at)
    below = gap - at
    return (
        value + slope * below + 0.5 * curvature * below * below,
        slope + curvature * below,
        curvature,
    )


@jit
def circles_around(scene: Scene) -> Floats:
    """A circle around each piece: ``[P, 3]`` x, y and radius in metres."""
    starts = scene.piece_starts
    circles = np.empty((starts.shape[0] - 1, 3))
    for p in range(circles.shape[0]):
        x = 0.0
        y = 0.0
        count = starts[p + 1] - starts[p]
        for i in range(starts[p], starts[p + 1]):
            x += scene.edges[i, X] / count
            y += scene.edges[i, Y] / count
        radius = 0.0
        for i in range(starts[p], starts[p + 1]):
            radius = max(radius, length(scene.edges[i, X] - x, scene.edges[i, Y] - y))
        circles[p, 0] = x
        circles[p, 1] = y
        circles[p, 2] = radius
    return circles
