"""The shortest ways over a map's cells, from which local goals are taken."""

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

_STEPS: Final = ((0, 1), (1, 0), (1, 1), (1, -1))  # row, column; the other four are these backwards


class GlobalPaths:
    """Shortest ways between free cells; a diagonal step needs both cells beside it free."""

    def __init__(self, world: OccupancyMap, cell_m: float) -> None:
        """Ways over cells of about ``cell_m`` metres, each free where the map is in all of it."""
        self.grid = world.coarser(cell_m)

    @cached_property
    def _ways(self) -> sparse.csr_array:
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
        """The middles ``[n, 2]`` (grid metres) of the cells on a shortest way; None where there is none."""
        return self.ways_to(goal).path(start)

    def ways_to(self, goal: Floats) -> WaysTo:
        """The shortest ways from everywhere to the cell of a goal."""
        cell = _cell(self.grid, goal)
        metres, after = csgraph.dijkstra(
            self._ways, directed=False, indices=np.array(cell), return_predecessors=True
        )
        return WaysTo(self.grid, cell, self.grid.resolution * metres, after)


class WaysTo:
    """The shortest ways from everywhere to one goal."""

    def __init__(self, grid: OccupancyMap, cell: int, metres: Floats, after: Integers) -> None:
        """Of each cell, a border of one around the grid included, its metres to go and the next cell."""
        rows, columns = grid.occupied.shape
        self._grid, self._last, self._after = grid, cell, after
        self.metres: Floats = metres.reshape(rows + 2, columns + 2)[1:-1, 1:-1]  # [rows, columns] to the goal

    def path(self, start: Floats) -> Floats | None:
        """The middles ``[n, 2]`` (grid metres) of the cells from a place to the goal; None: no way."""
        first = _cell(self._grid, start)
        if first != self._last and self._after[first] < 0:
            return None
        way = [first]
        while way[-1] != self._last:
            way.append(int(self._after[way[-1]]))
        rows, across = np.divmod(np.array(way), self._grid.occupied.shape[1] + 2)
        return self._grid.resolution * (np.column_stack((across, rows)) - 0.5)


def local_goal(path: Floats, start: Floats, scale: float) -> float | None:
    """The heading (rad) from ``start`` to where a path leaves the canonical distance; None: it does not."""
    offsets = path - start
    far = np.flatnonzero(np.hypot(*offsets.T) >= scale * CANONICAL_DISTANCE)
    if len(far) == 0:
        return None
    x, y = offsets[far[0]]
    return math.atan2(y, x)


def _cell(grid: OccupancyMap, place: Floats) -> int:
    """The number of a place's cell, the border of one around the grid counted."""
    column, row = np.floor(np.asarray(place) / grid.resolution)
    return int(row + 1) * (grid.occupied.shape[1] + 2) + int(column + 1)
