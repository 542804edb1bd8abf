"""The shortest way over a map's cells, from which local goals are taken."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Final

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from planners.maps.occupancy_map import OccupancyMap
from planners.world.problem import CANONICAL_DISTANCE, Floats

_STEPS: Final = ((0, 1), (1, 0), (1, 1), (1, -1))  # row, column; the other four are these backwards


class GlobalPaths:
    """Shortest ways between free cells; a diagonal step needs both cells beside it free."""

    def __init__(self, world: OccupancyMap, cell_m: float) -> None:
        """Ways over cells of about ``cell_m`` metres, each free where the map is in all of it."""
        self._grid = world.coarser(cell_m)

    @cached_property
    def _ways(self) -> sparse.csr_array:
        free = np.pad(~self._grid.occupied, 1)
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
        columns = self._grid.occupied.shape[1] + 2
        cell_m = self._grid.resolution
        first, last = (
            int(row + 1) * columns + int(column + 1)
            for column, row in (np.floor(np.asarray(place) / cell_m) for place in (start, goal))
        )
        _, before = csgraph.dijkstra(
            self._ways, directed=False, indices=np.array(last), return_predecessors=True
        )
        if first != last and before[first] < 0:
            return None
        way = [first]
        while way[-1] != last:
            way.append(int(before[way[-1]]))
        rows, across = np.divmod(np.array(way), columns)
        return cell_m * (np.column_stack((across, rows)) - 0.5)


def local_goal(path: Floats, start: Floats, scale: float) -> float | None:
    """The heading (rad) from ``start`` to where a path leaves the canonical distance; None: it does not."""
    offsets = path - start
    far = np.flatnonzero(np.hypot(*offsets.T) >= scale * CANONICAL_DISTANCE)
    if len(far) == 0:
        return None
    x, y = offsets[far[0]]
    return math.atan2(y, x)
