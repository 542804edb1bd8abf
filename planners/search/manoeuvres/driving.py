"""Drives words of turns, and arcs from rest to rest, each as quickly as obstacles allow."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from planners.search.connection.connect import connect
from planners.search.connection.connection import Connection, allocate_connection, radius_at
from planners.search.connection.words import PARTS
from planners.search.manoeuvres.arcs import FINE_LOOKS, at_pace, stride_of
from planners.search.manoeuvres.joining import Join, allocate_join
from planners.search.manoeuvres.near_meetings import NearMeetings, allocate_near_meetings
from planners.search.manoeuvres.pace import fill_pace
from planners.search.manoeuvres.ways import Ways, allocate_ways
from planners.world.arrays import Floats, Indices
from planners.world.driving_cost import cost_of, gear_of
from planners.world.geometry.collision import Scene, state_is_free
from planners.world.goal import SLACK
from planners.world.jit import inlined, lean
from planners.world.problem import Plan
from planners.world.vehicles.dynamics import (
    admissible,
    control_limits,
    curvature_of,
    load,
    step,
    store,
    tightest_bend,
    top_speed,
    turn_in,
    turning_speed,
)
from planners.world.vehicles.vehicle import Vehicle

STEPS: Final = 1 << 13  # of a drive at most
TOPS: Final = (1.0, 0.7, 0.5, 0.35, 0.25, 0.17, 0.12, 0.08, 0.04)  # shares of full speed, and at last ...
CREEPS: Final = (0.5, 0.1)  # ... these shares of the pace at which a tree looks where it is narrow
PACES: Final = len(TOPS) + len(CREEPS)
NEAR_M: Final = 2e-3  # how exactly a word leads to a node, in metres and radians
STRIDES: Final = 1 << 10  # of an arc at most
ROUNDING: Final = 1e-9
SMALLEST: Final = 1e-6  # metres: shorter arcs are left out


class Drive(NamedTuple):
    """Buffers for one drive at a time."""

    states: Floats  # [STEPS + 1, S]
    controls: Floats  # [STEPS, 2]
    counts: Indices  # [3] steps; looks at obstacles; parts of known endings
    levels: Indices  # [STRIDES + 1] which of the ``PACES`` is free at each stride of an arc
    limits: Floats  # [STRIDES + 1] and the speed that this allows, in m/s
    target: Floats  # [8] as of ``goal_of``: the node
    connection: Connection
    join: Join
    ways: Ways
    near: NearMeetings


def allocate_drive(state_size: int) -> Drive:
    """Buffers for states of ``state_size`` numbers."""
    return Drive(
        np.zeros((STEPS + 1, state_size)),
        np.zeros((STEPS, 2)),
        np.zeros(3, np.int64),
        np.zeros(STRIDES + 1, np.int64),
        np.zeros(STRIDES + 1),
        np.array([0.0, 0.0, NEAR_M, 0.0, NEAR_M, -SLACK, SLACK, math.inf]),
        allocate_connection(state_size),
        allocate_join(state_size),
        allocate_ways(),
        allocate_near_meetings(),
    )


@lean
def begin(drive: Drive, start: Floats) -> None:
    """Begin a drive at ``start [1, S]``."""
    drive.counts.fill(0)
    for k in range(drive.states.shape[1]):
        drive.states[0, k] = start[0, k]


@lean
def append(drive: Drive, steps: int) -> bool:
    """Add the drive of the connection behind the present one."""
    c = drive.connection
    at = drive.counts[0]
    if at + steps > drive.controls.shape[0]:
        return False
    for i in range(steps):
        for k in range(2):
            drive.controls[at + i, k] = c.controls[i, k]
        for k in range(c.states.shape[1]):
            drive.states[at + i + 1, k] = c.states[i + 1, k]
    drive.counts[0] += steps
    return True


@lean
def connection_is_free(drive: Drive, steps: int, vehicle: Vehicle, scene: Scene) -> bool:
    """Whether the first steps of the drive of the connection are free."""
    for i in range(steps + 1):
        drive.counts[1] += 1
        if not state_is_free(load(drive.connection.states, i, vehicle), vehicle, scene):
            return False
    return True


@lean
def turn_wheels(drive: Drive, bend: float, vehicle: Vehicle) -> int:
    """Turn the wheels at rest, from the end of the drive.

    Returns the steps that lie in the connection then, or -1 if it has no room for so many.
    """
    c = drive.connection
    state = load(drive.states, drive.counts[0], vehicle)
    store(c.states, 0, state)
    if turn_in(bend, 0.0, vehicle) != bend:
        return 0  # it turns by driving
    limit = control_limits(vehicle)[1] * vehicle.dt
    steps = max(math.ceil(abs(bend - state[4]) / limit - ROUNDING), 0)
    if steps > c.controls.shape[0]:
        return -1
    for i in range(steps):
        second = (bend - state[4]) / (vehicle.dt * (steps - i))
        c.controls[i, 0] = 0.0
        c.controls[i, 1] = second
        state = step(state, 0.0, second, vehicle)
        store(c.states, i + 1, state)
    return steps


def cost_of_drive(drive: Drive, vehicle: Vehicle) -> float:
    """What the drive costs that the buffers hold, in seconds."""
    steps = int(drive.counts[0])
    return cost_of(Plan(drive.states[: steps + 1], drive.controls[:steps], vehicle.dt), vehicle)


@inlined
def _pace(level: int, gear: float, top: float, vehicle: Vehicle) -> float:
    """The speed (m/s) of a level, of which level 0 is the quickest, where ``top`` is full speed."""
    if level < len(TOPS):
        return TOPS[level] * top
    return min(
        TOPS[-1] * top, CREEPS[level - len(TOPS)] * stride_of(gear, vehicle) / (FINE_LOOKS * vehicle.dt)
    )


@lean
def _list_limits(
    drive: Drive, gear: float, bend: float, metres: float, top: float, vehicle: Vehicle, scene: Scene
) -> int:
    """Find the quickest of the ``PACES`` that is free at each stride of an arc. Returns the strides."""
    state = load(drive.states, drive.counts[0], vehicle)
    count = min(max(math.ceil(metres / stride_of(gear, vehicle)), 1), drive.levels.shape[0] - 1)
    speed = gear * metres / (count * vehicle.dt)
    for i in range(count + 1):
        level = 0
        while level < PACES - 1:
            drive.counts[1] += 1
            speed_there = gear * _pace(level, gear, top, vehicle)
            if state_is_free(at_pace(state, speed_there, bend, vehicle), vehicle, scene):
                break
            level += 1
        drive.levels[i] = level
        state = step(at_pace(state, speed, bend, vehicle), 0.0, 0.0, vehicle)
    return count


@lean
def _drive_on(drive: Drive, bend: float, metres: float, vehicle: Vehicle, scene: Scene) -> bool:
    """Drive an arc of the first order that cannot stand: as quickly as it can, else as slowly."""
    c = drive.connection
    top = top_speed(1.0, bend, vehicle)
    for slowly in range(2):
        steps = math.ceil(metres / (top * vehicle.dt) - ROUNDING)
        if slowly == 1:
            steps = int(metres / (vehicle.min_speed * vehicle.dt) + ROUNDING)
        if steps > c.controls.shape[0]:
            return False
        speed = metres / (max(steps, 1) * vehicle.dt)
        if steps == 0 or not (vehicle.min_speed - SLACK <= speed <= top + SLACK):
            continue
        state = load(drive.states, drive.counts[0], vehicle)
        store(c.states, 0, state)
        for i in range(steps):
            first = (speed - state[3]) / vehicle.dt
            second = (turn_in(bend, speed, vehicle) - state[4]) / vehicle.dt
            first, second = admissible(state, first, second, vehicle)
            c.controls[i, 0] = first
            c.controls[i, 1] = second
            state = step(state, first, second, vehicle)
            store(c.states, i + 1, state)
        if connection_is_free(drive, steps, vehicle, scene):
            return append(drive, steps)
    return False


@lean
def drive_arc(drive: Drive, gear: float, bend: float, metres: float, vehicle: Vehicle, scene: Scene) -> bool:
    """Turn the wheels at rest, then drive an arc from rest to rest, as quickly as obstacles allow."""
    c = drive.connection
    limit_1, limit_2 = control_limits(vehicle)
    if vehicle.min_speed > 0.0:
        return _drive_on(drive, bend, metres, vehicle, scene)
    before = drive.states[drive.counts[0], 4]
    turning = turn_wheels(drive, before if vehicle.first_order else bend, vehicle)
    if turning < 0:
        return False
    top = top_speed(gear, bend, vehicle)
    acceleration = limit_1
    if turn_in(bend, 0.0, vehicle) != bend:
        acceleration = min(limit_1, limit_2 / abs(curvature_of(bend, vehicle)))
    count = _list_limits(drive, gear, bend, metres, top, vehicle, scene)
    for slower in range(PACES):
        for i in range(count + 1):
            level = drive.levels[i]
            if i > 0:
                level = max(level, drive.levels[i - 1])
            if i < count:
                level = max(level, drive.levels[i + 1])
            drive.limits[i] = _pace(min(level + slower, PACES - 1), gear, top, vehicle)
        steps = fill_pace(c.speeds, drive.limits, count, metres, gear, acceleration, vehicle.dt)
        if steps < 0 or turning + steps > c.controls.shape[0]:
            return False
        state = load(c.states, turning, vehicle)
        for i in range(steps):
            first = (c.speeds[i + 1] - state[3]) / vehicle.dt
            second = (turn_in(bend, c.speeds[i + 1], vehicle) - state[4]) / vehicle.dt
            first = min(max(first, -limit_1), limit_1)
            second = min(max(second, -limit_2), limit_2)
            first, second = admissible(state, first, second, vehicle)
            c.controls[turning + i, 0] = first
            c.controls[turning + i, 1] = second
            state = step(state, first, second, vehicle)
            store(c.states, turning + i + 1, state)
        if connection_is_free(drive, turning + steps, vehicle, scene):
            return append(drive, turning + steps)
    return False


@lean
def drive_word(drive: Drive, word: int, vehicle: Vehicle, scene: Scene) -> bool:
    """Drive on over a word of the connection: in one go if it is free at some speed, else from arc to arc."""
    c = drive.connection
    at = drive.counts[0]
    at_rest = vehicle.first_order or drive.states[at, 3] == 0.0
    turning = turning_speed(vehicle)
    radius = radius_at(turning, vehicle)
    for share in (1.0, 0.5, 0.25):
        for k in range(c.states.shape[1]):
            c.states[0, k] = drive.states[at, k]
        top = share * turning
        if abs(radius_at(top, vehicle) - radius) > ROUNDING * radius:
            break
        steps = connect(c, word, drive.target, top, vehicle)
        if steps > 0 and connection_is_free(drive, steps, vehicle, scene):
            return append(drive, steps)
        if not at_rest:
            return False
    if not at_rest:
        return False
    bend = tightest_bend(turning, vehicle)
    for k in range(PARTS):
        metres = radius * c.words[word, PARTS + k]
        if abs(metres) > SMALLEST:
            gear = gear_of(metres)
            if not drive_arc(drive, gear, bend * c.words[word, k], abs(metres), vehicle, scene):
                return False
    return True
