"""Drives a stored sub-plan again, from a state that is not quite the one that it began with."""

from __future__ import annotations

import math
from typing import Final

from planners.memory.library.sub_plans import SubPlans
from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene, state_is_free
from planners.world.goal import X, Y, reaches
from planners.world.jit import inlined, lean
from planners.world.trigonometry import sincos, wrapped
from planners.world.vehicles.dynamics import (
    State,
    admissible,
    control_limits,
    curvature_of,
    load,
    step,
    store,
    turn_in,
)
from planners.world.vehicles.vehicle import Vehicle

Placing = tuple[float, float, float, float]  # where a sub-plan begins: x, y, heading; -1 if it is mirrored
NEAR_M: Final = 1.5  # on about this way a gap beside the sub-plan is closed
SLACK_M: Final = 0.2  # a vehicle farther behind or ahead of the sub-plan waits for it or skips a state
BLOCKED, ENDED, ARRIVED = range(3)  # how a drive along a sub-plan ended
SMALL: Final = 0.05  # a bend at which curvature is proportional to it


@inlined
def placing_for(subs: SubPlans, begin: int, end: int, side: float, start: State, goal: Floats) -> Placing:
    """Where a sub-plan begins that ends in the direction of the goal: at the start, turned a little."""
    states = subs.states
    dx = states[end, 0] - states[begin, 0]
    dy = states[end, 1] - states[begin, 1]
    bearing = side * (math.atan2(dy, dx) - states[begin, 2])
    return start[0], start[1], math.atan2(goal[Y] - start[1], goal[X] - start[0]) - bearing, side


@inlined
def put(subs: SubPlans, begin: int, at: int, placing: Placing, pose: Floats) -> None:
    """Write state ``at`` of a placed sub-plan that begins with state ``begin`` into ``pose [1, S]``."""
    x, y, heading, side = placing
    states = subs.states
    sin, cos = sincos(states[begin, 2])
    dx = states[at, 0] - states[begin, 0]
    dy = states[at, 1] - states[begin, 1]
    along = cos * dx + sin * dy
    across = side * (cos * dy - sin * dx)
    sin, cos = sincos(heading)
    pose[0, 0] = x + cos * along - sin * across
    pose[0, 1] = y + sin * along + cos * across
    pose[0, 2] = heading + side * (states[at, 2] - states[begin, 2])
    pose[0, 3] = states[at, 3]
    for k in range(4, states.shape[1]):
        pose[0, k] = side * states[at, k]


@lean
def drive_again(
    subs: SubPlans,
    begin: int,
    last: int,
    placing: Placing,
    goal: Floats,
    most: int,
    pose: Floats,
    states: Floats,
    controls: Floats,
    vehicle: Vehicle,
    scene: Scene,
) -> tuple[int, int]:
    """Drive along a placed sub-plan from ``states[0]``, and check every state.

    The stored controls are corrected by what closes the gap to the sub-plan. The drive goes on along the
    plan until it reaches the goal (``ARRIVED``), a state is blocked (``BLOCKED``), or state ``last`` of the
    plan is reached or ``most`` steps are driven (``ENDED``). Fills in ``states`` and ``controls``. Returns
    the steps, with the blocked one, and how the drive ended.
    """
    limit_1, limit_2 = control_limits(vehicle)
    bend = SMALL / curvature_of(SMALL, vehicle)  # for each unit of curvature
    state = load(states, 0, vehicle)
    at = begin
    for i in range(most):
        put(subs, begin, at, placing, pose)
        sin, cos = sincos(pose[0, 2])
        aside = cos * (state[1] - pose[0, 1]) - sin * (state[0] - pose[0, 0])
        turned = wrapped(state[2] - pose[0, 2])
        after = min(at + 1, last)
        put(subs, begin, after, placing, pose)
        wanted = load(pose, 0, vehicle)
        gear = 1.0 if wanted[3] >= 0.0 else -1.0
        closing = bend * (-aside / (NEAR_M * NEAR_M) - 2.0 * gear * turned / NEAR_M)
        turn = wanted[4] + turn_in(closing, wanted[3], vehicle)
        first = min(max((wanted[3] - state[3]) / vehicle.dt, -limit_1), limit_1)
        second = min(max((turn - state[4]) / vehicle.dt, -limit_2), limit_2)
        first, second = admissible(state, first, second, vehicle)
        state = step(state, first, second, vehicle)
        if not state_is_free(state, vehicle, scene):
            return i + 1, BLOCKED
        controls[i, 0] = first
        controls[i, 1] = second
        store(states, i + 1, state)
        if reaches(state, goal):
            return i + 1, ARRIVED
        if after == last:
            return i + 1, ENDED
        sin, cos = sincos(wanted[2])
        ahead = gear * (cos * (state[0] - wanted[0]) + sin * (state[1] - wanted[1]))
        if ahead > SLACK_M:
            at = min(at + 2, last)
        elif ahead > -SLACK_M:
            at = after
    return most, ENDED
