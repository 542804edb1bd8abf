"""Where the widest way between two places is narrowest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from planners.maps.global_path import GlobalPaths
from planners.maps.occupancy_map import OccupancyMap
from planners.world.arrays import Flags, Floats, Integers, Point


class Gap(NamedTuple):
    """A narrow place between two wider ones."""

    place: Point  # metres
    width: float  # metres; at most, by up to a cell of the map


def narrowest_gap(world: OccupancyMap, start: Point, goal: Point) -> Gap | None:
    """Find what is narrowest on the widest way between two places.

    A way begins and ends where there is most room around: uphill from each place, away from what is occupied.

    Args:
        world: the map.
        start: metres.
        goal: metres.

    Returns:
        The gap; None if there is no way, or nothing on it is narrower than its ends.
    """
    clear = ndimage.distance_transform_edt(np.pad(~world.occupied, 1))[1:-1, 1:-1]  # cells between middles
    here, there = (_roomiest(world, clear, place) for place in (start, goal))
    levels = np.unique(clear[clear > 0.0])
    widest = min(clear[here], clear[there])
    low, high = 0, int(np.searchsorted(levels, widest, side="right"))
    while high > low:  # ways as wide as the levels below low are there, those from high on are not
        middle = (low + high) // 2
        low, high = (middle + 1, high) if _joins(clear >= levels[middle], here, there) else (low, middle)
    if low == 0 or levels[low - 1] == widest:
        return None
    row, column = _saddle(world, clear, levels[low - 1], here, there)
    x, y = _middle(world, (row, column)).tolist()
    return Gap((x, y), 2.0 * world.resolution * float(levels[low - 1]))


def _saddle(
    world: OccupancyMap, clear: Floats, narrow: float, here: tuple[int, int], there: tuple[int, int]
) -> tuple[int, int]:
    """The narrowest cell where a way that is ``narrow`` leads out of the room around ``here``."""
    paths = GlobalPaths(OccupancyMap(world.name, clear < narrow, world.resolution))
    path = paths.path(_middle(world, here), _middle(world, there))
    assert path is not None
    cells = _with_corners(np.floor(path[:, ::-1] / world.resolution).astype(int))
    rooms, _ = ndimage.label(clear > narrow)
    passed = rooms[cells[:, 0], cells[:, 1]]
    other = int(np.flatnonzero((passed != 0) & (passed != passed[0]))[0])
    between = slice(int(np.flatnonzero(passed[:other] == passed[0])[-1]), other + 1)
    best = between.start + int(clear[cells[between, 0], cells[between, 1]].argmin())
    return int(cells[best, 0]), int(cells[best, 1])


def _with_corners(cells: Integers) -> Integers:
    """Cells ``[n, 2]`` with one more beside each diagonal step, which leads over a corner of it."""
    corners = np.stack([cells[1:, 0], cells[:-1, 1]], axis=1)
    both = np.stack([cells[:-1], corners], axis=1).reshape(-1, 2)
    whole: Integers = np.concatenate([both, cells[-1:]])
    return whole


def _roomiest(world: OccupancyMap, clear: Floats, place: Point) -> tuple[int, int]:
    """The cell ``(row, column)`` uphill from a place, around which no cell is clearer."""
    rows, columns = clear.shape
    column, row = (int(each / world.resolution) for each in place)
    best = min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)
    while True:
        low, left = max(best[0] - 1, 0), max(best[1] - 1, 0)
        around = clear[low : best[0] + 2, left : best[1] + 2]
        if around.max() <= clear[best]:
            return best
        up, right = np.unravel_index(around.argmax(), around.shape)
        best = low + int(up), left + int(right)


def _joins(open_cells: Flags, here: tuple[int, int], there: tuple[int, int]) -> bool:
    """Whether a way over cells leads from one to another."""
    rooms, _ = ndimage.label(open_cells)
    return bool(rooms[here] == rooms[there] != 0)


def _middle(world: OccupancyMap, cell: tuple[int, int]) -> Floats:
    return world.resolution * (np.array(cell[::-1]) + 0.5)
