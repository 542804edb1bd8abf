"""Whole drives of a library: those that began much as a question does, moved to its start and goal.

A drive is kept in the frame of the pose in which it ends. At another goal it is bent to the question's start:
it moves with the start where it begins, and not at all where it ends. What comes of it need not be free, nor
need its steps lead from state to state. It is where an optimisation begins.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from planners.memory.plans.plan_arrays import StoredPlans
from planners.search.manoeuvres.endings import in_frame_of_end
from planners.world.arrays import Floats, Indices, Integers
from planners.world.driving_cost import STANDING, cost_in_steps
from planners.world.geometry.collision import Scene, state_is_free
from planners.world.goal import HEADING, X, Y
from planners.world.jit import inlined, jit
from planners.world.problem import Plan
from planners.world.trigonometry import length, sincos, wrapped
from planners.world.vehicles.dynamics import load
from planners.world.vehicles.vehicle import FIRST_HITCH, Vehicle

NEAR: Final = 40  # drives that begin most alike, of which ...
TRIED: Final = 8  # ... those are tried that promise most
NEAREST: Final = 10  # of them: the cheapest of these sets what is usual
LOOK: Final = 3  # every so many states a moved drive is looked at
HOPELESS: Final = 0.5  # of its states are blocked: hardly any such drive becomes a plan
SECONDS_OFF: Final = 5.0  # what a length, a radian or a second of being blocked counts as


class Drives(NamedTuple):
    """Drives that end at rest, each in the frame of the pose in which it ends."""

    states: Floats  # [T, S] of all drives, one after another
    controls: Floats  # [T, 2] from each state to the next; that of a drive's last state counts for nothing
    bent: Floats  # [T] how much a state moves with the start: 1 at the start, 0 at the end
    starts: Indices  # [K + 1] drive k owns states[starts[k] : starts[k + 1]]
    firsts: Floats  # [K, S] the first state of each, side by side: all of them are looked at
    plans: Indices  # [K] which plan of the library it is
    costs: Indices  # [K] what each costs to drive, in steps


def drives_of(plans: StoredPlans, vehicle: Vehicle, numbers: Indices | None = None) -> Drives:
    """Take the plans of a library that end at rest, and lead anywhere: all, or those of some ``numbers``."""
    states, controls, bent, starts, taken, costs = [], [], [], [0], [], []
    if numbers is None:
        numbers = np.arange(len(plans))
    stand = np.abs(plans.states[plans.starts[1:] - 1, 3]) <= STANDING
    for number in numbers[stand[numbers]].tolist():
        plan = plans[number]
        metres = np.hypot(*np.diff(plan.states[:, :2], axis=0).T)
        if metres.sum() == 0.0:
            continue
        driven = np.concatenate([[0.0], np.cumsum(metres)]) / metres.sum()
        states.append(in_frame_of_end(plan.states))
        controls.append(np.vstack((plan.controls, np.zeros((1, 2)))))
        bent.append(1.0 - driven * driven * (3.0 - 2.0 * driven))
        starts.append(starts[-1] + len(plan.states))
        taken.append(number)
        costs.append(cost_in_steps(plan, vehicle))
    together = np.concatenate([np.empty((0, plans.states.shape[1])), *states])
    return Drives(
        together,
        np.concatenate([np.empty((0, 2)), *controls]),
        np.concatenate([np.empty(0), *bent]),
        np.array(starts, np.int64),
        together[starts[:-1]],
        np.array(taken, np.int64),
        np.array(costs, np.int64),
    )


@inlined
def _see(start: Floats, goal: Floats, seen: Floats) -> None:
    """Fill in a start ``[S]`` as ``seen [S]`` from the goal."""
    sin, cos = sincos(goal[HEADING])
    dx = start[0] - goal[X]
    dy = start[1] - goal[Y]
    seen[0] = cos * dx + sin * dy
    seen[1] = cos * dy - sin * dx
    seen[2] = start[2] - goal[HEADING]
    for k in range(3, start.shape[0]):
        seen[k] = start[k]


@inlined
def _begin_off(first: Floats, side: float, seen: Floats, off: Floats) -> float:
    """Fill in by how much a start, as it is ``seen [S]``, is ``off [S]`` from a drive's first state.

    ``side`` is -1 if the drive is mirrored. Returns how much heading and hitches are off in all, in radians.
    """
    off[0] = seen[0] - first[0]
    off[1] = seen[1] - side * first[1]
    off[2] = wrapped(seen[2] - side * first[2])
    far = float(abs(off[2]))
    for k in range(FIRST_HITCH, first.shape[0]):
        off[k] = seen[k] - side * first[k]
        far += abs(off[k])
    return far


@inlined
def _move(drives: Drives, i: int, side: float, goal: Floats, off: Floats, moved: Floats, row: int) -> None:
    """Write state ``i`` of the drives, moved to a goal and bent by ``off [S]``, into a row of ``moved``."""
    state, share = drives.states[i], drives.bent[i]
    sin, cos = sincos(goal[HEADING])
    x = state[0] + share * off[0]
    y = side * state[1] + share * off[1]
    moved[row, 0] = goal[X] + cos * x - sin * y
    moved[row, 1] = goal[Y] + sin * x + cos * y
    moved[row, 2] = goal[HEADING] + side * state[2] + share * off[2]
    moved[row, 3] = state[3]
    moved[row, 4] = side * state[4]
    for k in range(FIRST_HITCH, state.shape[0]):
        moved[row, k] = side * state[k] + share * off[k]


@jit
def rank_drives(
    drives: Drives, start: Floats, goal: Floats, most: float, order: Integers, vehicle: Vehicle, scene: Scene
) -> tuple[int, int, int]:
    """Find the drives that promise most: quick ones that begin much as asked, and are hardly blocked.

    Those of which more than ``HOPELESS`` is blocked are left out.

    Args:
        drives: of the vehicle.
        start: the state ``[S]`` at which the question begins.
        goal: that of ``goal_of``, with a heading.
        most: by how much a drive may begin elsewhere, in lengths of the body and radians together.
        order: ``[TRIED]`` is filled in with numbers of drives, the best first; if mirrored -1 - number.
        vehicle: what is driven.
        scene: what must not be met.

    Returns:
        How many there are, the steps of the cheapest of the ``NEAREST`` (0 if there are fewer), and how many
        states were checked.
    """
    size = start.shape[0]
    near = np.empty(NEAR, np.int64)
    far = np.full(NEAR, most)
    seen = np.zeros(size)
    _see(start, goal, seen)
    off = np.zeros(size)
    moved = np.zeros((1, size))
    body = vehicle.front + vehicle.rear
    count = checks = cheapest = 0
    for drive in range(drives.plans.shape[0]):
        first = drives.firsts[drive]
        for mirrored in range(2):
            side = -1.0 if mirrored else 1.0
            apart = length(seen[0] - first[0], seen[1] - side * first[1]) / body
            if apart >= far[NEAR - 1]:
                continue
            away = _begin_off(first, side, seen, off) + apart
            if away >= far[NEAR - 1]:
                continue
            at = min(count, NEAR - 1)
            while at > 0 and far[at - 1] > away:
                far[at] = far[at - 1]
                near[at] = near[at - 1]
                at -= 1
            far[at] = away
            near[at] = -1 - drive if mirrored else drive
            count = min(count + 1, NEAR)
    promises = np.full(NEAR, math.inf)
    hopeful = 0
    for n in range(count):
        drive = max(near[n], -1 - near[n])
        side = 1.0 if near[n] >= 0 else -1.0
        _begin_off(drives.firsts[drive], side, seen, off)
        blocked = 0
        begin = drives.starts[drive]
        last = drives.starts[drive + 1]
        for i in range(begin, last, LOOK):
            _move(drives, i, side, goal, off, moved, 0)
            checks += 1
            if not state_is_free(load(moved, 0, vehicle), vehicle, scene):
                blocked += LOOK
        steps = drives.costs[drive]
        if n == 0 or (n < NEAREST and steps < cheapest):
            cheapest = steps
        if blocked <= HOPELESS * (last - begin):
            promises[n] = (steps + SECONDS_OFF * blocked) * vehicle.dt + SECONDS_OFF * far[n]
            hopeful += 1
    if count < NEAREST:
        cheapest = 0  # a few drives say nothing about what is usual
    best = np.argsort(promises[:count])
    count = min(hopeful, TRIED)
    for n in range(count):
        order[n] = near[best[n]]
    return count, cheapest, checks


@jit
def _moved(drives: Drives, drive: int, side: float, start: Floats, goal: Floats, states: Floats) -> None:
    """Fill in the ``states [T, S]`` of a drive that is moved to a start and a goal."""
    seen = np.zeros(start.shape[0])
    _see(start, goal, seen)
    off = np.zeros(start.shape[0])
    _begin_off(drives.firsts[drive], side, seen, off)
    for i in range(states.shape[0]):
        _move(drives, drives.starts[drive] + i, side, goal, off, states, i)
    turns = start[2] - states[0, 2]  # whole ones
    for i in range(states.shape[0]):
        states[i, 2] += turns
    for k in range(start.shape[0]):
        states[0, k] = start[k]


def moved_drive(drives: Drives, entry: int, start: Floats, goal: Floats, dt: float) -> Plan:
    """Move a drive to a start ``[S]`` and a goal: a guess, whose steps do not quite lead from state to state.

    Args:
        drives: of the vehicle.
        entry: as in the ``order`` of ``rank_drives``.
        start: where it is to begin.
        goal: where it is to end, that of ``goal_of``.
        dt: the vehicle's step in seconds.
    """
    drive, side = max(entry, -1 - entry), 1.0 if entry >= 0 else -1.0
    first, last = drives.starts[drive], drives.starts[drive + 1]
    states = np.empty((last - first, len(start)))
    _moved(drives, drive, side, start, goal, states)
    return Plan(states, drives.controls[first : last - 1] * np.array([1.0, side]), dt)


def placed_drive(drives: Drives, entry: int, goal: Floats, dt: float) -> Plan:
    """Put a drive to a goal as it was driven, or as in a mirror: it ends there, wherever it then begins.

    The arguments are those of ``moved_drive``.
    """
    drive, side = max(entry, -1 - entry), 1.0 if entry >= 0 else -1.0
    first, last = drives.starts[drive], drives.starts[drive + 1]
    states = drives.states[first:last] * side
    states[:, [0, 3]] *= side  # how far ahead it is, and its speed
    sin, cos = math.sin(goal[HEADING]), math.cos(goal[HEADING])
    states[:, :2] = goal[[X, Y]] + states[:, :2] @ np.array([[cos, sin], [-sin, cos]])
    states[:, 2] += goal[HEADING]
    return Plan(states, drives.controls[first : last - 1] * np.array([1.0, side]), dt)
