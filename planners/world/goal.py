"""What is asked at the end of a drive, as an array for kernels, and whether a state is what is asked."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from planners.world.arrays import Floats
from planners.world.jit import inlined
from planners.world.problem import POSE_RADIUS, POSE_TOLERANCE, Arrival, Problem
from planners.world.trigonometry import length, wrapped
from planners.world.vehicles.dynamics import State
from planners.world.vehicles.vehicle import FIRST_HITCH, DifferentialDrive, Vehicle

# of a goal [8 + 2 n]; then follow angle and tolerance (radians) of each hitch that counts
X, Y, RADIUS, HEADING, HEADING_TOLERANCE, LEAST_SPEED, MOST_SPEED, MOST_TURN, HITCHES = range(9)
SLACK: Final = 1e-9  # m/s, rad/s and radians: what sums of controls round away


def place(x: float, y: float, radius: float) -> Floats:
    """Make the goal ``[8]`` of getting into a disc (metres), with any heading and motion."""
    return np.array([x, y, radius, 0.0, math.inf, -math.inf, math.inf, math.inf])


def must_not_turn(arrival: Arrival, vehicle: Vehicle) -> bool:
    """Whether a vehicle is to be at rest that has a turn rate which takes time to change."""
    return isinstance(vehicle, DifferentialDrive) and not vehicle.first_order and arrival.is_rest


def goal_of(problem: Problem, vehicle: Vehicle) -> Floats:
    """Return what a problem asks of a vehicle at its end, ``[8 + 2 n]`` with n hitch angles."""
    goal = place(*problem.goal, problem.goal_radius)
    arrival = problem.arrival
    if arrival is None:
        return goal
    if arrival.heading is not None:
        goal[HEADING : HEADING_TOLERANCE + 1] = arrival.heading, arrival.heading_tolerance + SLACK
    goal[LEAST_SPEED : MOST_SPEED + 1] = arrival.least_speed - SLACK, arrival.most_speed + SLACK
    if must_not_turn(arrival, vehicle):
        goal[MOST_TURN] = SLACK
    hitches = [
        (hitch, tolerance + SLACK)
        for hitch, tolerance in zip(arrival.hitches, arrival.hitch_tolerances, strict=True)
    ]
    return np.concatenate([goal, np.array(hitches).reshape(-1)])


@inlined
def metres_to(state: State, goal: Floats) -> float:
    """The distance from a state to the goal disc, negative inside."""
    return float(length(state[0] - goal[X], state[1] - goal[Y]) - goal[RADIUS])


@inlined
def reaches(state: State, goal: Floats) -> bool:
    """Whether a state is what is asked for at the end."""
    if metres_to(state, goal) > 0.0:
        return False
    if not (goal[LEAST_SPEED] <= state[3] <= goal[MOST_SPEED]):
        return False
    if abs(state[4]) > goal[MOST_TURN]:
        return False
    if abs(wrapped(state[2] - goal[HEADING])) > goal[HEADING_TOLERANCE]:
        return False
    for k in range((goal.shape[0] - HITCHES) // 2):
        if abs(state[FIRST_HITCH + k] - goal[HITCHES + 2 * k]) > goal[HITCHES + 2 * k + 1]:
            return False
    return True


@inlined
def asks_for_more(goal: Floats) -> bool:
    """Whether a goal asks for a heading or a speed, besides the place."""
    return bool(
        goal[HEADING_TOLERANCE] < math.inf or goal[LEAST_SPEED] > -math.inf or goal[MOST_SPEED] < math.inf
    )


def goal_of_pose(x: float, y: float, heading: float) -> Floats:
    """Make the goal ``[8]`` of standing at a pose (metres, radians), with the usual tolerances."""
    return np.array([x, y, POSE_RADIUS, heading, POSE_TOLERANCE, -SLACK, SLACK, math.inf])
