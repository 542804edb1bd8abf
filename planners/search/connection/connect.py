"""Drives a vehicle from a state to a goal pose, without looking at obstacles.

A word of turns says where to go. Its parts become a speed profile and ramps of the steering, which are
driven by the vehicle's own steps. That ends beside the goal, so the lengths of the parts are corrected until
it does not: a part that is a little longer moves what follows along its last direction, and turns it.
"""

from __future__ import annotations

import math
from typing import Final

from planners.search.connection.connection import (
    Connection,
    braking_seconds,
    heading_at,
    last_speed,
    lead_of,
    radius_at,
    straight_speed,
)
from planners.search.connection.profile import fill_limited, fill_run
from planners.search.connection.words import PARTS
from planners.world.arrays import Floats
from planners.world.driving_cost import gear_of
from planners.world.goal import HEADING_TOLERANCE, MOST_TURN, RADIUS, X, Y, reaches
from planners.world.jit import inlined, lean
from planners.world.trigonometry import length, sincos, wrapped
from planners.world.vehicles.dynamics import (
    admissible,
    bend_of,
    bend_rate,
    control_limits,
    curvature_of,
    load,
    step,
    store,
    tightest_bend,
    turn_in,
)
from planners.world.vehicles.vehicle import Vehicle

CORRECTIONS: Final = 8  # of a word's lengths
CLOSER: Final = 0.7  # a correction that leaves more of the error than this may happen once
AIMED: Final = 0.5  # the share of the tolerances that the end is brought within
DAMPING: Final = 1e-6  # metres squared
SHORT: Final = 0.1  # radii between two places of a run at which its limits are known ...
FEWEST: Final = 16  # ... if these are not fewer
SMALLEST_BEND: Final = 1e-9  # 1/m
ROOM: Final = 2.0  # of an arc's length: what is driven until it bends, on average, has to fit in ...
FIRST_ROOM: Final = 0.5  # ... or in so much of it if it begins at rest
GEAR, BEND, LENGTH, TIME = range(4)  # rows of ``Connection.parts``


@inlined
def _share_of_bend(metres: float, top: float, bend: float, from_rest: bool, vehicle: Vehicle) -> float:
    """How much of a ``bend`` an arc gets that is too short to bend so: it is gentler then, and longer."""
    seconds = 0.5 * bend / bend_rate(top, vehicle)  # until it bends, on average
    if not from_rest:
        return min(math.sqrt(ROOM * metres / (top * seconds)), 1.0)
    at_full_speed = math.sqrt(FIRST_ROOM * metres / (top * seconds))
    gaining = 2.0 * FIRST_ROOM * FIRST_ROOM * metres / (control_limits(vehicle)[0] * seconds * seconds)
    return float(min(max(at_full_speed, gaining ** (1.0 / 3.0)), 1.0))


@lean
def _take(c: Connection, number: int, top: float, vehicle: Vehicle) -> int:
    """Copy a word into ``c.parts``, and return how many parts it has. Short arcs become gentler."""
    radius, bend = radius_at(top, vehicle), tightest_bend(top, vehicle)
    speed = c.states[0, 3]
    count = 0
    gear = 0.0
    for k in range(PARTS):
        metres = radius * c.words[number, PARTS + k]
        if metres != 0.0:
            gear = gear_of(metres)
            metres = abs(metres)
            share = 1.0
            if c.words[number, k] != 0.0 and (count > 0 or speed == 0.0):
                share = _share_of_bend(metres, top, bend, count == 0, vehicle)
            c.parts[GEAR, count] = gear
            c.parts[BEND, count] = share * bend * c.words[number, k]
            c.parts[LENGTH, count] = metres / share
            count += 1
    return count


@lean
def _list_limits(
    c: Connection, k: int, metres: float, lead: float, top: float, straight: float, radius: float
) -> int:
    """Fill in how fast a run is driven at each place, ``top`` in arcs; returns how many follow the first.

    The run is ``metres`` long and begins with ``lead`` metres before part ``k``; arcs have this ``radius``.
    """
    count = min(max(math.ceil(metres / (SHORT * radius)), FEWEST), c.limits.shape[0] - 1)
    part = k
    end = lead + c.parts[LENGTH, k]
    for i in range(count + 1):
        way = i * metres / count
        while way > end and part + 1 < PARTS:
            part += 1
            end += c.parts[LENGTH, part]
        bends = way >= lead and c.parts[BEND, part] != 0.0
        c.limits[i] = min(top, straight) if bends else straight
    return count


