"""The estimated driving time to a goal: around obstacles for a place, as if there were none for a pose."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from planners.search.connection.pose_table import seconds_from, seconds_to_pose
from planners.search.structures.cost_to_go import CostToGo, metres_to_go
from planners.world.arrays import Floats
from planners.world.goal import HEADING, HEADING_TOLERANCE, MOST_SPEED, RADIUS, X, Y
from planners.world.jit import inlined, lean
from planners.world.trigonometry import sincos
from planners.world.vehicles.dynamics import State, control_limits, load
from planners.world.vehicles.vehicle import Vehicle

LOOK_AHEAD_M: Final = 2.0  # from here to there the distance to go tells whether the heading is right
NO_TABLE = np.empty((0, 0, 0))


class Ahead(NamedTuple):
    """What is known of the way to a goal."""

    go: CostToGo
    goal: Floats  # that of ``goal_of``
    table: Floats  # that of ``seconds_to_pose``; empty if any heading will do


def ahead_of(goal: Floats, go: CostToGo, vehicle: Vehicle) -> Ahead:
    """Join what is known; ``go`` is filled in later."""
    asks = goal[HEADING_TOLERANCE] < math.inf
    return Ahead(go, goal, seconds_to_pose(vehicle) if asks else NO_TABLE)


@inlined
def _seconds_to_stop(
    speed: float, metres: float, room: float, most: float, late_s: float, vehicle: Vehicle
) -> float:
    """The least time over a distance, or up to ``room`` metres more, from one speed to at most another.

    A vehicle that is too fast for that brakes, and has to come back: ``late_s`` for each metre.
    """
    acceleration = control_limits(vehicle)[0]
    braking = (speed * speed - most * most) / (2.0 * acceleration)
    metres = min(max(braking, metres), metres + room)
    squares = speed * speed + 2.0 * acceleration * metres
    end = min(most, math.sqrt(squares))
    if braking > metres:
        return (abs(speed) - most) / acceleration + late_s * (braking - metres)
    peak = min(math.sqrt(0.5 * (squares + end * end)), vehicle.max_speed)
    changing = (2.0 * peak * peak - speed * speed - end * end) / (2.0 * acceleration)
    return (2.0 * peak - speed - end) / acceleration + max(metres - changing, 0.0) / vehicle.max_speed


@inlined
def way_to_go(state: State, go: CostToGo) -> tuple[float, float]:
    """The metres to go, and 1 - cos of the angle to turn by before the way goes straight ahead."""
    metres = metres_to_go(state[0], state[1], go)
    sin, cos = sincos(state[2])
    after = metres_to_go(state[0] + LOOK_AHEAD_M * cos, state[1] + LOOK_AHEAD_M * sin, go)
    return metres, min(max(1.0 - (metres - after) / LOOK_AHEAD_M, 0.0), 2.0)


@lean
def way_from(states: Floats, go: CostToGo, vehicle: Vehicle) -> tuple[float, float]:
    """``way_to_go`` from the first of ``states [T, S]``, for callers that are not compiled themselves."""
    return way_to_go(load(states, 0, vehicle), go)


@inlined
def seconds_to_go(state: State, ahead: Ahead, turn_s: float, late_s: float, vehicle: Vehicle) -> float:
    """The estimated driving time to the goal, in seconds.

    Args:
        state: from which to drive.
        ahead: what is known of the way.
        turn_s: time for each unit of 1 - cos of the angle to turn by before the way goes straight ahead.
        late_s: time for each metre by which braking for the goal comes too late.
        vehicle: what is driven.
    """
    goal, go = ahead.goal, ahead.go
    metres, turn = way_to_go(state, go)
    missing = vehicle.max_speed - state[3]
    acceleration = control_limits(vehicle)[0]
    slow = missing * missing / (2.0 * acceleration * vehicle.max_speed)
    if goal[MOST_SPEED] < vehicle.max_speed:
        most = max(goal[MOST_SPEED], 0.0)
        seconds = _seconds_to_stop(state[3], metres, goal[RADIUS], most, late_s, vehicle)
    else:
        seconds = metres / vehicle.max_speed + slow
    seconds += turn_s * turn
    if ahead.table.shape[0] > 0:
        pose = goal[X], goal[Y], goal[HEADING]
        rest = seconds_from(state[0], state[1], state[2], pose, ahead.table, vehicle.max_speed)
        seconds = max(seconds, rest + slow - 0.5 * vehicle.max_speed / acceleration)
    return float(seconds)


@lean
def expected_seconds(states: Floats, ahead: Ahead, turn_s: float, late_s: float, vehicle: Vehicle) -> float:
    """``seconds_to_go`` from the first of ``states [T, S]``, for callers that are not compiled themselves."""
    return seconds_to_go(load(states, 0, vehicle), ahead, turn_s, late_s, vehicle)
