"""The distance to the goal disc from each cell of a window, around obstacles: Dijkstra's search.

A cell that an obstacle meets is not closed, because a vehicle may pass beside the obstacle: a step from it
costs as much as ``BLOCKED`` steps in the open. A free cell beside one costs a little more.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from planners.world.arrays import Floats, Integers
from planners.world.geometry.occupancy import GRID, Bits, Window
from planners.world.jit import inlined, lean
from planners.world.trigonometry import length

_STEPS: Final = ((1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1))  # column, row
_ONE: Final = np.uint64(1)
STRAIGHT: Final = 20  # the cost of a straight step from a free cell in the open
DIAGONAL: Final = 28
BESIDE: Final = 1.2  # times that from a free cell beside a blocked one
BLOCKED: Final = 40.0  # times that from a blocked cell
_BUCKETS: Final = 2048  # more than the dearest step costs
FAR: Final = 1 << 30  # the cost of a cell that was not reached
BORDER_M: Final = 3.0  # farther than this beyond the window the distance to it is added
# indices into CostToGo.frame
LEFT, BOTTOM, PER_M, METRES = range(4)


class CostToGo(NamedTuple):
    """The costs, and the buffers of the search."""

    costs: Integers  # [GRID, GRID] of the centres of cells; row = y, column = x
    straight: Integers  # [GRID, GRID] the cost of a straight step from each cell
    diagonal: Integers  # [GRID, GRID] and of a diagonal one
    heads: Integers  # [_BUCKETS] the first entry of the queue for each cost modulo ``_BUCKETS``; -1 for none
    entries: Integers  # [9 GRID^2, 2] a cell, and the next entry of its bucket
    frame: Floats  # [4] left and bottom of the window (metres), cells a metre, metres of a unit of cost


def allocate_cost_to_go() -> CostToGo:
    """Buffers for one problem at a time."""
    return CostToGo(
        np.empty((GRID, GRID), np.int32),
        np.empty((GRID, GRID), np.int32),
        np.empty((GRID, GRID), np.int32),
        np.empty(_BUCKETS, np.int32),
        np.empty((9 * GRID * GRID, 2), np.int32),
        np.zeros(4),
    )


@lean
def _fill_steps(occupied: Bits, go: CostToGo) -> None:
    for row in range(GRID):
        here = occupied[row]
        below = occupied[max(row - 1, 0)]
        above = occupied[min(row + 1, GRID - 1)]
        beside = here << _ONE | here >> _ONE | below | above
        for column in range(GRID):
            bit = np.uint64(column)
            straight = STRAIGHT
            diagonal = DIAGONAL
            if (here >> bit) & _ONE:
                straight = int(BLOCKED * STRAIGHT)
                diagonal = int(BLOCKED * DIAGONAL)
            elif (beside >> bit) & _ONE:
                straight = int(BESIDE * STRAIGHT)
                diagonal = int(BESIDE * DIAGONAL)
            go.straight[row, column] = straight
            go.diagonal[row, column] = diagonal
            go.costs[row, column] = FAR


@inlined
def _enter(go: CostToGo, filled: int, row: int, column: int, cost: int) -> int:
    """Put a cell into the queue if this cost is less than before. Returns how many entries are filled."""
    if cost >= go.costs[row, column]:
        return filled
    go.costs[row, column] = cost
    bucket = cost % _BUCKETS
    go.entries[filled, 0] = row * GRID + column
    go.entries[filled, 1] = go.heads[bucket]
    go.heads[bucket] = filled
    return filled + 1


@lean
def fill_cost_to_go(
    occupied: Bits, goal_x: float, goal_y: float, radius: float, window: Window, go: CostToGo
) -> None:
    """Fill in ``go.costs``.

    ``occupied [64]`` are the cells that obstacles meet; the goal disc's centre and radius are in metres.
    """
    left, bottom, cell = window
    go.frame[LEFT] = left
    go.frame[BOTTOM] = bottom
    go.frame[PER_M] = 1.0 / cell
    go.frame[METRES] = cell / STRAIGHT
    _fill_steps(occupied, go)
    go.heads.fill(-1)
    filled = 0
    reach = int(radius / cell) + 1
    column = min(max(int((goal_x - left) / cell), 0), GRID - 1)
    row = min(max(int((goal_y - bottom) / cell), 0), GRID - 1)
    for r in range(max(row - reach, 0), min(row + reach, GRID - 1) + 1):
        for c in range(max(column - reach, 0), min(column + reach, GRID - 1) + 1):
            dx = left + (c + 0.5) * cell - goal_x
            dy = bottom + (r + 0.5) * cell - goal_y
            if (dx * dx + dy * dy <= radius * radius) or (r == row and c == column):
                filled = _enter(go, filled, r, c, 0)
    cost = 0
    empty = 0
    while empty < _BUCKETS:
        bucket = cost % _BUCKETS
        entry = go.heads[bucket]
        empty = empty + 1 if entry < 0 else 0
        go.heads[bucket] = -1
        while entry >= 0:
            row = go.entries[entry, 0] // GRID
            column = go.entries[entry, 0] % GRID
            entry = go.entries[entry, 1]
            if go.costs[row, column] != cost:
                continue
            for k in range(8):
                r = row + _STEPS[k][1]
                c = column + _STEPS[k][0]
                if 0 <= r < GRID and 0 <= c < GRID:
                    step = go.straight[row, column] if k < 4 else go.diagonal[row, column]
                    filled = _enter(go, filled, r, c, cost + step)
        cost += 1


@inlined
def metres_to_go(x: float, y: float, go: CostToGo) -> float:
    """The cost at a point (metres) between the centres of four cells, in metres in the open.

    Far beyond the window it is that at the window's border, and the distance to the border.
    """
    u = (x - go.frame[LEFT]) * go.frame[PER_M] - 0.5
    w = (y - go.frame[BOTTOM]) * go.frame[PER_M] - 0.5
    beyond_u = max(-u, u - (GRID - 1), 0.0)
    beyond_w = max(-w, w - (GRID - 1), 0.0)
    beyond = max(length(beyond_u, beyond_w) / go.frame[PER_M] - BORDER_M, 0.0)
    column = min(max(int(u), 0), GRID - 2)
    row = min(max(int(w), 0), GRID - 2)
    u = min(max(u - column, 0.0), 1.0)
    w = min(max(w - row, 0.0), 1.0)
    below = go.costs[row, column] * (1.0 - u) + go.costs[row, column + 1] * u
    above = go.costs[row + 1, column] * (1.0 - u) + go.costs[row + 1, column + 1] * u
    return float(go.frame[METRES] * (below * (1.0 - w) + above * w) + beyond)
