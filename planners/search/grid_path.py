"""A fresh guide: the shortest way over the occupancy grid, found breadth first in some tens of microseconds.

A cell counts as free when its whole 1 m square is, so a way between centres of free cells keeps half a metre
clear: a little more than half the car's width. It knows nothing of how a vehicle moves.
"""

from __future__ import annotations

import functools
from typing import Final, NamedTuple

import numpy as np

from planners.search.neighbours import Indices
from planners.world.jit import lean
from planners.world.occupancy import CELL, GRID, Grid
from planners.world.problem import BOUNDS, Floats

_LEFT: Final = BOUNDS[0]
_BOTTOM: Final = BOUNDS[1]
_STEPS: Final = ((1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1))  # column, row


class Flood(NamedTuple):
    """Buffers of the search, one set a process."""

    following: (
        Indices  # [GRID^2] the next cell towards the goal; the cell itself in the goal disc; -1: not reached
    )
    queue: Indices  # [GRID^2] cells in the order in which they were reached
    way: Floats  # [GRID^2, 2] metres


@functools.lru_cache(maxsize=1)
def allocate_flood() -> Flood:
    """Buffers for one search at a time."""
    cells = GRID * GRID
    return Flood(np.empty(cells, np.int64), np.empty(cells, np.int64), np.empty((cells, 2)))


@lean
def flood_from_goal(
    grid: Grid, start_x: float, start_y: float, goal_x: float, goal_y: float, radius: float, flood: Flood
) -> int:
    """Fill ``flood.way`` with centres of free cells from start to goal disc; how many, 0: none.

    Neighbours are the eight around a cell; a diagonal step needs both cells beside it free. Where an obstacle
    touches the start's cell, the way begins beside it.
    """
    following = flood.following
    queue = flood.queue
    following.fill(-1)
    queued = 0
    reach = int(radius / CELL) + 1
    column = int((goal_x - _LEFT) // CELL)
    row = int((goal_y - _BOTTOM) // CELL)
    for r in range(max(row - reach, 0), min(row + reach, GRID - 1) + 1):
        for c in range(max(column - reach, 0), min(column + reach, GRID - 1) + 1):
            dx = _LEFT + (c + 0.5) * CELL - goal_x
            dy = _BOTTOM + (r + 0.5) * CELL - goal_y
            if dx * dx + dy * dy <= radius * radius and grid[r, c] == 0:
                following[r * GRID + c] = r * GRID + c
                queue[queued] = r * GRID + c
                queued += 1
    column = int((start_x - _LEFT) // CELL)
    row = int((start_y - _BOTTOM) // CELL)
    inside = 0 <= row < GRID and 0 <= column < GRID
    apart = 0 if inside and grid[row, column] == 0 else 1  # cells from the start's at which a way may begin
    taken = 0
    while taken < queued:
        cell = queue[taken]
        taken += 1
        r = cell // GRID
        c = cell % GRID
        if abs(r - row) <= apart and abs(c - column) <= apart:
            filled = 0
            while True:
                flood.way[filled, 0] = _LEFT + (cell % GRID + 0.5) * CELL
                flood.way[filled, 1] = _BOTTOM + (cell // GRID + 0.5) * CELL
                filled += 1
                if following[cell] == cell:
                    return filled
                cell = following[cell]
        for step in _STEPS:
            to_c = c + step[0]
            to_r = r + step[1]
            if to_c < 0 or to_c >= GRID or to_r < 0 or to_r >= GRID:
                continue
            other = to_r * GRID + to_c
            if following[other] < 0 and grid[to_r, to_c] == 0 and grid[r, to_c] == 0 and grid[to_r, c] == 0:
                following[other] = cell
                queue[queued] = other
                queued += 1
    return 0


def grid_path(
    grid: Grid, start: tuple[float, float], goal: tuple[float, float], radius: float
) -> Floats | None:
    """The shortest way ``[M, 2]`` over a problem's occupancy grid from a place to a disc, all in metres.

    None when the two are not connected there. The points are cell centres; the array is the caller's own.
    """
    flood = allocate_flood()
    count = flood_from_goal(grid, start[0], start[1], goal[0], goal[1], radius, flood)
    return flood.way[:count].copy() if count else None
