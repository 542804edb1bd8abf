"""The shortest paths over a map's cells, from which local goals are taken."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Final

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from planners.maps.occupancy_map import OccupancyMap
from planners.world.arrays import Floats, Integers
from planners.world.problem import CANONICAL_DISTANCE

_STEPS: Final = ((0, 1), (1, 0), (1, 1), (1, -1))  # row, column; the other four go backwards


class GlobalPaths:
    """Shortest paths between free cells. A diagonal step needs the cells on both sides free."""

    def __init__(self, world: OccupancyMap, cell_m: float) -> None:
        """Use cells of about ``cell_m`` metres, each free if the map is free in all of it."""
        self.grid = world.coarser(cell_m)

    @cached_property
    def _edges(self) -> sparse.csr_array:
        free = np.pad(~self.grid.occupied, 1)
        cells = np.arange(free.size).reshape(free.shape)
        ends, lengths = [], []
        for row, column in _STEPS:
            to = np.roll(cells, (-row, -column), (0, 1))
            beside = np.roll(free, -row, 0) & np.roll(free, -column, 1)
            good = free & free.reshape(-1)[to] & beside
            ends.append(np.stack([cells[good], to[good]]))
            lengths.append(np.full(int(good.sum()), math.hypot(row, column)))
        tails, heads = np.concatenate(ends, axis=1)
        return sparse.csr_array((np.concatenate(lengths), (tails, heads)), shape=(free.size, free.size))

    def path(self, start: Floats, goal: Floats) -> Floats | None:
        """Return the centres ``[n, 2]`` (grid metres) of the cells on a shortest path, or None."""
        return self.paths_to(goal).path(start)

    def paths_to(self, goal: Floats) -> PathsTo:
        """Find the shortest paths from everywhere to the cell of a goal ``[2]`` (grid metres)."""
        cell = _cell(self.grid, goal)
        metres, after = csgraph.dijkstra(
            self._edges, directed=False, indices=np.array(cell), return_predecessors=True
        )
        return PathsTo(self.grid, cell, self.grid.resolution * metres, after)


class PathsTo:
    """The shortest paths from everywhere to one goal."""

    def __init__(self, grid: OccupancyMap, cell: int, metres: Floats, after: Integers) -> None:
        """``metres`` and ``after`` hold the metres to go and the next cell, with a border of one cell."""
        rows, columns = grid.occupied.shape
        self._grid, self._last, self._after = grid, cell, after
        self.metres: Floats = metres.reshape(rows + 2, columns + 2)[1:-1, 1:-1]  # [rows, columns] to the goal

    def path(self, start: Floats) -> Floats | None:
        """Return the centres ``[n, 2]`` (grid metres) of cells from ``start [2]`` to the goal, or None."""
        first = _cell(self._grid, start)
        if first != self._last and self._after[first] < 0:
            return None
        cells = [first]
        while cells[-1] != self._last:
            cells.append(int(self._after[cells[-1]]))
        rows, columns = np.divmod(np.array(cells), self._grid.occupied.shape[1] + 2)
        return self._grid.resolution * (np.column_stack((columns, rows)) - 0.5)


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
    """The number of a point's cell, counting a border of one around the grid."""
    column, row = np.floor(np.asarray(point) / grid.resolution)
    return int(row + 1) * (grid.occupied.shape[1] + 2) + int(column + 1)
