"""Turns trains round forwards, in loops: optimisation makes drives of ways that are blocked as they are laid.

Trailers straighten behind a car that drives forwards, however they were folded. So a train may turn round in
a loop, as long as there is room to drive straight at last. Trees find such drives late, or never: they step
back out of the goal, and there trailers fold. Loops are few, so they are simply laid out, blocked as they may
be, and of those that are least blocked optimisation makes drives.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from planners.search.connection.candidates import list_forward_words_between
from planners.search.connection.words import MOST_WORDS, PARTS
from planners.search.manoeuvres.arcs import COARSE, at_pace, lay_arc, stride_of
from planners.search.manoeuvres.driving import Drive, cost_of_drive
from planners.search.manoeuvres.mending import drive_one_of
from planners.search.manoeuvres.ways import take_arcs
from planners.search.query import Query
from planners.world.arrays import Floats, Pose
from planners.world.compiling import working_clock
from planners.world.driving_cost import gear_of
from planners.world.geometry.collision import Scene, bodies_are_free, state_is_free
from planners.world.jit import inlined, lean
from planners.world.trigonometry import sincos
from planners.world.vehicles.dynamics import (
    bend_with,
    curvature_of,
    load,
    step,
    store,
    tightest_bend,
    turning_speed,
)
from planners.world.vehicles.vehicle import Vehicle, length_of_trailers

NEAR_BY: Final = 1.5  # lengths of the whole train: if the goal is farther away, the way there turns anyway
# lengths are in those of all trailers
BACKS: Final = (0.0, 0.5)  # how far a train backs up before its loop,
RUN_INS: Final = (0.5, 1.0, 1.5)  # drives straight at last, so that it straightens,
PASTS: Final = (0.0, 0.15)  # and backs up into the goal
WIDTHS: Final = (0.0, 0.5)  # of loops: 0 is the tightest, 1 where trailers keep well within their hitches
TIGHTEST: Final = 1.05  # times the least radius: what is left corrects
LEGS: Final = 6  # arcs of a loop: back, three of a word, straight, back
FORWARD: Final = 3  # arcs of a word that leads forwards only
TRIES: Final = 4  # loops that are optimised, those that are least blocked ...
ITERATIONS: Final = 60  # ... with so many iterations each while time counts
TIME_SHARE: Final = 0.25  # of the time left, at most: a search may find a drive in the rest
MOST_BLOCKED: Final = 0.5  # share of a loop that meets obstacles or folds trailers too far, ...
MOST_MEETS: Final = 0.3  # ... and that meets obstacles


class Loops(NamedTuple):
    """The loops that are least blocked."""

    metres: Floats  # [TRIES, LEGS] of their arcs, negative backwards
    bends: Floats  # [TRIES, LEGS]
    blocked: Floats  # [TRIES] the share of each that is blocked, ascending; 1: there is none
    words: Floats  # [MOST_WORDS, 2 PARTS] scratch
    trial: Floats  # [2, LEGS] scratch: metres and bends of one loop


def allocate_loops() -> Loops:
    """Buffers; there are no loops yet."""
    whole = np.zeros((2, TRIES, LEGS))
    return Loops(whole[0], whole[1], np.ones(TRIES), np.zeros((MOST_WORDS, 2 * PARTS)), np.zeros((2, LEGS)))


@inlined
def _keep(loops: Loops, blocked: float) -> None:
    """Keep the trial among the others, of which the last one gives way."""
    at = loops.blocked.shape[0] - 1
    while at > 0 and loops.blocked[at - 1] > blocked:
        loops.blocked[at] = loops.blocked[at - 1]
        for k in range(LEGS):
            loops.metres[at, k] = loops.metres[at - 1, k]
            loops.bends[at, k] = loops.bends[at - 1, k]
        at -= 1
    loops.blocked[at] = blocked
    for k in range(LEGS):
        loops.metres[at, k] = loops.trial[0, k]
        loops.bends[at, k] = loops.trial[1, k]


@inlined
def _looks(metres: float, vehicle: Vehicle) -> int:
    """How many looks an arc is worth."""
    if metres == 0.0:
        return 0
    return math.ceil(abs(metres) / (COARSE * stride_of(gear_of(metres), vehicle)))


@lean
def _blocked_share(loops: Loops, start: Floats, most: float, vehicle: Vehicle, scene: Scene) -> float:
    """Which share of the trial is blocked, or folds trailers too far; 1 if it is ``most`` or more.

    Too tight a loop is made wider by optimisation, so it may fold trailers along more than it may meet.
    """
    whole = 0
    for k in range(LEGS):
        whole += _looks(loops.trial[0, k], vehicle)
    state = load(start, 0, vehicle)
    blocked, meets = 0, 0
    for k in range(LEGS):
        bend = loops.trial[1, k]
        looks = _looks(loops.trial[0, k], vehicle)
        speed = loops.trial[0, k] / (max(looks, 1) * vehicle.dt)
        for _ in range(looks):
            state = step(at_pace(state, speed, bend, vehicle), 0.0, 0.0, vehicle)
            here = at_pace(state, 0.0, bend, vehicle)
            if not state_is_free(here, vehicle, scene):
                blocked += 1
                meets += 0 if bodies_are_free(here, vehicle, scene) else 1
                if blocked >= most * whole or meets >= MOST_MEETS * whole:
                    return 1.0
    return blocked / max(whole, 1)


@inlined
def _ahead(pose: Pose, metres: float) -> Pose:
    """The pose some metres straight ahead."""
    sin, cos = sincos(pose[2])
    return pose[0] + metres * cos, pose[1] + metres * sin, pose[2]


@lean
def _list_between(
    loops: Loops, start: Floats, end: Pose, radius: float, straight: Pose, vehicle: Vehicle, scene: Scene
) -> None:
    """List loops of a radius; ``straight``: metres back before, ahead after the loop, and back at last.

    Those that would be driven for longer backwards than forwards are left out.
    """
    back, run_in, past = straight
    here = _ahead((start[0, 0], start[0, 1], start[0, 2]), -back)
    count = list_forward_words_between(here, _ahead(end, past - run_in), radius, loops.words)
    bend = bend_with(1.0 / radius, vehicle)
    metres, bends = loops.trial[0], loops.trial[1]
    for i in range(count):
        metres[0], metres[LEGS - 2], metres[LEGS - 1] = -back, run_in, -past
        forwards = run_in
        for k in range(FORWARD):
            metres[1 + k] = radius * loops.words[i, PARTS + k]
            bends[1 + k] = bend * loops.words[i, k]
            forwards += metres[1 + k]
        if (back + past) * vehicle.max_speed > -forwards * vehicle.min_speed:
            continue
        most = min(loops.blocked[-1], MOST_BLOCKED)
        blocked = _blocked_share(loops, start, most, vehicle, scene)
        if blocked < most:
            _keep(loops, blocked)


@lean
def list_loops(
    loops: Loops, start: Floats, end: Floats, wide: float, train: float, vehicle: Vehicle, scene: Scene
) -> None:
    """List the loops that are least blocked.

    Args:
        loops: to be filled in.
        start: ``[1, S]``, at rest.
        end: ``[1, S]`` the goal pose.
        wide: the radius in metres with which trailers keep well within their hitches.
        train: the length of all trailers, in metres.
        vehicle: what is driven.
        scene: what must not be met.
    """
    loops.blocked.fill(1.0)
    loops.trial.fill(0.0)
    goal = (end[0, 0], end[0, 1], end[0, 2])
    tight = TIGHTEST / curvature_of(tightest_bend(turning_speed(vehicle), vehicle), vehicle)
    for width in WIDTHS:
        radius = tight + width * max(wide - tight, 0.0)
        for back in BACKS:
            for past in PASTS:
                for run_in in RUN_INS:
                    straight = (back * train, run_in * train, past * train)
                    _list_between(loops, start, goal, radius, straight, vehicle, scene)


@lean
def lay_loop(way: Floats, loops: Loops, number: int, start: Floats, vehicle: Vehicle) -> int:
    """Lay a loop from ``start [1, S]`` into ``way [N, S]``, as ``lay_way`` does; returns how many states."""
    at = 0
    state = load(start, 0, vehicle)
    for k in range(LEGS):
        metres = loops.metres[number, k]
        if metres == 0.0:
            continue
        gear = gear_of(metres)
        at = lay_arc(way, at, state, gear, loops.bends[number, k], abs(metres), 0.0, vehicle)
        if at < 0:
            return 0
        state = load(way, at - 1, vehicle)
    if at > 0:
        store(way, 0, load(start, 0, vehicle))
        way[at - 1, 3] = 0.0
    return at


def loop(
    query: Query, drive: Drive, start: Floats, end: Floats, radius: float, vehicle: Vehicle, until: float
) -> bool:
    """Make a drive of a loop, if the goal is near; whether ``drive`` leads there now.

    A train that is quicker backwards mostly has quicker ways to turn round.

    Args:
        query: the problem, and the buffers.
        drive: to be filled in.
        start: ``[1, S]``, at rest.
        end: ``[1, S]`` the goal pose.
        radius: of words, in metres, with which trailers keep straight enough.
        vehicle: what is driven.
        until: when to end, by ``working_clock``.
    """
    train = length_of_trailers(vehicle)
    is_far = math.dist(start[0, :2], end[0, :2]) > NEAR_BY * (vehicle.front + vehicle.rear + train)
    if is_far or vehicle.max_speed < -vehicle.min_speed:
        return False
    now = working_clock()
    until = now + TIME_SHARE * (until - now)
    loops = query.workspace.buffers(allocate_loops)
    list_loops(loops, start, end, radius, train, vehicle, query.scene)
    ways: list[Floats] = []
    numbers: list[int] = []
    for k in np.flatnonzero(loops.blocked < 1.0).tolist():
        rows = lay_loop(drive.states, loops, k, start, vehicle)
        if rows > 1:
            ways.append(drive.states[:rows].copy())
            numbers.append(k)
    number = drive_one_of(ways, query, drive, vehicle, until, ITERATIONS)
    if number < 0:
        return False
    k = numbers[number]
    curvatures = np.array([curvature_of(bend, vehicle) for bend in loops.bends[k]])
    take_arcs(drive.ways, loops.metres[k], loops.metres[k] * curvatures)
    drive.ways.last_cost[0] = cost_of_drive(drive, vehicle)
    return True
