"""Where the widest way between two places is narrowest."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from scipy import ndimage, sparse
from scipy.sparse import csgraph

from planners.maps.global_path import clear_cells
from planners.maps.occupancy_map import OccupancyMap
from planners.world.arrays import Flags, Floats, Point, Pose

COARSE: Final = 0.25  # of the width of gaps that matter: wider cells are halved

Cell = tuple[int, int]  # row, column


class Gap(NamedTuple):
    """A narrow place between two wider ones."""

    place: Point  # metres
    width: float  # metres; at most, by up to a cell where cells are fine
    onward: Point  # metres: where the way leads on, in the wider place behind


def narrowest_gap(world: OccupancyMap, start: Point, goal: Point, most: float = math.inf) -> Gap | None:
    """Find what is narrowest on the widest way between two places.

    A way begins and ends where there is most room around: uphill from each place, away from what is occupied.
    A gap of an odd number of cells would count as one wider, so coarse cells are halved.

    Args:
        world: the map.
        start: metres.
        goal: metres.
        most: metres; wider gaps are of no interest.

    Returns:
        The gap; None if there is no way, or nothing on it is narrower than its ends and than ``most``.
    """
    parts = 2 if COARSE * most < world.resolution else 1
    finer = _divided(world, parts)
    clear = clear_cells(finer)
    here, there = (_roomiest(finer, clear, place) for place in (start, goal))
    is_narrow = (clear > 0.0) & (clear < min(clear[here], clear[there]))
    levels = np.unique(clear[is_narrow & (clear <= 0.5 * most / finer.resolution)])
    if not len(levels) or _joins(clear > levels[-1], here, there):
        return None
    low, high = 0, len(levels)
    while high > low:  # ways as wide as the levels below low are there, those from high on are not
        middle = (low + high) // 2
        low, high = (middle + 1, high) if _joins(clear >= levels[middle], here, there) else (low, middle)
    if low == 0:
        return None
    narrow = float(levels[low - 1])
    cells = _saddle(clear, narrow, here, there)
    place, onward = (_middle(world, (row // parts, column // parts)) for row, column in cells)
    return Gap(place, 2.0 * finer.resolution * narrow, onward)


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


def _divided(world: OccupancyMap, parts: int) -> OccupancyMap:
    """The same map, each side of its cells divided into so many parts."""
    cells = world.occupied.repeat(parts, axis=0).repeat(parts, axis=1)
    return replace(world, occupied=cells, resolution=world.resolution / parts)


def _saddle(clear: Floats, narrow: float, here: Cell, there: Cell) -> tuple[Cell, Cell]:
    """The first cell, as clear as is ``narrow``, of a way out of the room around ``here``, and one behind it.

    Rooms are all that is clearer. The way has the fewest such cells and rooms.
    """
    nodes, rooms = ndimage.label(clear > narrow)
    gates = np.argwhere(clear == narrow)
    nodes[tuple(gates.T)] = rooms + 1 + np.arange(len(gates))
    tails, heads = np.concatenate(
        [
            np.stack([one.ravel(), other.ravel()])
            for one, other in ((nodes[:-1], nodes[1:]), (nodes[:, :-1], nodes[:, 1:]))
        ],
        axis=1,
    )
    joined = (tails != heads) & (np.minimum(tails, heads) > 0)
    ends, size = (tails[joined], heads[joined]), rooms + 1 + len(gates)
    graph = sparse.csr_array((np.ones(len(ends[0]), bool), ends), shape=(size, size))
    _, before = csgraph.breadth_first_order(graph, nodes[here], directed=False)
    way = [int(nodes[there])]
    while way[-1] != nodes[here]:
        way.append(int(before[way[-1]]))
    way.reverse()
    behind = next(k for k in range(2, len(way)) if way[k] <= rooms)
    (row, column), (last_row, last_column) = gates[[way[1] - rooms - 1, way[behind - 1] - rooms - 1]].tolist()
    beside = [(last_row + 1, last_column), (last_row - 1, last_column)]
    beside += [(last_row, last_column + 1), (last_row, last_column - 1)]
    bounds = clear.shape
    inside = (each for each in beside if 0 <= each[0] < bounds[0] and 0 <= each[1] < bounds[1])
    return (row, column), next(each for each in inside if nodes[each] == way[behind])


def _roomiest(world: OccupancyMap, clear: Floats, place: Point) -> Cell:
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


def _joins(open_cells: Flags, here: Cell, there: Cell) -> bool:
    """Whether a way over cells leads from one to another."""
    rooms, _ = ndimage.label(open_cells)
    return bool(rooms[here] == rooms[there] != 0)


def _middle(world: OccupancyMap, cell: Cell) -> Point:
    row, column = cell
    return world.resolution * (column + 0.5), world.resolution * (row + 0.5)
