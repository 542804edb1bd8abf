"""Which parts of stored plans begin like a state and lead to a place: an index of sub-plans by cells.

A sub-plan drives from one state of a stored plan to a later one. It is listed by how it begins, in cells of
speed and of steering (or turn rate), and by where it leads, seen from where it begins: rings of distance and
sectors of bearing. Of those in a cell that drive alike only the quickest are kept, so a thousand plans of two
million sub-plans need some megabytes. Mirrored sub-plans are found in the mirrored cell. Hitches are not told
apart: driving forwards straightens them.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from planners.memory.plans.plan_arrays import StoredPlans
from planners.world.arrays import Floats, Integers
from planners.world.jit import inlined, jit
from planners.world.trigonometry import length, sincos
from planners.world.vehicles.dynamics import turn_limit
from planners.world.vehicles.vehicle import Vehicle

SPEEDS: Final = 6  # cells from the least to the largest speed
TURNS: Final = 3  # cells of steering or turn rate; odd, so that the mirror image of a cell is one
RING_M: Final = 2.0
RINGS: Final = 40
SECTORS: Final = 48
SHAPES: Final = 4  # cells to either side, in which a way keeps aside of the straight one
SHAPE_CELLS: Final = (2 * SHAPES + 1) ** 2
SHAPE_M: Final = 0.75  # side of such a cell, at least ...
SHAPE_SHARE: Final = 0.06  # ... and this share of the distance
MOST_BEGINNINGS: Final = 150_000  # states that begin sub-plans
ALIKE: Final = 3  # sub-plans of one cell and one shape that are kept, the quickest


class SubPlans(NamedTuple):
    """The stored plans end to end, and their sub-plans cell by cell, in each the quickest first."""

    states: Floats  # [T, S] of all plans
    lasts: Integers  # [T] the last state of the plan of each state
    cells: Integers  # [SPEEDS TURNS RINGS SECTORS + 1] cell c owns begins[cells[c] : cells[c + 1]]
    begins: Integers  # [E] the state that each sub-plan begins with
    steps: Integers  # [E] how many it drives
    shapes: Integers  # [E] what its way looks like, as in ``shape_of``


@inlined
def speed_cell(speed: float, vehicle: Vehicle) -> int:
    """The cell of a speed (m/s)."""
    share = (speed - vehicle.min_speed) / (vehicle.max_speed - vehicle.min_speed)
    return min(max(int(share * SPEEDS), 0), SPEEDS - 1)


@inlined
def turn_cell(turn: float, vehicle: Vehicle) -> int:
    """The cell of a steering angle (rad) or turn rate (rad/s)."""
    share = 0.5 + 0.5 * turn / turn_limit(vehicle)
    return min(max(int(share * TURNS), 0), TURNS - 1)


@inlined
def place_cell(metres: float, bearing: float) -> int:
    """The cell of a place at a distance, in a direction (rad) from -pi to pi; -1 if it is too far away."""
    ring = int(metres / RING_M)
    sector = min(int((bearing + math.pi) * (SECTORS / (2.0 * math.pi))), SECTORS - 1)
    return ring * SECTORS + sector if ring < RINGS else -1


@inlined
def first_cell(speed: int, turn: int) -> int:
    """The first cell of those that begin with a cell of speeds and one of turns; the places follow."""
    return (speed * TURNS + turn) * RINGS * SECTORS


@inlined
def shape_of(states: Floats, begin: int, end: int) -> int:
    """How far a sub-plan keeps aside of the straight way, in cells after a third and two thirds of its time.

    The mirror image of shape s is ``SHAPE_CELLS - 1 - s``.
    """
    dx = states[end, 0] - states[begin, 0]
    dy = states[end, 1] - states[begin, 1]
    metres = length(dx, dy)
    per_cell = 1.0 / max(metres * max(SHAPE_M, SHAPE_SHARE * metres), 1e-9)
    shape = 0
    for third in range(1, 3):
        at = begin + third * (end - begin) // 3
        aside = dx * (states[at, 1] - states[begin, 1]) - dy * (states[at, 0] - states[begin, 0])
        cell = min(max(aside * per_cell, -float(SHAPES)), float(SHAPES))
        shape = shape * (2 * SHAPES + 1) + round(cell) + SHAPES
    return shape


@jit
def _listed(
    states: Floats, lasts: Integers, stride: int, vehicle: Vehicle, keys: Integers, entries: Integers
) -> int:
    """Fill in cell, begin, steps and shape of each sub-plan as far as there is room, and count them all."""
    count = 0
    for i in range(0, states.shape[0], stride):
        sin, cos = sincos(states[i, 2])
        first = first_cell(speed_cell(states[i, 3], vehicle), turn_cell(states[i, 4], vehicle))
        before = -1
        for j in range(i + 1, lasts[i] + 1):
            dx = states[j, 0] - states[i, 0]
            dy = states[j, 1] - states[i, 1]
            place = place_cell(length(dx, dy), math.atan2(dy * cos - dx * sin, dx * cos + dy * sin))
            if place >= 0 and place != before:
                if count < keys.shape[0]:
                    keys[count] = first + place
                    entries[count, 0] = i
                    entries[count, 1] = j - i
                    entries[count, 2] = shape_of(states, i, j)
                count += 1
            before = place
    return count


def index_of(plans: StoredPlans, vehicle: Vehicle) -> SubPlans:
    """List the sub-plans of the plans of a vehicle: some tenths of a second for a thousand plans.

    Of very many plans not every state begins sub-plans.
    """
    states = np.ascontiguousarray(plans.states)
    lasts = np.repeat(plans.starts[1:] - 1, np.diff(plans.starts)).astype(np.int32)
    stride = -(-len(states) // MOST_BEGINNINGS)
    room = 16 * len(states) // stride
    while True:
        keys, entries = np.empty(room, np.int32), np.empty((room, 3), np.int32)
        count = _listed(states, lasts, stride, vehicle, keys, entries)
        if count <= room:
            break
        room = count
    keys, entries = keys[:count], entries[:count]
    groups = keys.astype(np.int64) * SHAPE_CELLS + entries[:, 2]
    order = np.lexsort((entries[:, 1], groups))
    begun = np.diff(groups[order], prepend=-1) != 0
    first = np.maximum.accumulate(np.where(begun, np.arange(count), 0))
    kept = order[np.arange(count) - first < ALIKE]
    kept = kept[np.lexsort((entries[kept, 1], keys[kept]))]
    cells = np.searchsorted(keys[kept], np.arange(first_cell(SPEEDS, 0) + 1)).astype(np.int32)
    begins, steps, shapes = np.ascontiguousarray(entries[kept].T)
    return SubPlans(states, lasts, cells, begins, steps, shapes)
