"""Proves that no drive leads to a goal: not even a disc inside the vehicle's body gets there.

Wherever the disc's centre is in a cell whose four corners lie nearer to one convex piece than the disc's
radius, the disc meets the piece. Such cells are closed. If they, and the bounds, keep the start apart from
every place that the disc can have at the goal, there is no drive. Nothing is known of what lies beyond the
window, so it counts as open.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from planners.world.arrays import Floats, Integers
from planners.world.geometry.collision import NORMAL_X, NORMAL_Y, OFFSET, Scene, X, Y
from planners.world.geometry.occupancy import GRID, window_of
from planners.world.jit import inlined, lean
from planners.world.problem import Problem
from planners.world.trigonometry import gap_to_segment, length
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace

FINER: Final = 4  # cells in one of the window, along each side
SIDE: Final = FINER * GRID
SLACK_M: Final = 1e-6  # by which the disc is smaller than it could be, for roundings
OPEN, CLOSED, FROM_START, FROM_GOAL = range(4)


class Floor(NamedTuple):
    """The cells, and buffers."""

    cells: Integers  # [SIDE, SIDE] OPEN, CLOSED or reached; row = y, column = x
    corners: Integers  # [2, SIDE + 1] whether the corners below and above a row are near a piece
    queue: Integers  # [SIDE^2] cells whose neighbours have yet to be looked at


def allocate_floor() -> Floor:
    """Buffers for one problem at a time."""
    return Floor(
        np.empty((SIDE, SIDE), np.int32), np.empty((2, SIDE + 1), np.int32), np.empty(SIDE * SIDE, np.int32)
    )


@inlined
def _is_near(x: float, y: float, first: int, last: int, radius: float, edges: Floats) -> bool:
    """Whether (x, y) is certainly within ``radius`` metres of the piece of some edges."""
    outside = -math.inf
    facing = first
    for i in range(first, last):
        gap = edges[i, NORMAL_X] * x + edges[i, NORMAL_Y] * y - edges[i, OFFSET]
        if gap > radius:
            return False
        if gap > outside:
            outside = gap
            facing = i
    if outside <= 0.0:
        return True
    other = facing + 1 if facing + 1 < last else first
    gap_x, gap_y = gap_to_segment(x, y, edges[facing, X], edges[facing, Y], edges[other, X], edges[other, Y])
    return length(gap_x, gap_y) <= radius


@lean
def close_cells(scene: Scene, left: float, bottom: float, cell_m: float, radius: float, floor: Floor) -> None:
    """Close the cells in which a disc's centre cannot be."""
    bounds = scene.bounds
    for row in range(SIDE):
        low = bottom + row * cell_m
        out = low + cell_m < bounds[1] + radius or low > bounds[3] - radius
        for column in range(SIDE):
            here = left + column * cell_m
            beside = here + cell_m < bounds[0] + radius or here > bounds[2] - radius
            floor.cells[row, column] = CLOSED if out or beside else OPEN
    corners = floor.corners
    for p in range(scene.piece_starts.shape[0] - 1):
        first = scene.piece_starts[p]
        last = scene.piece_starts[p + 1]
        x_min = math.inf
        y_min = math.inf
        x_max = -math.inf
        y_max = -math.inf
        for i in range(first, last):
            x_min = min(x_min, scene.edges[i, X])
            x_max = max(x_max, scene.edges[i, X])
            y_min = min(y_min, scene.edges[i, Y])
            y_max = max(y_max, scene.edges[i, Y])
        column_0 = max(0, math.floor((x_min - radius - left) / cell_m))
        column_1 = min(SIDE - 1, math.floor((x_max + radius - left) / cell_m))
        row_0 = max(0, math.floor((y_min - radius - bottom) / cell_m))
        row_1 = min(SIDE - 1, math.floor((y_max + radius - bottom) / cell_m))
        for row in range(row_0, row_1 + 2):
            above = row & 1
            y = bottom + row * cell_m
            for column in range(column_0, column_1 + 2):
                near = _is_near(left + column * cell_m, y, first, last, radius, scene.edges)
                corners[above, column] = 1 if near else 0
            if row == row_0:
                continue
            for column in range(column_0, column_1 + 1):
                near_below = corners[1 - above, column] & corners[1 - above, column + 1]
                if near_below & corners[above, column] & corners[above, column + 1]:
                    floor.cells[row - 1, column] = CLOSED


