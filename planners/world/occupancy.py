"""The occupancy grid that the encoder sees: which 1 m squares of the canonical window are not free."""

from __future__ import annotations

import math

import numpy as np

from planners.world.jit import jit
from planners.world.problem import BOUNDS, Floats, Integers, Problem

Grid = np.ndarray[tuple[int, ...], np.dtype[np.uint8]]

GRID = 64  # cells a side
CELL = (BOUNDS[2] - BOUNDS[0]) / GRID  # metres a side
_LEFT, _BOTTOM = BOUNDS[0], BOUNDS[1]


@jit
def draw_occupancy(vertices: Floats, piece_starts: Integers, bounds: Floats) -> Grid:
    """Grid ``[64, 64]`` (row = y, column = x) of convex pieces ``[V, 2]``, ``[P + 1]`` and bounds ``[4]``.

    A cell is 1 where its half-open square meets a piece or is not wholly inside the bounds. Exact: what a
    convex piece covers of a row of cells is one interval of x, so each piece is clipped row by row.
    """
    grid = np.zeros((GRID, GRID), np.uint8)
    low = np.empty(GRID)
    high = np.empty(GRID)
    for p in range(piece_starts.shape[0] - 1):
        first = piece_starts[p]
        last = piece_starts[p + 1]
        y_min = math.inf
        y_max = -math.inf
        for i in range(first, last):
            y_min = min(y_min, vertices[i, 1])
            y_max = max(y_max, vertices[i, 1])
        row_0 = max(0, math.floor((y_min - _BOTTOM) / CELL))
        row_1 = min(GRID - 1, math.floor((y_max - _BOTTOM) / CELL))
        for row in range(row_0, row_1 + 1):
            low[row] = math.inf
            high[row] = -math.inf
        for i in range(first, last):
            j = i + 1 if i + 1 < last else first
            upper = i if vertices[i, 1] > vertices[j, 1] else j
            lower = j if upper == i else i
            x_0 = vertices[lower, 0] - _LEFT
            y_0 = vertices[lower, 1] - _BOTTOM
            x_1 = vertices[upper, 0] - _LEFT
            y_1 = vertices[upper, 1] - _BOTTOM
            slope = (x_1 - x_0) / (y_1 - y_0) if y_1 > y_0 else 0.0
            edge_row_0 = max(row_0, math.floor(y_0 / CELL))
            edge_row_1 = min(row_1, math.floor(y_1 / CELL))
            for row in range(edge_row_0, edge_row_1 + 1):
                enter = x_0 if y_0 >= row * CELL else x_0 + slope * (row * CELL - y_0)
                leave = x_1 if y_1 <= (row + 1) * CELL else x_0 + slope * ((row + 1) * CELL - y_0)
                low[row] = min(low[row], enter, leave)
                high[row] = max(high[row], enter, leave)
        for row in range(row_0, row_1 + 1):
            column_0 = max(0, math.floor(low[row] / CELL))
            column_1 = min(GRID - 1, math.floor(high[row] / CELL))
            for column in range(column_0, column_1 + 1):
                grid[row, column] = 1
    for row in range(GRID):
        bottom = _BOTTOM + row * CELL
        row_inside = bottom >= bounds[1] and bottom + CELL <= bounds[3]
        for column in range(GRID):
            left = _LEFT + column * CELL
            if not (row_inside and left >= bounds[0] and left + CELL <= bounds[2]):
                grid[row, column] = 1
    return grid


def occupancy_of(problem: Problem) -> Grid:
    """The grid ``[64, 64]`` of a canonical problem."""
    obstacles = problem.obstacles
    return draw_occupancy(obstacles.vertices, obstacles.piece_starts, np.array(problem.bounds))


def pack(grid: Grid) -> Grid:
    """The bits of a grid ``[64, 64]`` in bytes ``[512]``, as shards keep them."""
    return np.packbits(grid)


def unpack(packed: Grid) -> Grid:
    """The grid ``[64, 64]`` of bytes ``[512]``."""
    return np.unpackbits(packed).reshape(GRID, GRID)
