"""What is known at the beginning of a connection: its buffers, where a word begins and how it may end."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from planners.search.connection.words import MOST_WORDS, PARTS
from planners.world.arrays import Floats
from planners.world.goal import HEADING, HEADING_TOLERANCE, LEAST_SPEED, MOST_SPEED, X, Y
from planners.world.jit import inlined, lean
from planners.world.trigonometry import angle_to, sincos
from planners.world.vehicles.dynamics import (
    State,
    bend_of,
    bend_rate,
    control_limits,
    curvature_of,
    tightest_bend,
    turning_speed,
)
from planners.world.vehicles.vehicle import Vehicle

STEPS: Final = 1000  # of a drive at most
PLACES: Final = 512  # of a run at most, at which its limits are known
SHY: Final = 1e-6  # m/s within the speeds that are asked for, because of rounding
ANY: Final = 10.0  # radians; a tolerance above this means any heading


class Connection(NamedTuple):
    """Buffers for one connection at a time. Its drive lies in ``states`` and ``controls``."""

    states: Floats  # [STEPS + 1, S]
    controls: Floats  # [STEPS, 2]
    speeds: Floats  # [STEPS + 1] m/s
    limits: Floats  # [PLACES + 1] m/s, at places equally far from one another along a run
    words: Floats  # [MOST_WORDS, 2 PARTS]
    seconds: Floats  # [MOST_WORDS] what each word costs, by an estimate
    parts: Floats  # [4, PARTS] gear (1 or -1); bend; length in metres; when the part ends, in seconds
    ramps: Floats  # [PARTS, 3] from a bend to the next: the change; when it is half done (s); 1 / duration
    effects: Floats  # [3, PARTS] how the end's x, y and heading change with each part's length


def allocate_connection(state_size: int) -> Connection:
    """Buffers for states of ``state_size`` numbers."""
    return Connection(
        np.zeros((STEPS + 1, state_size)),
        np.zeros((STEPS, 2)),
        np.zeros(STEPS + 1),
        np.zeros(PLACES + 1),
        np.zeros((MOST_WORDS, 2 * PARTS)),
        np.zeros(MOST_WORDS),
        np.zeros((4, PARTS)),
        np.zeros((PARTS, 3)),
        np.zeros((3, PARTS)),
    )


@inlined
def last_speed(gear: float, first: float, metres: float, goal: Floats, acceleration: float) -> float:
    """The speed to arrive with in a gear, from ``first`` m/s; negative if the goal allows none."""
    inside = min(SHY, 0.5 * (goal[MOST_SPEED] - goal[LEAST_SPEED]))
    least = inside + (goal[LEAST_SPEED] if gear > 0.0 else -goal[MOST_SPEED])
    most = (goal[MOST_SPEED] if gear > 0.0 else -goal[LEAST_SPEED]) - inside
    return float(min(most, max(math.sqrt(first * first + 2.0 * acceleration * metres), least)))


@inlined
def lead_of(state: State, top: float, vehicle: Vehicle) -> float:
    """How far a state drives, in metres, before it bends as the first part does, on average.

    A vehicle that is too fast to bend so brakes first, a slower one gains speed.
    """
    speed = abs(state[3])
    if speed == 0.0:
        return 0.0  # it may drive off in either gear
    acceleration = control_limits(vehicle)[0]
    braking = braking_seconds(state, top, vehicle)
    slowed = speed - acceleration * braking
    bending = 0.5 * tightest_bend(top, vehicle) / bend_rate(top, vehicle)
    gaining = min(max((top - slowed) / acceleration, 0.0), bending)
    ahead = slowed * bending + acceleration * gaining * (bending - 0.5 * gaining)
    return ahead + 0.5 * (speed + slowed) * braking


@inlined
def braking_seconds(state: State, top: float, vehicle: Vehicle) -> float:
    """How long a state brakes, in seconds, before lateral acceleration lets it drive arcs of words."""
    if turning_speed(vehicle) == vehicle.max_speed:
        return 0.0
    return max(abs(state[3]) - top, 0.0) / control_limits(vehicle)[0]


@inlined
def radius_at(top: float, vehicle: Vehicle) -> float:
    """The radius of the arcs of a word, in metres, if no speed is larger than ``top`` (m/s)."""
    return float(1.0 / curvature_of(tightest_bend(top, vehicle), vehicle))


@lean
def chooses_pace(vehicle: Vehicle) -> bool:
    """Whether arcs of words may be driven slowly: by what cannot reverse, and turns more sharply then."""
    fastest = turning_speed(vehicle)
    return vehicle.min_speed == 0.0 and radius_at(0.5 * fastest, vehicle) < radius_at(fastest, vehicle)


@inlined
def straight_speed(top: float, vehicle: Vehicle) -> float:
    """The largest speed (m/s) on the straight parts of a word whose arcs are driven with up to ``top``."""
    turning = turning_speed(vehicle)
    if turning > top and chooses_pace(vehicle):
        return vehicle.max_speed
    if turning == vehicle.max_speed:
        return top
    return min(top * vehicle.max_speed / turning, vehicle.max_speed)


@inlined
def heading_at(state: State, goal: Floats) -> float:
    """The heading to arrive with: if any will do, that of the straight way."""
    if goal[HEADING_TOLERANCE] < ANY:
        return float(goal[HEADING])
    return angle_to(goal[X] - state[0], goal[Y] - state[1])


@inlined
def first_pose(state: State, top: float, vehicle: Vehicle) -> tuple[float, float, float]:
    """Where a word begins that is driven from a state: x, y (m) and heading (rad), a little ahead of it."""
    lead = lead_of(state, top, vehicle)
    way = lead if state[3] >= 0.0 else -lead
    turn = way * curvature_of(bend_of(state, vehicle), vehicle)
    sin, cos = sincos(state[2] + 0.5 * turn)
    return state[0] + way * cos, state[1] + way * sin, state[2] + turn


@inlined
def word_speed(pace: float, goal: Floats, vehicle: Vehicle) -> float:
    """The largest speed (m/s) in arcs of words, at a share of the quickest ``pace``.

    Where lateral acceleration limits that of the sharpest arcs, it is at least what the goal asks for.
    """
    top = pace * turning_speed(vehicle)
    if turning_speed(vehicle) < vehicle.max_speed:
        top = max(top, min(goal[LEAST_SPEED] + SHY, vehicle.max_speed))
    return top
