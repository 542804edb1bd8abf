"""The words by which a state may be connected to a goal, the cheapest first."""

from __future__ import annotations

import math
from typing import Final

from planners.search.connection.connection import (
    Connection,
    chooses_pace,
    first_pose,
    heading_at,
    last_speed,
    lead_of,
    radius_at,
    straight_speed,
)
from planners.search.connection.dubins import list_forward_words
from planners.search.connection.profile import run_seconds
from planners.search.connection.words import PARTS, list_words
from planners.world.arrays import Floats, Pose
from planners.world.driving_cost import cost_of_second, extra_cost, gear_of
from planners.world.goal import X, Y
from planners.world.jit import inlined, lean
from planners.world.trigonometry import sincos, wrapped
from planners.world.vehicles.dynamics import control_limits, load
from planners.world.vehicles.vehicle import Vehicle


@lean
def word_seconds(
    word: Floats,
    radius: float,
    lead: float,
    before: float,
    speed: float,
    goal: Floats,
    top: float,
    vehicle: Vehicle,
) -> float:
    """What a word costs to drive, in seconds; infinite if the speed at its ends does not allow it.

    ``before`` is above 0 if the vehicle has driven forwards so far, below 0 if backwards, 0 if not at all.
    """
    acceleration = control_limits(vehicle)[0]
    straight = straight_speed(top, vehicle)
    seconds = 0.0
    k = 0
    while k < PARTS and word[PARTS + k] == 0.0:
        k += 1
    first = True
    while k < PARTS:
        gear = gear_of(word[PARTS + k])
        metres = 0.0
        bent = 0.0
        while k < PARTS and gear * word[PARTS + k] >= 0.0:
            metres += radius * abs(word[PARTS + k])
            if word[k] != 0.0:
                bent += radius * abs(word[PARTS + k])
            k += 1
        begin = 0.0
        if first:
            begin = gear * speed
            metres += lead
            if begin < 0.0:
                return math.inf
        first = False
        fastest = straight if gear > 0.0 else min(straight, -vehicle.min_speed)
        if fastest <= 0.0:
            return math.inf
        end = 0.0
        if k == PARTS:
            end = min(last_speed(gear, begin, metres, goal, acceleration), fastest)
            if end < 0.0:
                return math.inf
        run = run_seconds(metres, begin, end, fastest, acceleration)
        seconds += run + extra_cost(before, gear, run, vehicle)
        before = gear
        if top < fastest:  # about as much longer as arcs take
            reached = min(fastest, math.sqrt(acceleration * metres + 0.5 * (begin * begin + end * end)))
            seconds += cost_of_second(gear, vehicle) * bent * max(1.0 / top - 1.0 / reached, 0.0)
    return seconds


@inlined
def _in_radii(start: Pose, end: Pose, radius: float) -> Pose:
    """A pose as it is seen from another one, in radii of turning."""
    dx = (end[0] - start[0]) / radius
    dy = (end[1] - start[1]) / radius
    sin, cos = sincos(start[2])
    return dx * cos + dy * sin, dy * cos - dx * sin, wrapped(end[2] - start[2])


PACES: Final = 7  # that a vehicle that cannot reverse chooses from, each half as quick as the one before


@lean
def list_words_between(start: Pose, end: Pose, radius: float, words: Floats, vehicle: Vehicle) -> int:
    """List the words from a pose to another one that a vehicle can drive with this radius (m).

    Returns how many there are in ``words [MOST_WORDS, 2 PARTS]``.
    """
    x, y, turn = _in_radii(start, end, radius)
    if vehicle.min_speed >= 0.0:
        return list_forward_words(x, y, turn, words)
    return list_words(x, y, turn, words)


@lean
def list_forward_words_between(start: Pose, end: Pose, radius: float, words: Floats) -> int:
    """As ``list_words_between``, forwards only, in three arcs each."""
    x, y, turn = _in_radii(start, end, radius)
    return list_forward_words(x, y, turn, words)


@lean
def list_connections(c: Connection, before: float, goal: Floats, top: float, vehicle: Vehicle) -> int:
    """List the words that may lead from ``c.states[0]`` to a goal.

    Args:
        c: buffers, the first state filled in.
        before: above 0 if the vehicle has driven forwards so far, below 0 if backwards, 0 if not at all.
        goal: that of ``goal_of``.
        top: the largest speed in m/s. At a smaller one a vehicle may turn more sharply.
        vehicle: what is driven.

    Returns:
        How many words there are in ``c.words``. ``c.seconds`` estimates what each costs.
    """
    state = load(c.states, 0, vehicle)
    x, y, heading = first_pose(state, top, vehicle)
    radius = radius_at(top, vehicle)
    there = (goal[X], goal[Y], heading_at(state, goal))
    count = list_words_between((x, y, heading), there, radius, c.words, vehicle)
    lead = lead_of(state, top, vehicle)
    for i in range(count):
        c.seconds[i] = word_seconds(c.words[i], radius, lead, before, state[3], goal, top, vehicle)
    return count


@lean
def best_pace(c: Connection, before: float, goal: Floats, top: float, vehicle: Vehicle) -> float:
    """The largest speed in arcs with which a goal is reached soonest: ``top``, or less.

    Few words lead forwards alone. A vehicle that cannot reverse, but turns more sharply when it is slower, is
    there sooner so than once round a wide circle. Arguments as of ``list_connections``.
    """
    if not chooses_pace(vehicle):
        return top
    best = pace = top
    least = math.inf
    for k in range(PACES):
        if k == 0 or pace >= abs(c.states[0, 3]):
            for i in range(list_connections(c, before, goal, pace, vehicle)):
                if c.seconds[i] < least:
                    best = pace
                    least = c.seconds[i]
        pace *= 0.5
    return best


@inlined
def next_word(c: Connection, count: int, within_s: float) -> int:
    """Take the cheapest of the first ``count`` words; -1 if all that are left cost ``within_s`` or more."""
    best = -1
    least = within_s
    for i in range(count):
        if c.seconds[i] < least:
            best = i
            least = c.seconds[i]
    if best >= 0:
        c.seconds[best] = math.inf
    return best
