"""Where the widest way between two places is narrowest."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from scipy import ndimage

from planners.maps.global_path import GlobalPaths
from planners.maps.occupancy_map import OccupancyMap
from planners.world.arrays import Flags, Floats, Point

OF_WALLS: Final = 0.5  # cells between a gap and twice the way to the nearest middle of an occupied cell


class Gap(NamedTuple):
    """A narrow place between two wider ones."""

    place: Point  # metres
    width: float  # metres, to half a cell of the map


def narrowest_gap(world: OccupancyMap, start: Point, goal: Point, reach: float) -> Gap | None:
    """Find what is narrowest on the widest way from near a start to near a goal.

    Args:
        world: the map.
        start: metres.
        goal: metres.
        reach: metres: the way begins and ends in the middle of the widest place so near to each.

    Returns:
        The gap; None if there is no way, or nothing on it is narrower than its ends.
    """
    clear = ndimage.distance_transform_edt(np.pad(~world.occupied, 1))[1:-1, 1:-1]  # cells between middles
    here, there = (_widest_near(world, clear, place, reach) for place in (start, goal))
    levels = np.unique(clear[clear > 0.0])
    ends = clear[here], clear[there]
    low, high = 0, int(np.searchsorted(levels, min(ends), side="right"))
    while high - low > 0:  # the widest: all below are connected, too
        middle = (low + high) // 2
        low, high = (middle + 1, high) if _joins(clear >= levels[middle], here, there) else (low, middle)
    if low == 0 or levels[low - 1] == min(ends):
        return None
    narrow = levels[low - 1]
    paths = GlobalPaths(OccupancyMap(world.name, clear < narrow, world.resolution))
    path = paths.path(_middle(world, here), _middle(world, there))
    assert path is not None
    cells = np.floor(path / world.resolution).astype(int)
    rooms, _ = ndimage.label(clear > narrow)
    passed = rooms[cells[:, 1], cells[:, 0]]
    other = int(np.flatnonzero((passed != 0) & (passed != passed[0]))[0])
    last = int(np.flatnonzero(passed[:other] == passed[0])[-1])
    between = slice(last, other + 1)
    x, y = path[between][int(clear[cells[between, 1], cells[between, 0]].argmin())].tolist()
    return Gap((x, y), world.resolution * (2.0 * float(narrow) - OF_WALLS))


def _widest_near(world: OccupancyMap, clear: Floats, place: Point, reach: float) -> tuple[int, int]:
    """The cell ``(row, column)`` with most room within some metres of a place."""
    rows, columns = clear.shape
    column, row = (int(each / world.resolution) for each in place)
    column, row = min(column, columns - 1), min(row, rows - 1)
    around = int(reach / world.resolution)
    low, left = max(row - around, 0), max(column - around, 0)
    window = clear[low : row + around + 1, left : column + around + 1]
    best_row, best_column = np.unravel_index(window.argmax(), window.shape)
    return low + int(best_row), left + int(best_column)


def _joins(open_cells: Flags, here: tuple[int, int], there: tuple[int, int]) -> bool:
    """Whether a way over cells leads from one to another."""
    rooms, _ = ndimage.label(open_cells)
    return bool(rooms[here] == rooms[there] != 0)


def _middle(world: OccupancyMap, cell: tuple[int, int]) -> Floats:
    return world.resolution * (np.array(cell[::-1]) + 0.5)
