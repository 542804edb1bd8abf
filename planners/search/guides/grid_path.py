"""The shortest path over the occupancy grid, by breadth-first search on 64 cells at a time.

A cell is free if its whole square is. In the canonical window these are of 1 m, so a path between the centres
of free cells keeps half a metre of clearance, a little more than half the car's width. It ignores how a
vehicle moves.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from planners.world.arrays import Floats, Point
from planners.world.geometry.occupancy import CANONICAL_WINDOW, GRID, Bits, Window
from planners.world.jit import inlined, lean
from planners.world.trigonometry import length
from planners.world.workspace import Workspace

_STEPS: Final = ((1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1))  # column, row
_ONE: Final = np.uint64(1)
_NONE: Final = np.uint64(0)


class Flood(NamedTuple):
    """Buffers of the search: rows of cells as bits, with an empty row below and one above."""

    waves: Bits  # [GRID^2, GRID + 2] wave i: the cells that are i steps from the goal disc
    free: Bits  # [GRID + 2] free cells
    fresh: Bits  # [GRID + 2] free cells that no wave has reached yet
    path: Floats  # [GRID^2, 2] metres


def allocate_flood() -> Flood:
    """Buffers for one search at a time, all cells unset."""
    rows = GRID + 2
    return Flood(
        np.zeros((GRID * GRID, rows), np.uint64),
        np.zeros(rows, np.uint64),
        np.zeros(rows, np.uint64),
        np.empty((GRID * GRID, 2)),
    )


@inlined
def _is_set(rows: Bits, column: int, row: int) -> bool:
    """Whether the bit of a cell is set in ``rows [GRID + 2]``. Outside the grid none is."""
    if column < 0 or column >= GRID:
        return False
    return bool((rows[row + 1] >> np.uint64(column)) & _ONE)


@lean
def _first_wave(goal_x: float, goal_y: float, radius: float, window: Window, free: Bits, wave: Bits) -> None:
    wave.fill(_NONE)
    left, bottom, cell = window
    reach = int(radius / cell) + 1
    column = int((goal_x - left) // cell)
    row = int((goal_y - bottom) // cell)
    for r in range(max(row - reach, 0), min(row + reach, GRID - 1) + 1):
        for c in range(max(column - reach, 0), min(column + reach, GRID - 1) + 1):
            dx = left + (c + 0.5) * cell - goal_x
            dy = bottom + (r + 0.5) * cell - goal_y
            inside = dx * dx + dy * dy <= radius * radius or (
                2.0 * radius < cell and r == row and c == column
            )
            if inside and _is_set(free, c, r):
                wave[r + 1] |= _ONE << np.uint64(c)


@lean
def _next_wave(last: Bits, free: Bits, fresh: Bits, wave: Bits) -> bool:
    """Fill in the fresh cells one step from the last wave. Returns whether there are any."""
    reached = _NONE
    for r in range(1, GRID + 1):
        here = last[r]
        below = last[r - 1]
        above = last[r + 1]
        # a diagonal step needs the cells on both sides free: one in this row, one in the row it comes from
        from_below = below & free[r]
        from_above = above & free[r]
        spread = here << _ONE | here >> _ONE | below | above
        spread |= (from_below << _ONE | from_below >> _ONE) & free[r - 1]
        spread |= (from_above << _ONE | from_above >> _ONE) & free[r + 1]
        wave[r] = spread & fresh[r]
        reached |= wave[r]
    for r in range(1, GRID + 1):
        fresh[r] &= ~wave[r]
    return bool(reached != _NONE)


@lean
def flood_from_goal(
    occupied: Bits,
    start_x: float,
    start_y: float,
    goal_x: float,
    goal_y: float,
    radius: float,
    window: Window,
    flood: Flood,
) -> int:
    """Fill ``flood.path`` with the centres of free cells from the start to the goal disc.

    A cell has eight neighbours; a diagonal step needs the cells on both sides free. If an obstacle touches
    the start's cell, the path begins beside it. Returns the number of cells, 0 if there is no path.
    """
    waves = flood.waves
    free = flood.free
    for r in range(GRID):
        free[r + 1] = ~occupied[r]
    _first_wave(goal_x, goal_y, radius, window, free, waves[0])
    for r in range(GRID + 2):
        flood.fresh[r] = free[r] & ~waves[0, r]
    column = int((start_x - window.left) // window.cell_m)
    row = int((start_y - window.bottom) // window.cell_m)
    inside = 0 <= row < GRID and 0 <= column < GRID
    apart = 0 if inside and _is_set(free, column, row) else 1  # cells from the start's where it may begin
    wave = 0
    while True:
        for r in range(max(row - apart, 0), min(row + apart, GRID - 1) + 1):
            for c in range(column - apart, column + apart + 1):
                if _is_set(waves[wave], c, r):
                    return _trace(waves, free, wave, c, r, window, flood.path)
        if not _next_wave(waves[wave], free, flood.fresh, waves[wave + 1]):
            return 0
        wave += 1


@lean
def _trace(waves: Bits, free: Bits, wave: int, column: int, row: int, window: Window, path: Floats) -> int:
    """Fill in the path from a cell of a wave down to the first wave, straight steps before diagonal ones."""
    filled = 0
    while True:
        path[filled, 0] = window.left + (column + 0.5) * window.cell_m
        path[filled, 1] = window.bottom + (row + 0.5) * window.cell_m
        filled += 1
        if wave == 0:
            return filled
        wave -= 1
        for step in _STEPS:
            c = column + step[0]
            r = row + step[1]
            if _is_set(waves[wave], c, r) and _is_set(free, c, row) and _is_set(free, column, r):
                column = c
                row = r
                break


def grid_path(
    occupied: Bits,
    start: Point,
    goal: Point,
    radius: float,
    workspace: Workspace | None = None,
    window: Window = CANONICAL_WINDOW,
) -> Floats | None:
    """Find the shortest path over a problem's free cells from a point to a disc.

    Args:
        occupied: ``[64]`` the cells that are not free.
        start: x, y in metres.
        goal: x, y of the disc's centre in metres.
        radius: of the disc, in metres.
        workspace: the caller's buffers; by default new ones.
        window: in which the cells lie.

    Returns:
        The centres ``[M, 2]`` of the cells along the path, in metres; None if there is no path.
    """
    flood = (workspace or Workspace()).buffers(allocate_flood)
    count = flood_from_goal(occupied, start[0], start[1], goal[0], goal[1], radius, window, flood)
    return flood.path[:count].copy() if count else None


@lean
def _metres(path: Floats) -> float:
    metres = 0.0
    for i in range(1, path.shape[0]):
        metres += length(path[i, 0] - path[i - 1, 0], path[i, 1] - path[i - 1, 1])
    return metres


def grid_metres(
    occupied: Bits,
    start: Point,
    goal: Point,
    radius: float,
    workspace: Workspace | None = None,
    window: Window = CANONICAL_WINDOW,
) -> float:
    """Find how long the shortest path over a problem's free cells is, in metres; infinite if there is none.

    The arguments are those of ``grid_path``.
    """
    path = grid_path(occupied, start, goal, radius, workspace, window)
    return math.inf if path is None else float(_metres(path))
