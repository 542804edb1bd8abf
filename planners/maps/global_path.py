"""The shortest paths over a map's cells, from which local goals are taken."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Final

import numpy as np
from scipy import ndimage

from planners.maps.grid_dijkstra import OCCUPIED, distances_to
from planners.maps.occupancy_map import OccupancyMap, blocks
from planners.world.arrays import Floats, Integers
from planners.world.problem import CANONICAL_DISTANCE

SHARE: Final = 0.36  # of the width of a disc: spots of neighbours on two sides of a wall are farther apart
OFF_MIDDLE: Final = math.sqrt(0.5) - 0.5  # cells: no disc has so much more room than one in a cell's middle
MIN_CLEAR: Final = (
    0.5  # cells, between occupied ones, of which the middle has 0, and free ones, with 1 or more
)


class GlobalPaths:
    """Shortest paths between free cells. A diagonal step needs the cells on both sides free."""

    def __init__(
        self, grid: OccupancyMap, spots: Floats | None = None, rooms: Integers | None = None
    ) -> None:
        """Find paths over the cells of a map.

        Args:
            grid: the map.
            spots: ``[rows, columns, 2]`` where paths lead through each cell (metres); None: its middle.
            rooms: ``[rows, columns]`` numbers of parts of the map; no path leads from one to another.
        """
        if spots is None:
            rows, columns = np.indices(grid.occupied.shape)
            spots = grid.resolution * (np.stack((columns, rows), axis=-1) + 0.5)
        self.grid, self.spots = grid, spots
        self.rooms = np.zeros(grid.occupied.shape, np.int32) if rooms is None else rooms

    @cached_property
    def room(self) -> Floats:
        """Metres from the middle of each cell, ``[rows, columns]``, to the nearest that is not free."""
        return self.grid.resolution * clear_cells(self.grid)

    @cached_property
    def _parts(self) -> Integers:
        """The room of each free cell, with a border of one cell."""
        parts = np.where(self.grid.occupied, OCCUPIED, self.rooms).astype(np.int32)
        return np.pad(parts, 1, constant_values=OCCUPIED)

    def path(self, start: Floats, goal: Floats) -> Floats | None:
        """Return the spots ``[n, 2]`` (grid metres) of the cells on a shortest path, or None."""
        return self.paths_to(goal).path(start)

    def paths_to(self, goal: Floats) -> PathsTo:
        """Find the shortest paths from everywhere to the cell of a goal ``[2]`` (grid metres)."""
        cell = _cell(self.grid, goal)
        cells, after = distances_to(cell, self._parts)
        return PathsTo(self, cell, self.grid.resolution * cells, after)


def passable(world: OccupancyMap, width: float, cell_m: float) -> GlobalPaths:
    """Return the shortest paths through all gaps that let a disc through.

    Args:
        world: the map.
        width: of the disc, metres. Cells are at most ``SHARE`` of it, if those of the map are.
        cell_m: width of a cell at most, metres, if those of the map are no wider.
    """
    clear = clear_cells(world)
    least = max(0.5 * width / world.resolution - OFF_MIDDLE, MIN_CLEAR)
    parts, _ = ndimage.label(clear >= least, np.ones((3, 3)))  # a door that is too narrow joins none
    factor = max(1, math.floor(min(cell_m, SHARE * width) / world.resolution + 1e-9))
    squares = np.moveaxis(blocks(clear, factor, 0.0), 2, 1)  # [rows, columns, factor, factor]
    rows, columns = squares.shape[:2]
    best = squares.reshape(rows, columns, -1).argmax(axis=2)
    row, column = np.indices((rows, columns))
    row, column = factor * row + best // factor, factor * column + best % factor
    inside = (row < clear.shape[0]) & (column < clear.shape[1])
    row_in, column_in = np.minimum(row, clear.shape[0] - 1), np.minimum(column, clear.shape[1] - 1)
    fits = inside & (clear[row_in, column_in] >= least)
    spots = np.stack((column, row), axis=-1) + 0.5
    grid = OccupancyMap(world.name, ~fits, factor * world.resolution, world.origin)
    return GlobalPaths(grid, world.resolution * spots, parts[row_in, column_in])


def clear_cells(world: OccupancyMap) -> Floats:
    """How many cells lie between the middle of each and that of the nearest occupied one; all beyond is."""
    clear: Floats = ndimage.distance_transform_edt(np.pad(~world.occupied, 1))[1:-1, 1:-1]
    return clear


class PathsTo:
    """The shortest paths from everywhere to one goal."""

    def __init__(self, paths: GlobalPaths, cell: int, metres: Floats, after: Integers) -> None:
        """``metres`` and ``after`` hold the metres to go and the next cell, with a border of one cell."""
        rows, columns = paths.grid.occupied.shape
        self._grid, self._spots, self._last, self._after = paths.grid, paths.spots, cell, after
        self.metres: Floats = metres.reshape(rows + 2, columns + 2)[1:-1, 1:-1]  # [rows, columns] to the goal

    def path(self, start: Floats) -> Floats | None:
        """Return the spots ``[n, 2]`` (grid metres) of cells from ``start [2]`` to the goal, or None."""
        first = _cell(self._grid, start)
        if first != self._last and self._after[first] < 0:
            return None
        cells = [first]
        while cells[-1] != self._last:
            cells.append(int(self._after[cells[-1]]))
        bordered = np.divmod(np.array(cells), self._grid.occupied.shape[1] + 2)
        rows, columns = (  # of the border, those of the cells beside it
            np.clip(each - 1, 0, count - 1)
            for each, count in zip(bordered, self._grid.occupied.shape, strict=True)
        )
        spots: Floats = self._spots[rows, columns]
        return spots


def length_of(path: Floats) -> float:
    """Return how long a ``path [n, 2]`` is, in its own unit."""
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


def local_goal(path: Floats, start: Floats, scale: float) -> float | None:
    """Return the heading (rad) from ``start [2]`` to the first point of a path at the canonical distance.

    It is None if the path does not get that far. ``scale`` is metres in a canonical metre.
    """
    offsets = path - start
    far = np.flatnonzero(np.hypot(*offsets.T) >= scale * CANONICAL_DISTANCE)
    if len(far) == 0:
        return None
    x, y = offsets[far[0]]
    return math.atan2(y, x)


def _cell(grid: OccupancyMap, point: Floats) -> int:
    """The number of a point's cell, counting a border of one around the grid, to which all beyond belongs."""
    rows, columns = grid.occupied.shape
    column, row = np.floor(np.asarray(point) / grid.resolution)
    return int(np.clip(row, -1, rows) + 1) * (columns + 2) + int(np.clip(column, -1, columns) + 1)
