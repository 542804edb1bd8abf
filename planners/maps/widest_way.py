"""Where the widest way between two places is narrowest."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from planners.maps.global_path import GlobalPaths, clear_cells
from planners.maps.occupancy_map import OccupancyMap
from planners.world.arrays import Flags, Floats, Integers, Point, Pose


class Gap(NamedTuple):
    """A narrow place between two wider ones."""

    place: Point  # metres
    width: float  # metres; at most, by up to a cell of the map
    onward: Point  # metres: where the way leads on, in the wider place behind


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
    clear = clear_cells(world)
    here, there = (_roomiest(world, clear, place) for place in (start, goal))
    levels = np.unique(clear[clear > 0.0])
    widest = min(clear[here], clear[there])
    low, high = 0, int(np.searchsorted(levels, widest, side="right"))
    while high > low:  # ways as wide as the levels below low are there, those from high on are not
        middle = (low + high) // 2
        low, high = (middle + 1, high) if _joins(clear >= levels[middle], here, there) else (low, middle)
    if low == 0 or levels[low - 1] == widest:
        return None
    narrow = float(levels[low - 1])
    (x, y), (onward_x, onward_y) = (
        _middle(world, cell).tolist() for cell in _saddle(world, clear, narrow, here, there)
    )
    return Gap((x, y), 2.0 * world.resolution * narrow, (onward_x, onward_y))


def middle_of(gap: Gap, world: OccupancyMap) -> Pose | None:
    """The pose half-way between the occupied cells on both sides of a gap, headed through it.

    None if nothing is occupied on the other side of what is nearest.
    """
    x, y = gap.place
    column, row = int(x / world.resolution), int(y / world.resolution)
    around = math.ceil(gap.width / world.resolution) + 1
    low, left = max(row - around, 0), max(column - around, 0)
    rows, columns = np.nonzero(world.occupied[low : row + around + 1, left : column + around + 1])
    cells = world.resolution * (np.stack([columns + left, rows + low], axis=1) + 0.5) - gap.place
    if not len(cells):
        return None
    one = cells[np.hypot(*cells.T).argmin()]
    beyond = cells[cells @ one < 0.0]
    if not len(beyond):
        return None
    other = beyond[np.hypot(*(beyond - one).T).argmin()]
    across = other - one
    heading = math.atan2(across[0], -across[1])
    onward = np.subtract(gap.onward, gap.place)
    if onward @ (math.cos(heading), math.sin(heading)) < 0.0:
        heading += math.pi
    middle = gap.place + 0.5 * (one + other)
    return float(middle[0]), float(middle[1]), heading


def _saddle(
    world: OccupancyMap, clear: Floats, narrow: float, here: tuple[int, int], there: tuple[int, int]
) -> tuple[tuple[int, int], tuple[int, int]]:
    """The narrowest cell of a way that is ``narrow`` out of the room around ``here``, and one behind it."""
    paths = GlobalPaths(OccupancyMap(world.name, clear < narrow, world.resolution))
    path = paths.path(_middle(world, here), _middle(world, there))
    assert path is not None
    cells = _with_corners(np.floor(path[:, ::-1] / world.resolution).astype(int))
    rooms, _ = ndimage.label(clear > narrow)
    passed = rooms[cells[:, 0], cells[:, 1]]
    other = int(np.flatnonzero((passed != 0) & (passed != passed[0]))[0])
    between = slice(int(np.flatnonzero(passed[:other] == passed[0])[-1]), other + 1)
    best = between.start + int(clear[cells[between, 0], cells[between, 1]].argmin())
    (row, column), (row_behind, column_behind) = cells[[best, other]].tolist()
    return (row, column), (row_behind, column_behind)


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
