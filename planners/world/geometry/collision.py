"""Exact collision checks of a vehicle's footprint with convex obstacles.

Each convex piece is listed in every cell of a grid in which a box that touches the piece may have its centre.
So a check reads the list of one cell, however many obstacles there are, and looks for a separating axis.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planners.world.arrays import Bounds, Box, Flags, Floats, Integers
from planners.world.jit import inlined, jit, lean
from planners.world.problem import Problem
from planners.world.trigonometry import length
from planners.world.vehicles.dynamics import State, is_folded, load, slides, swept_bodies
from planners.world.vehicles.reach import REACH_M
from planners.world.vehicles.vehicle import Vehicle

CELL_M = 2.0  # measured: smaller cells cost more time to fill than they save in checks

NORMAL_X, NORMAL_Y, OFFSET, X, Y = range(5)  # columns of Scene.edges
FIRST, LAST, FACING = range(3)  # columns of Scene.cell_pieces


class Scene(NamedTuple):
    """A problem made ready for collision checks."""

    bounds: Floats  # [4] x_min, y_min, x_max, y_max in metres
    edges: Floats  # [V, 5] of each edge: outward unit normal, normal . vertex (m), first vertex (m)
    piece_starts: Integers  # [P + 1] piece p owns edges[piece_starts[p] : piece_starts[p + 1]]
    cell_starts: Integers  # [rows * columns + 1]
    cell_pieces: Integers  # [K, 3] pieces within reach of a cell, cell by cell: edges FIRST to before LAST,
    # and FACING, the edge whose line is farthest from the cell's middle: it separates most often
    columns: int


@inlined
def edge_separates(box: Box, edge: int, edges: Floats) -> bool:
    """Whether a box lies wholly outside the line of an edge."""
    x, y, cos, sin, half_length, half_width = box
    nx = edges[edge, NORMAL_X]
    ny = edges[edge, NORMAL_Y]
    extent = half_length * abs(nx * cos + ny * sin) + half_width * abs(ny * cos - nx * sin)
    return bool(nx * x + ny * y - edges[edge, OFFSET] > extent)


@inlined
def box_meets_piece(box: Box, first: int, last: int, edges: Floats) -> bool:
    """Whether a box meets the convex piece of the edges ``first`` to before ``last``."""
    for i in range(first, last):
        if edge_separates(box, i, edges):
            return False
    x, y, cos, sin, half_length, half_width = box
    low_u = math.inf
    high_u = -math.inf
    low_w = math.inf
    high_w = -math.inf
    for i in range(first, last):
        dx = edges[i, X] - x
        dy = edges[i, Y] - y
        u = dx * cos + dy * sin
        w = dy * cos - dx * sin
        low_u = min(low_u, u)
        high_u = max(high_u, u)
        low_w = min(low_w, w)
        high_w = max(high_w, w)
    return not (low_u > half_length or high_u < -half_length or low_w > half_width or high_w < -half_width)


@inlined
def make_edges(vertices: Floats, first: int, last: int, edges: Floats, target: int) -> None:
    """Fill in ``edges`` (as in ``Scene``) from ``target`` on for the piece ``vertices[first : last]``."""
    for i in range(first, last):
        j = i + 1 if i + 1 < last else first
        ex = vertices[j, 0] - vertices[i, 0]
        ey = vertices[j, 1] - vertices[i, 1]
        metres = length(ex, ey)
        edge = target + i - first
        edges[edge, NORMAL_X] = ey / metres
        edges[edge, NORMAL_Y] = -ex / metres
        edges[edge, OFFSET] = edges[edge, NORMAL_X] * vertices[i, 0] + edges[edge, NORMAL_Y] * vertices[i, 1]
        edges[edge, X] = vertices[i, 0]
        edges[edge, Y] = vertices[i, 1]


@inlined
def piece_extent(vertices: Floats, first: int, last: int) -> tuple[float, float, float, float]:
    """Least x and y, and greatest x and y, of a piece ``vertices[first : last]``."""
    x_min = math.inf
    y_min = math.inf
    x_max = -math.inf
    y_max = -math.inf
    for i in range(first, last):
        x_min = min(x_min, vertices[i, 0])
        x_max = max(x_max, vertices[i, 0])
        y_min = min(y_min, vertices[i, 1])
        y_max = max(y_max, vertices[i, 1])
    return x_min, y_min, x_max, y_max


@jit
def build_scene(vertices: Floats, piece_starts: Integers, bounds: Floats) -> Scene:
    """Build the scene of pieces ``[V, 2]``, ``[P + 1]`` within bounds ``[4]``, all in metres."""
    pieces = piece_starts.shape[0] - 1
    edges = np.empty((vertices.shape[0], 5))
    for p in range(pieces):
        make_edges(vertices, piece_starts[p], piece_starts[p + 1], edges, piece_starts[p])
    columns = math.ceil((bounds[2] - bounds[0]) / CELL_M) + 1
    rows = math.ceil((bounds[3] - bounds[1]) / CELL_M) + 1
    half = 0.5 * CELL_M + REACH_M
    listed_cells = np.empty(64 * pieces + 64, np.int32)
    listed_pieces = np.empty((64 * pieces + 64, 3), np.int32)
    cell_starts = np.zeros(rows * columns + 1, np.int32)
    listed = 0
    for p in range(pieces):
        first = piece_starts[p]
        last = piece_starts[p + 1]
        x_min, y_min, x_max, y_max = piece_extent(vertices, first, last)
        column_0 = max(0, math.floor((x_min - REACH_M - bounds[0]) / CELL_M))
        column_1 = min(columns - 1, math.floor((x_max + REACH_M - bounds[0]) / CELL_M))
        row_0 = max(0, math.floor((y_min - REACH_M - bounds[1]) / CELL_M))
        row_1 = min(rows - 1, math.floor((y_max + REACH_M - bounds[1]) / CELL_M))
        for row in range(row_0, row_1 + 1):
            centre_y = bounds[1] + (row + 0.5) * CELL_M
            for column in range(column_0, column_1 + 1):
                centre_x = bounds[0] + (column + 0.5) * CELL_M
                near = True
                facing = first
                widest = -math.inf
                for i in range(first, last):
                    nx = edges[i, NORMAL_X]
                    ny = edges[i, NORMAL_Y]
                    gap = nx * centre_x + ny * centre_y - edges[i, OFFSET]
                    if gap > half * (abs(nx) + abs(ny)):
                        near = False
                        break
                    if gap > widest:
                        widest = gap
                        facing = i
                if near:
                    if listed == listed_cells.shape[0]:
                        listed_cells = np.concatenate((listed_cells, np.empty_like(listed_cells)))
                        listed_pieces = np.concatenate((listed_pieces, np.empty_like(listed_pieces)))
                    cell = row * columns + column
                    listed_cells[listed] = cell
                    listed_pieces[listed, FIRST] = first
                    listed_pieces[listed, LAST] = last
                    listed_pieces[listed, FACING] = facing
                    cell_starts[cell + 1] += 1
                    listed += 1
    for cell in range(rows * columns):
        cell_starts[cell + 1] += cell_starts[cell]
    cell_pieces = np.empty((listed, 3), np.int32)
    for k in range(listed - 1, -1, -1):  # backwards, with starts moved up, so that each cell keeps its order
        cell = listed_cells[k]
        cell_starts[cell + 1] -= 1
        for column in range(3):
            cell_pieces[cell_starts[cell + 1], column] = listed_pieces[k, column]
    for cell in range(rows * columns):
        cell_starts[cell] = cell_starts[cell + 1]
    cell_starts[rows * columns] = listed
    return Scene(bounds, edges, piece_starts, cell_starts, cell_pieces, columns)


def scene_of(problem: Problem) -> Scene:
    """Make a problem ready for collision checks."""
    obstacles = problem.obstacles
    return build_scene(obstacles.vertices, obstacles.piece_starts, np.array(problem.bounds))


@inlined
def box_is_inside(box: Box, bounds: Bounds | Floats) -> bool:
    """Whether a box lies inside the bounds, which are a tuple or an array ``[4]``."""
    x, y, cos, sin, half_length, half_width = box
    extent_x = half_length * abs(cos) + half_width * abs(sin)
    extent_y = half_length * abs(sin) + half_width * abs(cos)
    return bool(
        x - extent_x >= bounds[0]
        and x + extent_x <= bounds[2]
        and y - extent_y >= bounds[1]
        and y + extent_y <= bounds[3]
    )


@inlined
def box_is_free(box: Box, scene: Scene) -> bool:
    """Whether a box, whose half-diagonal is at most REACH_M, is inside the bounds and meets no obstacle."""
    bounds = scene.bounds
    if not box_is_inside(box, bounds):
        return False
    column = int((box[0] - bounds[0]) * (1.0 / CELL_M))
    row = int((box[1] - bounds[1]) * (1.0 / CELL_M))
    cell = row * scene.columns + column
    pieces = scene.cell_pieces
    edges = scene.edges
    for k in range(scene.cell_starts[cell], scene.cell_starts[cell + 1]):
        if edge_separates(box, pieces[k, FACING], edges):
            continue
        if box_meets_piece(box, pieces[k, FIRST], pieces[k, LAST], edges):
            return False
    return True


@lean
def note_free(boxes: Floats, scene: Scene, free: Flags) -> None:
    """Note in ``free [n]`` whether each of ``boxes [n, 6]`` is free, as ``box_is_free`` says."""
    for i in range(boxes.shape[0]):
        box = boxes[i, 0], boxes[i, 1], boxes[i, 2], boxes[i, 3], boxes[i, 4], boxes[i, 5]
        free[i] = box_is_free(box, scene)


@inlined
def point_is_free(x: float, y: float, scene: Scene) -> bool:
    """Whether a point (metres) is inside the bounds and in no obstacle."""
    return box_is_free((x, y, 1.0, 0.0, 0.0, 0.0), scene)


@inlined
def state_is_free(state: State, vehicle: Vehicle, scene: Scene) -> bool:
    """Whether the vehicle neither folds, in the state or next to it, nor slides, and its bodies are free."""
    return (
        not is_folded(state, vehicle)
        and not slides(state, vehicle)
        and bodies_are_free(state, vehicle, scene)
    )


@inlined
def bodies_are_free(state: State, vehicle: Vehicle, scene: Scene) -> bool:
    """Whether the vehicle's bodies, inflated to cover the steps into and out of a state, are free."""
    for box in swept_bodies(state, vehicle):  # noqa: SIM110 Numba has no generators for all()
        if not box_is_free(box, scene):
            return False
    return True


@lean
def count_free_prefix(states: Floats, vehicle: Vehicle, scene: Scene) -> int:
    """Count the free states before the first blocked one of ``states [T, S]``: T if all are free."""
    for i in range(states.shape[0]):
        if not state_is_free(load(states, i, vehicle), vehicle, scene):
            return i
    return states.shape[0]


def blocked_states(states: Floats, vehicle: Vehicle, scene: Scene) -> Flags:
    """Return which of ``states [T, S]`` are not free, ``[T]``."""
    blocked = np.empty(len(states), np.bool_)
    _note_blocked(np.ascontiguousarray(states), vehicle, scene, blocked)
    return blocked


@lean
def _note_blocked(states: Floats, vehicle: Vehicle, scene: Scene, blocked: Flags) -> None:
    for i in range(states.shape[0]):
        blocked[i] = not state_is_free(load(states, i, vehicle), vehicle, scene)