@lean
def _spread(floor: Floor, queued: int, mark: int, sought: int) -> tuple[bool, bool]:
    """Reach all cells from those in the queue, eight neighbours each.

    Returns whether one of them has the mark ``sought``, and whether one lies at the window's border.
    """
    found = False
    border = False
    done = 0
    while done < queued:
        row = floor.queue[done] // SIDE
        column = floor.queue[done] % SIDE
        done += 1
        border = border or row == 0 or column == 0 or row == SIDE - 1 or column == SIDE - 1
        for r in range(max(row - 1, 0), min(row + 1, SIDE - 1) + 1):
            for c in range(max(column - 1, 0), min(column + 1, SIDE - 1) + 1):
                here = floor.cells[r, c]
                if here == sought:
                    found = True
                elif here == OPEN:
                    floor.cells[r, c] = mark
                    floor.queue[queued] = r * SIDE + c
                    queued += 1
    return found, border


@lean
def _enter(
    floor: Floor, x: float, y: float, reach: float, left: float, bottom: float, cell_m: float, mark: int
) -> int:
    """Mark and queue the cells that a disc around (x, y) meets, closed ones too; how many these are."""
    queued = 0
    row_0 = max(math.floor((y - reach - bottom) / cell_m), 0)
    row_1 = min(math.floor((y + reach - bottom) / cell_m), SIDE - 1)
    column_0 = max(math.floor((x - reach - left) / cell_m), 0)
    column_1 = min(math.floor((x + reach - left) / cell_m), SIDE - 1)
    for row in range(row_0, row_1 + 1):
        for column in range(column_0, column_1 + 1):
            if mark == FROM_GOAL and floor.cells[row, column] == CLOSED:
                continue
            floor.cells[row, column] = mark
            floor.queue[queued] = row * SIDE + column
            queued += 1
    return queued


def is_unreachable(problem: Problem, scene: Scene, vehicle: Vehicle, workspace: Workspace) -> bool:
    """Whether it is certain that no drive leads from a problem's start to its goal.

    Args:
        problem: with its start and goal.
        scene: of the problem.
        vehicle: what is to be driven.
        workspace: the caller's buffers.
    """
    if vehicle.about.outline:  # no disc is known to lie inside a body that does not fill its box
        return False
    radius = 0.5 * min(vehicle.width, vehicle.front + vehicle.rear) - SLACK_M
    ahead = min(
        max(radius - vehicle.rear, 0.0), vehicle.front - radius
    )  # from the reference point to the disc
    window = window_of(problem)
    cell_m = window.cell_m / FINER
    frame = (window.left, window.bottom, cell_m)
    floor = workspace.buffers(allocate_floor)
    close_cells(scene, *frame, radius, floor)
    x, y, heading = problem.start
    begin = (x + ahead * math.cos(heading), y + ahead * math.sin(heading))
    reach = problem.goal_radius + abs(ahead) + SLACK_M
    if max(abs(problem.goal[0] - begin[0]), abs(problem.goal[1] - begin[1])) <= reach + SLACK_M + cell_m:
        return False  # cells of the start may be cells of the goal
    _enter(floor, *problem.goal, reach, *frame, FROM_GOAL)
    queued = _enter(floor, *begin, SLACK_M, *frame, FROM_START)
    found, border = _spread(floor, queued, FROM_START, FROM_GOAL)
    if found:
        return False
    if not border:
        return True
    queued = _enter(floor, *problem.goal, reach, *frame, FROM_GOAL)
    found, border = _spread(floor, queued, FROM_GOAL, FROM_START)
    return not (found or border)
