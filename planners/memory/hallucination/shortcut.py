"""The shortest path of a disc among obstacles, by A* on a lattice.

A lattice point is closed if an obstacle is nearer than ``inflated_radius``. No point of a step is farther
than half a diagonal from an open point, so no path along open points touches an obstacle: every path is real,
but a gap that is hardly wider than the disc may be missed.
"""

from __future__ import annotations

import heapq
import math
from typing import Final, NamedTuple

import numpy as np

from planners.world.arrays import Bounds, Floats, Indices, Point
from planners.world.classes.shapes import distance_to_piece
from planners.world.jit import inlined, jit
from planners.world.problem import BOUNDS, Obstacles

Closed = Indices  # [SIDE * SIDE] bit k of a point: closed by obstacle k

STEP_M: Final = 0.5  # between lattice points; the canonical start and goal are lattice points
SIDE: Final = 1 + int((BOUNDS[2] - BOUNDS[0]) / STEP_M)
MOST: Final = 62  # obstacles, one bit each
OUTSIDE: Final = 62  # the bit of points that are too near to the bounds or outside


def _moves() -> Indices:
    """Steps ``[16, 4]``: columns and rows, and those to one of the points a knight's move passes between.

    Paths with 16 directions are at most 2.7 % longer than straight ones.
    """
    moves = []
    for c in range(-2, 3):
        for r in range(-2, 3):
            if max(abs(c), abs(r)) == 1:
                moves.append((c, r, 0, 0))
            elif abs(c * r) == 2:
                moves.append((c, r, *((c // 2, 0) if abs(c) == 2 else (0, r // 2))))
    return np.array(moves, np.int64)


_MOVES: Final = _moves()


class LatticePath(NamedTuple):
    """A shortest path over the lattice."""

    length_m: float  # infinite if there is no path within the limit
    points: Indices  # lattice points from the goal back to the start


def inflated_radius(width_m: float) -> float:
    """Return how far, in metres, a lattice point must be from obstacles for a disc of this width."""
    return 0.5 * width_m + STEP_M * math.sqrt(0.5)


@inlined
def position(point: int) -> Point:
    """The position of a lattice point in metres."""
    return BOUNDS[0] + STEP_M * (point % SIDE), BOUNDS[1] + STEP_M * (point // SIDE)


def lattice(bounds: Bounds, width_m: float) -> Closed:
    """Make a lattice whose points are closed if a disc of this width would leave the bounds there."""
    x, y = BOUNDS[0] + STEP_M * np.arange(SIDE), BOUNDS[1] + STEP_M * np.arange(SIDE)
    half = 0.5 * width_m
    inside_x = (x >= bounds[0] + half) & (x <= bounds[2] - half)
    inside_y = (y >= bounds[1] + half) & (y <= bounds[3] - half)
    inside = inside_y[:, np.newaxis] & inside_x
    return np.where(inside, 0, 1 << OUTSIDE).astype(np.int64).ravel()


@jit
def close_around(obstacles: Obstacles, o: int, radius: float, bit: int, closed: Closed) -> None:
    """Set bit number ``bit`` of the lattice points nearer than ``radius`` (metres) to obstacle ``o``."""
    for p in range(obstacles.obstacle_starts[o], obstacles.obstacle_starts[o + 1]):
        first = obstacles.piece_starts[p]
        last = obstacles.piece_starts[p + 1]
        x = obstacles.vertices[first:last, 0]
        y = obstacles.vertices[first:last, 1]
        column_0 = max(0, math.ceil((x.min() - radius - BOUNDS[0]) / STEP_M))
        column_1 = min(SIDE - 1, math.floor((x.max() + radius - BOUNDS[0]) / STEP_M))
        row_0 = max(0, math.ceil((y.min() - radius - BOUNDS[1]) / STEP_M))
        row_1 = min(SIDE - 1, math.floor((y.max() + radius - BOUNDS[1]) / STEP_M))
        for row in range(row_0, row_1 + 1):
            for column in range(column_0, column_1 + 1):
                point = row * SIDE + column
                px, py = position(point)
                if distance_to_piece(obstacles.vertices, first, last, px, py) < radius:
                    closed[point] |= np.int64(1) << np.int64(bit)


def distances_left(goal: Point, goal_radius: float) -> Floats:
    """Return the distance ``[SIDE * SIDE]`` in metres from each lattice point to the goal disc."""
    x, y = BOUNDS[0] + STEP_M * np.arange(SIDE), BOUNDS[1] + STEP_M * np.arange(SIDE)
    left = np.hypot(goal[0] - x, (goal[1] - y)[:, np.newaxis]) - goal_radius
    distances: Floats = np.maximum(left, 0.0).ravel()
    return distances


@jit
def shortest_path(closed: Closed, ignored: int, start: Point, left: Floats, limit_m: float) -> LatticePath:
    """Find the shortest path from the point nearest to ``start`` into the goal disc, if below ``limit_m``.

    Obstacles whose bits are set in ``ignored`` do not count. ``left`` comes from ``distances_left``.
    """
    begin = round((start[1] - BOUNDS[1]) / STEP_M) * SIDE + round((start[0] - BOUNDS[0]) / STEP_M)
    came_from = np.full(SIDE * SIDE, -1, np.int64)
    lengths = np.full(SIDE * SIDE, np.inf)
    unsettled = (closed & ~ignored) == 0
    unsettled[begin] = True
    passable = unsettled.copy()
    steps = STEP_M * np.sqrt((_MOVES[:, :2] * _MOVES[:, :2]).sum(axis=1))
    lengths[begin] = 0.0
    queue = [(left[begin], begin)]
    while queue:
        _, point = heapq.heappop(queue)
        if left[point] == 0.0:
            points = [point]
            while points[-1] != begin:
                points.append(came_from[points[-1]])
            return LatticePath(lengths[point], np.array(points))
        if not unsettled[point]:
            continue
        unsettled[point] = False
        column = point % SIDE
        row = point // SIDE
        for k in range(_MOVES.shape[0]):
            to = point + _MOVES[k, 1] * SIDE + _MOVES[k, 0]
            if not (0 <= column + _MOVES[k, 0] < SIDE and 0 <= row + _MOVES[k, 1] < SIDE and unsettled[to]):
                continue
            length = lengths[point] + steps[k]
            if length >= lengths[to] or length + left[to] >= limit_m:
                continue
            beside = point + _MOVES[k, 3] * SIDE + _MOVES[k, 2]
            if passable[beside] and passable[point + to - beside]:
                lengths[to] = length
                came_from[to] = point
                heapq.heappush(queue, (length + left[to], to))
    return LatticePath(math.inf, np.empty(0, np.int64))
