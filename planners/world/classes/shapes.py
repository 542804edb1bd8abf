"""Kernels that draw obstacles of several shapes, as groups of convex pieces, on a canvas."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planners.world.arrays import Floats, Integers
from planners.world.jit import jit
from planners.world.obstacle_sets import first_obstacles, new_obstacles, take_obstacle
from planners.world.problem import BOUNDS, CANONICAL_GOAL, GOAL_RADIUS, Obstacles

# Kept free in every problem: the footprint at the start with room to pull out, and the goal disc with room
# for the body ahead of the rear axle.
START_ROOM = (0.57, 0.57, 3.0)  # x, y, radius in metres: around the footprint's centre
GOAL_ROOM = (CANONICAL_GOAL[0], CANONICAL_GOAL[1], GOAL_RADIUS + 2.0)  # x, y, radius in metres
TRAILER_ROOM_M = 1.5  # radius around a trailer behind the start: its half-diagonal and half a metre

TRIANGLE, BOX, POLYGON, CROSS, ELL, ZED = range(6)
SHAPES = 6
ARM = 0.2  # half the width of an arm of a cross, L or Z, as a share of its radius

_MAX_VERTICES = 4096
_MAX_PIECES = 1024


class Canvas(NamedTuple):
    """Obstacles that are being drawn."""

    vertices: Floats  # [4096, 2] metres
    piece_starts: Integers  # [1025]
    obstacle_starts: Integers  # [1025]
    counts: Integers  # [2] pieces and obstacles so far


@jit
def new_canvas() -> Canvas:
    """An empty canvas."""
    return Canvas(
        np.empty((_MAX_VERTICES, 2)),
        np.zeros(_MAX_PIECES + 1, np.int32),
        np.zeros(_MAX_PIECES + 1, np.int32),
        np.zeros(2, np.int32),
    )


@jit
def finished(canvas: Canvas) -> Obstacles:
    """Copy the obstacles from a canvas."""
    drawn = Obstacles(canvas.vertices, canvas.piece_starts, canvas.obstacle_starts)
    return first_obstacles(drawn, canvas.counts[1])


@jit
def _add_vertex(canvas: Canvas, x: float, y: float) -> None:
    """Add a vertex to the open piece, rounded to float32 so that files keep it exactly."""
    end = canvas.piece_starts[canvas.counts[0] + 1]
    canvas.vertices[end, 0] = np.float64(np.float32(x))
    canvas.vertices[end, 1] = np.float64(np.float32(y))
    canvas.piece_starts[canvas.counts[0] + 1] = end + 1


@jit
def _open_piece(canvas: Canvas) -> None:
    canvas.piece_starts[canvas.counts[0] + 1] = canvas.piece_starts[canvas.counts[0]]


@jit
def _close_piece(canvas: Canvas) -> None:
    canvas.counts[0] += 1


@jit
def add_regular(canvas: Canvas, x: float, y: float, angle: float, radius: float, sides: int) -> None:
    """Add a regular polygon around (x, y) with its first corner in direction ``angle``."""
    _open_piece(canvas)
    for i in range(sides):
        direction = angle + 2.0 * math.pi * i / sides
        _add_vertex(canvas, x + radius * math.cos(direction), y + radius * math.sin(direction))
    _close_piece(canvas)


@jit
def add_box(
    canvas: Canvas,
    x: float,
    y: float,
    angle: float,
    u: float,
    w: float,
    half_length: float,
    half_width: float,
) -> None:
    """Add a box along the axes of the frame (x, y, angle), with its centre at (u, w) of that frame."""
    cos = math.cos(angle)
    sin = math.sin(angle)
    _open_piece(canvas)
    for i in range(4):
        corner_u = u + (half_length if i in (1, 2) else -half_length)
        corner_w = w + (half_width if i >= 2 else -half_width)
        _add_vertex(canvas, x + corner_u * cos - corner_w * sin, y + corner_u * sin + corner_w * cos)
    _close_piece(canvas)


@jit
def add_arc(
    canvas: Canvas,
    x: float,
    y: float,
    radius: float,
    begin: float,
    sweep: float,
    thickness: float,
    parts: int,
) -> None:
    """Add an arc around (x, y) from angle ``begin`` over ``sweep`` radians, as ``parts`` thin quads."""
    inner = radius - 0.5 * thickness
    outer = radius + 0.5 * thickness
    for part in range(parts):
        a = begin + sweep * part / parts
        b = begin + sweep * (part + 1) / parts
        _open_piece(canvas)
        _add_vertex(canvas, x + inner * math.cos(a), y + inner * math.sin(a))
        _add_vertex(canvas, x + outer * math.cos(a), y + outer * math.sin(a))
        _add_vertex(canvas, x + outer * math.cos(b), y + outer * math.sin(b))
        _add_vertex(canvas, x + inner * math.cos(b), y + inner * math.sin(b))
        _close_piece(canvas)


@jit
def add_trap(
    canvas: Canvas, x: float, y: float, angle: float, width: float, depth: float, thickness: float
) -> None:
    """Add a bug trap: a wall ``width`` long at (x, y), two arms ``depth`` long, open against ``angle``."""
    half = 0.5 * thickness
    add_box(canvas, x, y, angle, 0.0, 0.0, half, 0.5 * width)
    for side in (-1.0, 1.0):
        add_box(canvas, x, y, angle, -0.5 * depth, side * (0.5 * width - half), 0.5 * depth, half)


@jit
def add_shape(
    canvas: Canvas, shape: int, x: float, y: float, angle: float, radius: float, sides: int
) -> None:
    """Add one of the small shapes within ``radius`` of (x, y); only polygons use ``sides``."""
    arm = ARM * radius
    if shape == TRIANGLE:
        add_regular(canvas, x, y, angle, radius, 3)
    elif shape == BOX:
        add_regular(canvas, x, y, angle, radius, 4)
    elif shape == POLYGON:
        add_regular(canvas, x, y, angle, radius, sides)
    elif shape == CROSS:
        add_box(canvas, x, y, angle, 0.0, 0.0, radius, arm)
        add_box(canvas, x, y, angle, 0.0, 0.0, arm, radius)
    elif shape == ELL:
        side = 0.7 * radius  # both ends and the corner lie within the radius
        add_box(canvas, x, y, angle, 0.0, arm - side, side, arm)
        add_box(canvas, x, y, angle, arm - side, 0.0, arm, side)
    else:
        half = 0.5 * radius
        add_box(canvas, x, y, angle, 0.0, 0.0, arm, half)
        add_box(canvas, x, y, angle, half - arm, half - arm, half, arm)
        add_box(canvas, x, y, angle, arm - half, arm - half, half, arm)


@jit
def distance_to_piece(vertices: Floats, first: int, last: int, x: float, y: float) -> float:
    """Distance in metres from a point to a convex counter-clockwise piece; 0 inside."""
    nearest = math.inf
    inside = True
    for i in range(first, last):
        j = i + 1 if i + 1 < last else first
        ex = vertices[j, 0] - vertices[i, 0]
        ey = vertices[j, 1] - vertices[i, 1]
        dx = x - vertices[i, 0]
        dy = y - vertices[i, 1]
        inside = inside and ex * dy - ey * dx >= 0.0
        along = min(max((ex * dx + ey * dy) / (ex * ex + ey * ey), 0.0), 1.0)
        nearest = min(nearest, math.hypot(dx - along * ex, dy - along * ey))
    return 0.0 if inside else nearest


@jit
def without_those_near(obstacles: Obstacles, rooms: Floats) -> Obstacles:
    """Copy the obstacles that reach into none of the discs ``rooms [n, 3]`` (x, y, radius in metres)."""
    result = new_obstacles(obstacles, obstacles)
    kept = 0
    for o in range(obstacles.obstacle_starts.shape[0] - 1):
        take_obstacle(obstacles, o, result, kept)
        near = False
        for p in range(obstacles.obstacle_starts[o], obstacles.obstacle_starts[o + 1]):
            first = obstacles.piece_starts[p]
            last = obstacles.piece_starts[p + 1]
            for r in range(rooms.shape[0]):
                distance = distance_to_piece(obstacles.vertices, first, last, rooms[r, 0], rooms[r, 1])
                near = near or distance <= rooms[r, 2]
        kept += not near
    return first_obstacles(result, kept)


@jit
def end_obstacle(canvas: Canvas) -> bool:
    """Make an obstacle of the pieces added since the last one, or take them back. Returns whether it stays.

    It may not reach into the room of start or goal, and one of its vertices must be inside the bounds.
    """
    vertices = canvas.vertices
    begin = canvas.obstacle_starts[canvas.counts[1]]
    may_stand = False
    for p in range(begin, canvas.counts[0]):
        first = canvas.piece_starts[p]
        last = canvas.piece_starts[p + 1]
        for x, y, room in (START_ROOM, GOAL_ROOM):
            if distance_to_piece(vertices, first, last, x, y) <= room:
                canvas.counts[0] = begin
                return False
        for i in range(first, last):
            x = vertices[i, 0]
            y = vertices[i, 1]
            may_stand = may_stand or (BOUNDS[0] < x < BOUNDS[2] and BOUNDS[1] < y < BOUNDS[3])
    if may_stand:
        canvas.counts[1] += 1
        canvas.obstacle_starts[canvas.counts[1]] = canvas.counts[0]
    else:
        canvas.counts[0] = begin
    return may_stand