@lean
def _plan_speeds(c: Connection, count: int, lead: float, goal: Floats, top: float, vehicle: Vehicle) -> int:
    """Fill in the speeds, and when each part ends. Returns the steps; -1 if that is not possible."""
    acceleration, turning = control_limits(vehicle)
    parts = c.parts
    straight = straight_speed(top, vehicle)
    at = 0
    k = 0
    while k < count:
        gear = parts[GEAR, k]
        metres = lead if k == 0 else 0.0
        covered = 0.0
        end = k
        while end < count and parts[GEAR, end] == gear:
            metres += parts[LENGTH, end]
            end += 1
        fastest = straight if gear > 0.0 else min(straight, -vehicle.min_speed)
        begin = gear * c.states[0, 3] if k == 0 else 0.0
        last = 0.0
        if end == count:
            if goal[MOST_TURN] < math.inf:  # then the turn has to end as the speed does
                curvature = abs(curvature_of(parts[BEND, count - 1], vehicle))
                acceleration = min(acceleration, turning / max(curvature, SMALLEST_BEND))
            last = min(last_speed(gear, begin, metres, goal, acceleration), fastest)
        if fastest > top and metres > 0.0:
            if end == count and parts[BEND, end - 1] != 0.0:
                last = min(last, top)
            places = _list_limits(
                c, k, metres, lead if k == 0 else 0.0, top, fastest, radius_at(top, vehicle)
            )
            after = fill_limited(
                *(c.speeds, at, c.limits, places, metres, begin, last, gear, acceleration, vehicle.dt)
            )
        else:
            after = fill_run(c.speeds, at, metres, begin, last, fastest, gear, acceleration, vehicle.dt)
        if after < 0:
            return -1
        mark = lead if k == 0 else 0.0
        while k < end:
            mark += parts[LENGTH, k]
            share = 0.0
            while at < after:
                way = 0.5 * vehicle.dt * abs(c.speeds[at] + c.speeds[at + 1])
                if covered + way >= mark and k < end - 1:
                    share = (mark - covered) / way if way > 0.0 else 0.0
                    break
                covered += way
                at += 1
            parts[TIME, k] = (at + share) * vehicle.dt
            k += 1
        at = after
    return at


@lean
def _drive(c: Connection, count: int, steps: int, top: float, vehicle: Vehicle) -> None:
    """Drive ``c.parts`` with the speeds of ``c.speeds``."""
    state = load(c.states, 0, vehicle)
    rate = bend_rate(top, vehicle)
    braking = braking_seconds(state, top, vehicle)
    begin = bend_of(state, vehicle)
    bend = begin
    for k in range(count):
        change = c.parts[BEND, k] - bend
        bend = c.parts[BEND, k]
        seconds = max(abs(change) / rate, vehicle.dt)  # in less than a step it would jump
        c.ramps[k, 0] = change
        c.ramps[k, 1] = braking + 0.5 * seconds if k == 0 else max(c.parts[TIME, k - 1], 0.5 * seconds)
        c.ramps[k, 2] = 1.0 / seconds
    limit_1, limit_2 = control_limits(vehicle)
    for i in range(steps):
        time = (i + 1) * vehicle.dt
        bend = begin
        for k in range(count):
            bend += c.ramps[k, 0] * min(max((time - c.ramps[k, 1]) * c.ramps[k, 2] + 0.5, 0.0), 1.0)
        turn = turn_in(bend, c.speeds[i + 1], vehicle)
        first = min(max((c.speeds[i + 1] - state[3]) / vehicle.dt, -limit_1), limit_1)
        second = min(max((turn - state[4]) / vehicle.dt, -limit_2), limit_2)
        first, second = admissible(state, first, second, vehicle)
        c.controls[i, 0] = first
        c.controls[i, 1] = second
        state = step(state, first, second, vehicle)
        store(c.states, i + 1, state)


