"""Recalls a sub-plan from a state to a goal: candidates by cell, the quickest first, glanced at, then driven.

Candidates that drive alike are mostly blocked alike. So after a few of one shape others are tried first.
Those that pass through cells that are not free are left out: some bits tell that sooner than a glance.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from planners.memory.library.driving import ARRIVED, Placing, drive_again, placing_for, put
from planners.memory.library.sub_plans import (
    SECTORS,
    SHAPE_CELLS,
    SPEEDS,
    TURNS,
    SubPlans,
    first_cell,
    place_cell,
    speed_cell,
)
from planners.world.arrays import Floats, Integers
from planners.world.geometry.collision import Scene, state_is_free
from planners.world.geometry.occupancy import Bits, Window, is_crossed
from planners.world.goal import X, Y
from planners.world.jit import inlined, lean
from planners.world.trigonometry import length, wrapped
from planners.world.vehicles.dynamics import State, load, store
from planners.world.vehicles.vehicle import Vehicle

STEPS: Final = 1_000  # of an answer
LONGER: Final = 30  # steps that a drive may take more than its sub-plan
CANDIDATES: Final = 4_096
TIERS: Final = 3  # sectors: that of the goal, then those beside it
GLANCES: Final = 8  # states of a candidate that are tried before it is driven
SPREAD: Final = 5  # of so many states, one after another, so that the first glances lie far apart
PER_SHAPE: Final = 2  # candidates of a shape, before others are tried
CHOICES: Final = 3  # free candidates, of which the best is taken
CHECKED, LOOKS = range(2)  # indices into Recalling.work


class Cells(NamedTuple):
    """The cells of a window that are not free. A vehicle that passes through one is mostly blocked."""

    occupied: Bits  # [64]
    window: Window


class Recalling(NamedTuple):
    """Buffers for one question at a time. The answer lies in ``states`` and ``controls``."""

    states: Floats  # [STEPS + 1, S]
    controls: Floats  # [STEPS, 2]
    tried_states: Floats  # [STEPS + 1, S] the candidate that is driven
    tried_controls: Floats  # [STEPS, 2]
    pose: Floats  # [1, S]
    listed: Integers  # [CANDIDATES] entries of the index; of mirrored ones -1 - entry
    order: Integers  # [CANDIDATES] the same, the quickest first
    ends: Integers  # [STEPS + 1] where in the order those of so many steps end
    seen: Integers  # [SHAPE_CELLS] candidates of each shape so far
    work: Integers  # [2] states checked; looks taken: at the cells of a candidate, at a state of it


def allocate_recalling(state_size: int) -> Recalling:
    """Buffers for states of ``state_size`` numbers."""
    return Recalling(
        np.zeros((STEPS + 1, state_size)),
        np.zeros((STEPS, 2)),
        np.zeros((STEPS + 1, state_size)),
        np.zeros((STEPS, 2)),
        np.zeros((1, state_size)),
        np.zeros(CANDIDATES, np.int32),
        np.zeros(CANDIDATES, np.int32),
        np.zeros(STEPS + 1, np.int32),
        np.zeros(SHAPE_CELLS, np.int32),
        np.zeros(2, np.int64),
    )


@lean
def _list_candidates(
    subs: SubPlans, start: State, goal: Floats, sector: int, blindly: int, r: Recalling, vehicle: Vehicle
) -> int:
    """Fill in ``r.order`` with those that lead to a goal, ``sector`` sectors aside, and return how many.

    ``blindly`` is 0, or by how many entries candidates are taken from the wrong place of the index.
    """
    dx = goal[X] - start[0]
    dy = goal[Y] - start[1]
    metres = length(dx, dy)
    bearing = math.atan2(dy, dx) - start[2] + sector * (2.0 * math.pi / SECTORS)
    speed = speed_cell(start[3], vehicle)
    entries = subs.begins.shape[0]
    count = 0
    r.ends.fill(0)
    for mirrored in range(2):
        place = place_cell(metres, wrapped(-bearing if mirrored else bearing))
        if place < 0:
            return 0
        for pace in range(max(speed - 1, 0), min(speed + 2, SPEEDS)):
            for turn in range(TURNS):
                cell = first_cell(pace, turn) + place
                for listed in range(subs.cells[cell], subs.cells[cell + 1]):
                    entry = (listed + blindly) % entries
                    if count < CANDIDATES and subs.steps[entry] <= STEPS:
                        r.listed[count] = -1 - entry if mirrored else entry
                        r.ends[subs.steps[entry]] += 1
                        count += 1
    total = 0
    for steps in range(STEPS + 1):  # a counting sort
        here = r.ends[steps]
        r.ends[steps] = total
        total += here
        if here > 0 and total == count:
            break
    for k in range(count):
        entry = r.listed[k]
        steps = subs.steps[entry if entry >= 0 else -1 - entry]
        r.order[r.ends[steps]] = entry
        r.ends[steps] += 1
    return count


@inlined
def keep_tried(row: int, steps: int, r: Recalling, vehicle: Vehicle) -> None:
    """Let the first steps of the drive that was tried follow on a row of the answer."""
    for i in range(steps):
        r.controls[row + i, 0] = r.tried_controls[i, 0]
        r.controls[row + i, 1] = r.tried_controls[i, 1]
        store(r.states, row + i + 1, load(r.tried_states, i + 1, vehicle))


@inlined
def glances_are_free(
    subs: SubPlans, begin: int, steps: int, placing: Placing, r: Recalling, vehicle: Vehicle, scene: Scene
) -> bool:
    """Whether some states of a placed sub-plan are free."""
    for glance in range(GLANCES):
        at = begin + (glance * SPREAD % GLANCES + 1) * steps // GLANCES
        put(subs, begin, at, placing, r.pose)
        r.work[CHECKED] += 1
        r.work[LOOKS] += 1
        if not state_is_free(load(r.pose, 0, vehicle), vehicle, scene):
            return False
    return True


@inlined
def _is_crossed(subs: SubPlans, begin: int, steps: int, placing: Placing, cells: Cells, r: Recalling) -> bool:
    """Whether a placed sub-plan passes through a cell that is not free, as far as some places tell."""
    r.work[LOOKS] += 1
    for glance in range(1, GLANCES):
        put(subs, begin, begin + glance * SPREAD % GLANCES * steps // GLANCES, placing, r.pose)
        if is_crossed(r.pose[0, 0], r.pose[0, 1], cells.occupied, cells.window):
            return True
    return False


@lean
def recall_one(
    subs: SubPlans,
    row: int,
    goal: Floats,
    within: float,
    most: int,
    blindly: int,
    cells: Cells,
    r: Recalling,
    vehicle: Vehicle,
    scene: Scene,
) -> int:
    """Find a sub-plan from ``r.states[row]`` to a goal, and fill in its drive behind that row.

    Of the first free ones the quickest is taken. It has less than ``within`` steps. At most ``most`` looks
    are taken. Returns the steps, 0 for none.
    """
    start = load(r.states, row, vehicle)
    store(r.tried_states, 0, start)
    until = r.work[LOOKS] + most
    least = within
    found = 0
    choices = CHOICES
    for tier in range(TIERS):
        sector = (tier + 1) // 2 * (1 if tier % 2 else -1)
        count = _list_candidates(subs, start, goal, sector, blindly, r, vehicle)
        for again in range(2):
            r.seen.fill(0)
            for c in range(count):
                entry = r.order[c]
                side = 1.0 if entry >= 0 else -1.0
                entry = entry if entry >= 0 else -1 - entry
                steps = subs.steps[entry]
                if row + steps + LONGER > STEPS or steps > least:
                    continue
                if r.work[LOOKS] >= until:
                    return found
                begin = subs.begins[entry]
                placing = placing_for(subs, begin, begin + steps, side, start, goal)
                if _is_crossed(subs, begin, steps, placing, cells, r):
                    continue
                shape = subs.shapes[entry] if side > 0.0 else SHAPE_CELLS - 1 - subs.shapes[entry]
                r.seen[shape] += 1
                if (r.seen[shape] > PER_SHAPE) == (again == 0):
                    continue
                if not glances_are_free(subs, begin, steps, placing, r, vehicle, scene):
                    continue
                driven, ended = drive_again(
                    *(subs, begin, subs.lasts[begin], placing, goal, steps + LONGER, r.pose),
                    *(r.tried_states, r.tried_controls, vehicle, scene),
                )
                r.work[CHECKED] += driven
                if ended != ARRIVED:
                    continue
                if driven < least:
                    least = driven
                    found = driven
                    keep_tried(row, driven, r, vehicle)
                choices -= 1
                if choices == 0:
                    return found
        if found > 0:
            return found
    return 0
