"""Sub-plans that lead onward, by how they begin: of those that end alike only the quickest.

A way is put together of these. Some hundred begin like any state, so all that begin like one can be compared
by where they lead. Finer distinctions found no more ways and took longer.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from planners.memory.library.sub_plans import SPEEDS, TURNS, SubPlans, speed_cell, turn_cell
from planners.world.arrays import Floats, Integers
from planners.world.vehicles.dynamics import control_limits
from planners.world.vehicles.vehicle import Vehicle

# ends are alike if they lie between the same two of these distances,
RINGS_M: Final = (4.0, 8.0, 14.0, 22.0, 30.0, 40.0)
BEARINGS: Final = 24  # in the same of so many sectors,
HEADINGS: Final = 5  # and face into the same of so many
MOST_STEPS: Final = 150
MIDDLES: Final = 6  # places on the way that are listed


class Stretches(NamedTuple):
    """The sub-plans that begin in each cell of speed and steering (or turn rate)."""

    cells: Integers  # [SPEEDS TURNS + 1] cell c owns begins[cells[c] : cells[c + 1]]
    begins: Integers  # [K] the state that each begins with
    steps: Integers  # [K] how many it drives
    ends: Floats  # [K, 4] x, y, heading where it ends, seen from where it begins; speed
    middles: Floats  # [K, MIDDLES, 2] x, y of places on the way, seen from there, too


def _seen_from(first: Floats, there: Floats) -> Floats:
    """Places ``[K, 2]`` as seen from states ``[K, S]``."""
    way = (there[:, 0] - first[:, 0] + 1j * (there[:, 1] - first[:, 1])) * np.exp(-1j * first[:, 2])
    return np.column_stack([way.real, way.imag])


def stretches_of(subs: SubPlans, vehicle: Vehicle) -> Stretches:
    """Choose from the sub-plans of a vehicle."""
    first, last = subs.states[subs.begins], subs.states[subs.begins + subs.steps]
    ends = _seen_from(first, last)
    heading = np.angle(np.exp(1j * (last[:, 2] - first[:, 2])))
    ring = np.digitize(np.hypot(*ends.T), RINGS_M)
    sector = ((np.arctan2(ends[:, 1], ends[:, 0]) + math.pi) * (BEARINGS / (2.0 * math.pi))).astype(np.int64)
    facing = ((heading + math.pi) * (HEADINGS / (2.0 * math.pi))).astype(np.int64)
    motions = first[:, 3:5].tolist()
    cell = np.array([speed_cell(v, vehicle) * TURNS + turn_cell(turn, vehicle) for v, turn in motions])
    alike = ((cell * len(RINGS_M) + ring) * (BEARINGS + 1) + sector) * (HEADINGS + 1) + facing
    missing = vehicle.max_speed - last[:, 3]
    late = subs.steps * vehicle.dt + missing**2 / (2.0 * control_limits(vehicle)[0] * vehicle.max_speed)
    useful = (ring > 0) & (ring < len(RINGS_M)) & (subs.steps <= MOST_STEPS)
    order = np.flatnonzero(useful)
    order = order[np.lexsort((late[order], alike[order]))]
    kept = order[np.diff(alike[order], prepend=-1) != 0]
    middles = [
        _seen_from(first[kept], subs.states[subs.begins[kept] + subs.steps[kept] * k // (MIDDLES + 1)])
        for k in range(1, MIDDLES + 1)
    ]
    return Stretches(
        np.searchsorted(cell[kept], np.arange(SPEEDS * TURNS + 1)).astype(np.int32),
        subs.begins[kept],
        subs.steps[kept],
        np.column_stack([ends, heading, last[:, 3]])[kept],
        np.ascontiguousarray(np.stack(middles, axis=1)),
    )
