"""Drives along a plan: back to it from beside it, and around what has come to stand on it."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from typing import Final

import numpy as np

from planners.optimisation.descent import arrives, steps_to_goal
from planners.optimisation.following import follow
from planners.optimisation.local_model import allocate_model
from planners.optimisation.polish import ROOM, polish_guesses
from planners.search.braking import count_closely_free, is_free_closely, is_free_drive
from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene
from planners.world.goal import (
    HEADING_TOLERANCE,
    HITCHES,
    LEAST_SPEED,
    MOST_SPEED,
    MOST_TURN,
    RADIUS,
    goal_of,
)
from planners.world.problem import Arrival, Plan, Problem, starting_at
from planners.world.vehicles.dynamics import control_limits, simulate
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace

ROUNDING: Final = 1e-9  # at the goal: metres, m/s and radians
LATER: Final = (0, 2, 5)  # steps by which a drive along a plan may reach the goal later than the plan
FULL_CONTROLS: Final = (0.3, 1.0)  # metres or radians off the plan, as heavy as one: tight, then gentle
MOST_BLOCKS: Final = 4  # on a plan that a drive is led around
AROUND: Final = (10, 20, 40)  # steps before and behind what blocks a plan in which a drive may leave it
SOONER: Final = 5  # steps by which the next may come sooner than on the plan
NEAR_M: Final = 0.1  # how near it has to come back to it
NEAR_HEADING: Final = 0.03  # radians
NEAR_HITCH: Final = 0.1


def driven_along(
    plan: Plan, start: Floats, goal: Floats, vehicle: Vehicle, scene: Scene, workspace: Workspace
) -> Plan:
    """Drive along a plan from a state ``start [S]`` beside it, up to where the plan reaches the goal.

    The drive may be blocked or not reach the goal, if no other does that is tried.
    """
    reached = int(steps_to_goal(plan.states, len(plan.controls), goal, vehicle))
    most, last = control_limits(vehicle), reached if reached >= 0 else len(plan.controls)
    turns = start[2] - plan.states[0, 2]
    turns -= math.remainder(turns, math.tau)
    best, along = None, plan
    longest = last + max(LATER)
    model = workspace.buffers(allocate_model, ROOM * (1 + longest // ROOM), len(start))
    model.states[: last + 1] = plan.states[: last + 1]
    model.states[last + 1 : longest + 1] = plan.states[last]
    model.states[: longest + 1, 2] += turns
    model.states[0] = start
    model.controls[:last] = plan.controls[:last]
    model.controls[last:longest] = 0.0
    for later, full_control in product(LATER if reached >= 0 else (0,), FULL_CONTROLS):
        steps = last + later
        follow(model, steps, goal, full_control, vehicle)
        controls = np.clip(model.tried_controls[:steps], np.negative(most), most)
        along = Plan(simulate(start, controls, vehicle), controls, vehicle.dt)
        if arrives(along.states[-1], goal, vehicle):
            best = best or along
            if is_free_closely(along, vehicle, scene):
                return along
    return best or along


def led_around(
    along: Plan, problem: Problem, vehicle: Vehicle, scene: Scene, workspace: Workspace, until: float
) -> Plan:
    """A drive along a plan that leaves it where it is blocked and comes back to it, if that is found soon."""
    for _ in range(MOST_BLOCKS):
        free = count_closely_free(along, vehicle, scene)
        if free == len(along.states):
            break
        better = _led_around_one(along, free, problem, (vehicle, scene, workspace), until)
        if better is None:
            break
        along = better
    return along


def _led_around_one(
    along: Plan,
    free: int,
    problem: Problem,
    around: tuple[Vehicle, Scene, Workspace],
    until: float,
) -> Plan | None:
    """A drive around the first thing that blocks a drive, of whose states so many are ``free`` before."""
    states, controls, (vehicle, scene, _) = along.states, along.controls, around
    last = free + 1  # the step to it may be blocked alone
    while last < len(states) - 1 and not is_free_drive(states[last : last + 1], vehicle, scene):
        last += 1
    rest = Plan(states[last:], controls[last:], vehicle.dt)
    next_blocked = last + count_closely_free(rest, vehicle, scene)
    goal = rounded_goal(goal_of(problem, vehicle))
    for steps in AROUND:
        begin, end = max(free - steps, 0), last + steps
        if end >= len(controls):
            break
        there = _coming_by(states[end], starting_at(problem, states[begin]))
        guess = Plan(states[begin : end + 1], controls[begin:end], vehicle.dt)
        leaving = polish_guesses(there, [guess], *around, until)[1].plan
        if leaving is None:
            continue
        behind = Plan(states[end:], controls[end:], vehicle.dt)
        behind = driven_along(behind, leaving.states[-1], goal, *around)
        joined = np.concatenate((controls[:begin], leaving.controls, behind.controls))
        mended = Plan(simulate(states[0], joined, vehicle), joined, vehicle.dt)
        beyond = count_closely_free(mended, vehicle, scene) - (begin + len(leaving.controls))
        comes_back = beyond >= next_blocked - end - SOONER
        if next_blocked == len(states):
            comes_back &= arrives(mended.states[-1], goal, vehicle)
        if comes_back:
            return mended
    return None


def _coming_by(state: Floats, problem: Problem) -> Problem:
    """The problem of coming by near a ``state [S]``, as fast, from where a problem starts."""
    x, y, heading, speed, _, *hitches = state.tolist()
    arrival = Arrival(heading, NEAR_HEADING, speed, speed, tuple(hitches), (NEAR_HITCH,) * len(hitches))
    return replace(problem, goal=(x, y), goal_radius=NEAR_M, arrival=arrival)


def rounded_goal(goal: Floats) -> Floats:
    """A goal that plans to it still reach where sums were rounded in another way, as by another frame."""
    rounded = goal.copy()
    rounded[RADIUS] += 0.5 * ROUNDING  # of which the judge allows no more
    rounded[LEAST_SPEED] -= ROUNDING
    rounded[[HEADING_TOLERANCE, MOST_SPEED, MOST_TURN]] += ROUNDING
    rounded[HITCHES + 1 :: 2] += ROUNDING
    return rounded