@lean
def _correct(
    c: Connection, count: int, steps: int, dx: float, dy: float, turn: float, vehicle: Vehicle
) -> None:
    """Change the lengths by the least that moves the end by (dx, dy) and turns it."""
    states, effects = c.states, c.effects
    end_x = states[steps, 0]
    end_y = states[steps, 1]
    for k in range(count):
        at = c.parts[TIME, k] / vehicle.dt
        i = min(int(at), steps - 1)
        share = at - i
        x = states[i, 0] + share * (states[i + 1, 0] - states[i, 0])
        y = states[i, 1] + share * (states[i + 1, 1] - states[i, 1])
        sin, cos = sincos(states[i, 2] + share * (states[i + 1, 2] - states[i, 2]))
        gear = c.parts[GEAR, k]
        turned = gear * curvature_of(c.parts[BEND, k], vehicle)
        effects[0, k] = gear * cos - turned * (end_y - y)
        effects[1, k] = gear * sin + turned * (end_x - x)
        effects[2, k] = turned
    a00 = a01 = a02 = a11 = a12 = a22 = 0.0
    for k in range(count):
        a00 += effects[0, k] * effects[0, k]
        a01 += effects[0, k] * effects[1, k]
        a02 += effects[0, k] * effects[2, k]
        a11 += effects[1, k] * effects[1, k]
        a12 += effects[1, k] * effects[2, k]
        a22 += effects[2, k] * effects[2, k]
    a00 += DAMPING
    a11 += DAMPING
    a22 += DAMPING
    c00 = a11 * a22 - a12 * a12
    c01 = a02 * a12 - a01 * a22
    c02 = a01 * a12 - a02 * a11
    determinant = a00 * c00 + a01 * c01 + a02 * c02
    p = (c00 * dx + c01 * dy + c02 * turn) / determinant
    q = (c01 * dx + (a00 * a22 - a02 * a02) * dy + (a01 * a02 - a00 * a12) * turn) / determinant
    r = (c02 * dx + (a01 * a02 - a00 * a12) * dy + (a00 * a11 - a01 * a01) * turn) / determinant
    for k in range(count):
        metres = c.parts[LENGTH, k] + effects[0, k] * p + effects[1, k] * q + effects[2, k] * r
        if metres < 0.0:
            c.parts[BEND, k] = -c.parts[BEND, k]
            metres = -metres if c.parts[BEND, k] != 0.0 else 0.0
        c.parts[LENGTH, k] = metres


@lean
def _drive_word(
    c: Connection, count: int, lead: float, heading: float, goal: Floats, top: float, vehicle: Vehicle
) -> int:
    """Drive ``c.parts`` and correct them until the goal is reached. Returns the steps; 0 if it is not."""
    before = math.inf
    failed = 0
    for _ in range(CORRECTIONS):
        steps = _plan_speeds(c, count, lead, goal, top, vehicle)
        if steps < 1:
            return 0
        _drive(c, count, steps, top, vehicle)
        dx = goal[X] - c.states[steps, 0]
        dy = goal[Y] - c.states[steps, 1]
        turn = wrapped(heading - c.states[steps, 2])
        if length(dx, dy) <= AIMED * goal[RADIUS] and abs(turn) <= AIMED * goal[HEADING_TOLERANCE]:
            return steps if reaches(load(c.states, steps, vehicle), goal) else 0
        error = length(dx, dy) + abs(turn)
        if error > CLOSER * before:
            failed += 1
            if failed == 2:
                return 0
        before = error
        _correct(c, count, steps, dx, dy, turn, vehicle)
    return 0


@lean
def connect(c: Connection, word: int, goal: Floats, top: float, vehicle: Vehicle) -> int:
    """Drive from ``c.states[0]`` to a goal by a word.

    Args:
        c: buffers after ``list_connections``.
        word: its number.
        goal: that of ``goal_of``, as before.
        top: the largest speed in m/s, as before.
        vehicle: what is driven.

    Returns:
        The steps of the drive in ``c.states`` and ``c.controls``; 0 if the word does not lead to the goal.
    """
    state = load(c.states, 0, vehicle)
    parts = _take(c, word, top, vehicle)
    return _drive_word(c, parts, lead_of(state, top, vehicle), heading_at(state, goal), goal, top, vehicle)
