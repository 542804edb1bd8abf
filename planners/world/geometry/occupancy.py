"""Which cells of a square window are not free: as bits for recall and searches, as a grid for the encoder."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planners.world.arrays import Bounds, Floats, Integers
from planners.world.jit import inlined, jit, lean
from planners.world.problem import BOUNDS, CANONICAL_GOAL, Problem, has_canonical_ends
from planners.world.workspace import Workspace

Grid = np.ndarray[tuple[int, ...], np.dtype[np.uint8]]
Bits = np.ndarray[tuple[int, ...], np.dtype[np.uint64]]

GRID = 64  # cells a side, and bits of a word
CELL = (BOUNDS[2] - BOUNDS[0]) / GRID  # metres a side
ALL_CELLS = np.uint64(0xFFFFFFFFFFFFFFFF)  # of a row
_ONE = np.uint64(1)
_LEAST_PIECES = 256  # convex pieces that the buffers hold at least


class Window(NamedTuple):
    """Where the cells of a drawing lie: ``GRID`` a side."""

    left: float  # metres
    bottom: float
    cell_m: float  # side of a cell


CANONICAL_WINDOW = Window(BOUNDS[0], BOUNDS[1], CELL)
_NEAR_M = 32.0  # side of the window of a question whose goal is at its start
_MARGIN_M = 7.0  # least distance from start and goal to the window's border, as in the canonical one


class Drawing(NamedTuple):
    """The cells that obstacles meet. Bit c of word r is the cell in row r (y) and column c (x)."""

    occupied: Bits  # [64] cells that are not free
    pieces: Bits  # [C, 64] cells that each convex piece meets; only the words of its rows are filled in
    rows: Integers  # [C, 2] first and last row that each piece meets; if it meets none, first > last
    spans: Floats  # [2, 64] scratch: least and greatest x of a piece in each row


def allocate_drawing(pieces: int) -> Drawing:
    """Buffers for a drawing of at most so many convex pieces."""
    return Drawing(
        np.empty(GRID, np.uint64),
        np.empty((pieces, GRID), np.uint64),
        np.empty((pieces, 2), np.int32),
        np.empty((2, GRID)),
    )


@inlined
def cells_between(first: int, last: int) -> np.uint64:
    """The word with bits ``first`` to ``last`` set, both from 0 to 63."""
    return np.uint64((ALL_CELLS << np.uint64(first)) & (ALL_CELLS >> np.uint64(GRID - 1 - last)))


@lean
def draw_piece(
    vertices: Floats, first: int, last: int, words: Bits, spans: Floats, window: Window
) -> tuple[int, int]:
    """Fill in the ``words [64]`` of the rows that a convex piece ``vertices[first : last]`` meets.

    This is exact: a convex piece covers one interval of x in each row of half-open cells, so its edges are
    clipped row by row. Returns the first and the last of these rows; ``spans [2, 64]`` is scratch.
    """
    low = spans[0]
    high = spans[1]
    left, bottom, cell = window
    per_m = 1.0 / cell
    y_min = math.inf
    y_max = -math.inf
    for i in range(first, last):
        y_min = min(y_min, vertices[i, 1])
        y_max = max(y_max, vertices[i, 1])
    row_0 = max(0, math.floor((y_min - bottom) * per_m))
    row_1 = min(GRID - 1, math.floor((y_max - bottom) * per_m))
    for row in range(row_0, row_1 + 1):
        low[row] = math.inf
        high[row] = -math.inf
    for i in range(first, last):
        j = i + 1 if i + 1 < last else first
        upper = i if vertices[i, 1] > vertices[j, 1] else j
        lower = j if upper == i else i
        x_0 = vertices[lower, 0] - left
        y_0 = vertices[lower, 1] - bottom
        x_1 = vertices[upper, 0] - left
        y_1 = vertices[upper, 1] - bottom
        slope = (x_1 - x_0) / (y_1 - y_0) if y_1 > y_0 else 0.0
        edge_row_0 = max(row_0, math.floor(y_0 * per_m))
        edge_row_1 = min(row_1, math.floor(y_1 * per_m))
        for row in range(edge_row_0, edge_row_1 + 1):
            enter = x_0 if y_0 >= row * cell else x_0 + slope * (row * cell - y_0)
            leave = x_1 if y_1 <= (row + 1) * cell else x_0 + slope * ((row + 1) * cell - y_0)
            low[row] = min(low[row], enter, leave)
            high[row] = max(high[row], enter, leave)
    for row in range(row_0, row_1 + 1):
        column_0 = max(0, math.floor(low[row] * per_m))
        column_1 = min(GRID - 1, math.floor(high[row] * per_m))
        words[row] = cells_between(column_0, column_1) if column_0 <= column_1 else np.uint64(0)
    return row_0, row_1


@lean
def _draw_outside(
    x_min: float, y_min: float, x_max: float, y_max: float, window: Window, occupied: Bits
) -> None:
    """Set exactly those cells of ``occupied [64]`` that are not wholly inside the bounds."""
    columns = np.uint64(0)
    for column in range(GRID):
        left = window.left + column * window.cell_m
        if left >= x_min and left + window.cell_m <= x_max:
            columns |= _ONE << np.uint64(column)
    for row in range(GRID):
        bottom = window.bottom + row * window.cell_m
        inside = bottom >= y_min and bottom + window.cell_m <= y_max
        occupied[row] = ALL_CELLS ^ columns if inside else ALL_CELLS


@lean
def draw(vertices: Floats, piece_starts: Integers, bounds: Bounds, window: Window, drawing: Drawing) -> None:
    """Draw convex pieces ``[V, 2]``, ``[P + 1]``. Cells not wholly inside the bounds are not free."""
    occupied = drawing.occupied
    _draw_outside(bounds[0], bounds[1], bounds[2], bounds[3], window, occupied)
    for p in range(piece_starts.shape[0] - 1):
        words = drawing.pieces[p]
        row_0, row_1 = draw_piece(
            vertices, piece_starts[p], piece_starts[p + 1], words, drawing.spans, window
        )
        drawing.rows[p, 0] = row_0
        drawing.rows[p, 1] = row_1
        for row in range(row_0, row_1 + 1):
            occupied[row] |= words[row]


@lean
def _unpack(bits: Bits, grid: Grid) -> None:
    for row in range(GRID):
        word = bits[row]
        for column in range(GRID):
            grid[row, column] = (word >> np.uint64(column)) & _ONE


@jit
def draw_occupancy(vertices: Floats, piece_starts: Integers, bounds: Floats) -> Grid:
    """The canonical grid ``[64, 64]`` of pieces ``[V, 2]``, ``[P + 1]`` in bounds ``[4]``, for kernels."""
    occupied = np.empty(GRID, np.uint64)
    words = np.empty(GRID, np.uint64)
    spans = np.empty((2, GRID))
    _draw_outside(bounds[0], bounds[1], bounds[2], bounds[3], CANONICAL_WINDOW, occupied)
    for p in range(piece_starts.shape[0] - 1):
        row_0, row_1 = draw_piece(
            vertices, piece_starts[p], piece_starts[p + 1], words, spans, CANONICAL_WINDOW
        )
        for row in range(row_0, row_1 + 1):
            occupied[row] |= words[row]
    grid = np.empty((GRID, GRID), np.uint8)
    _unpack(occupied, grid)
    return grid


@inlined
def is_crossed(x: float, y: float, occupied: Bits, window: Window) -> bool:
    """Whether an obstacle meets the cell of a point (metres). Outside the window none is known."""
    column = math.floor((x - window.left) / window.cell_m)
    row = math.floor((y - window.bottom) / window.cell_m)
    if column < 0 or column >= GRID or row < 0 or row >= GRID:
        return False
    return bool((occupied[row] >> np.uint64(column)) & _ONE)


def window_of(problem: Problem) -> Window:
    """Lay a window around start and goal: the canonical one if they lie as in canonical problems.

    Otherwise cells are the smaller, the nearer the goal is, but half a metre at least: the way around an
    obstacle beside a short way may be long.
    """
    if has_canonical_ends(problem):
        return CANONICAL_WINDOW
    (x, y, _), goal = problem.start, problem.goal
    across = max(abs(goal[0] - x), abs(goal[1] - y))
    near = _NEAR_M + across * (GRID * CELL - _NEAR_M) / CANONICAL_GOAL[0]
    side = max(near, across + 2.0 * _MARGIN_M)
    return Window(0.5 * (x + goal[0] - side), 0.5 * (y + goal[1] - side), side / GRID)


def drawing_of(problem: Problem, workspace: Workspace | None = None) -> Drawing:
    """Draw the cells of a problem's window that its obstacles meet.

    Args:
        problem: what to draw.
        workspace: the caller's buffers, which the next drawing overwrites; by default new ones.
    """
    obstacles = problem.obstacles
    pieces = max(_LEAST_PIECES, 1 << len(obstacles.piece_starts).bit_length())
    drawing = (workspace or Workspace()).buffers(allocate_drawing, pieces)
    draw(obstacles.vertices, obstacles.piece_starts, problem.bounds, window_of(problem), drawing)
    return drawing


def grid_of(bits: Bits) -> Grid:
    """Unpack bits ``[64]`` into a grid ``[64, 64]`` (row = y, column = x)."""
    grid = np.empty((GRID, GRID), np.uint8)
    _unpack(bits, grid)
    return grid


def bits_of(grids: Grid) -> Bits:
    """Pack grids ``[..., 64, 64]`` into bits ``[..., 64]``."""
    return np.packbits(grids, axis=-1, bitorder="little").view("<u8").astype(np.uint64)[..., 0]


def occupancy_of(problem: Problem) -> Grid:
    """Draw the grid ``[64, 64]`` of a canonical problem: 1 for each cell that is not free."""
    vertices, piece_starts, _ = problem.obstacles
    return draw_occupancy(vertices, piece_starts, np.array(problem.bounds))


def pack(grid: Grid) -> Grid:
    """Pack a grid ``[64, 64]`` into bytes ``[512]``, as files hold it."""
    return np.packbits(grid)


def unpack(packed: Grid) -> Grid:
    """Unpack bytes ``[512]`` into a grid ``[64, 64]``."""
    return np.unpackbits(packed).reshape(GRID, GRID)
