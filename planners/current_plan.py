"""What is left of the plan that a robot drives now, from where the robot is.

Each search begins anew. Half-way through a drive it may find one of a worse kind than the robot is driving,
so a robot that plans again and again would arrive later than it was promised, and change its mind. What is
left of its plan is an answer, too, and only a cheaper one replaces it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from typing import Final

import numpy as np

from planners.optimisation.descent import arrives, steps_to_goal
from planners.optimisation.following import follow
from planners.optimisation.local_model import allocate_model
from planners.optimisation.polish import ROOM, polish, polish_guesses
from planners.search.braking import count_closely_free, is_free_closely, is_free_drive
from planners.world.arrays import Floats
from planners.world.compiling import working_clock
from planners.world.driving_cost import cost_of
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
from planners.world.problem import Arrival, Plan, Problem, start_state, starting_at
from planners.world.trigonometry import all_wrapped
from planners.world.vehicles.dynamics import control_limits, simulate, turn_limit
from planners.world.vehicles.vehicle import Vehicle, state_size
from planners.world.workspace import Workspace

OFF: Final = 1.0  # by which a robot may be off its plan: lengths, radians and shares of full speed together
ROUNDING: Final = 1e-9  # on limits and at the goal, m/s and radians
LATER: Final = (0, 2, 5)  # steps by which a drive along a plan may reach the goal later than the plan
FULL_CONTROLS: Final = (0.3, 1.0)  # metres or radians off the plan, as heavy as one: tight, then gentle
MOST_BLOCKS: Final = 4  # on a plan that a drive is led around
SOONER: Final = 5  # steps by which the next may come sooner than on the plan
AROUND: Final = (10, 20, 40)  # steps before and behind what blocks a plan in which a drive may leave it
NEAR_M: Final = 0.1  # how near it has to come back to it
NEAR_HEADING: Final = 0.03  # radians
NEAR_HITCH: Final = 0.1
SAME: Final = 1e-6  # metres, m/s and radians: a robot that is off by no more drives the same controls on


def rest_of(
    current: Plan,
    problem: Problem,
    vehicle: Vehicle,
    scene: Scene,
    workspace: Workspace,
    until: float,
    polishes: bool = True,
) -> Plan | None:
    """Drive what is left of a plan, from the start of a problem.

    A robot on its plan drives the same controls on. For one that is beside it, as a measured state is, whose
    plan an obstacle touches now, or whose goal has moved, a free drive near the plan is looked for.

    Args:
        current: the plan, in the problem's frame and lengths.
        problem: where the robot is, and where it has to go.
        vehicle: what is driven.
        scene: ``scene_of(problem)``.
        workspace: the caller's buffers.
        until: when to give up, by ``working_clock``.
        polishes: whether a drive along the plan is polished if it is free, too; else it keeps near the plan.

    Returns:
        A plan for the problem; None if the robot is not near its plan, or no drive near what is left of it is
        free and leads to the goal.
    """
    start, goal = start_state(problem, vehicle), _rounded(goal_of(problem, vehicle))
    nearest, apart = _nearest(current, start, vehicle)
    if _off(apart, vehicle) > OFF:
        return None
    most = control_limits(vehicle)  # which may be lower than when the plan was made
    controls = np.clip(current.controls[nearest:], np.negative(most), most)
    states = simulate(start, controls, vehicle)
    if np.abs(apart).max() <= SAME and _is_within_limits(states, vehicle):
        steps = int(steps_to_goal(states, len(controls), goal, vehicle))
        rest = Plan(states[: steps + 1], controls[: max(steps, 0)].copy(), vehicle.dt)
        if steps >= 0 and is_free_closely(rest, vehicle, scene):
            return rest
    if len(controls) == 0:  # at the end of the plan, which may be the goal of two stops
        standing = Plan(states, controls, vehicle.dt)
        is_there = arrives(start, goal, vehicle) and is_free_closely(standing, vehicle, scene)
        return standing if is_there else None
    around = vehicle, scene, workspace
    left = Plan(current.states[nearest:], controls, vehicle.dt)
    along = _led_around(_driven_along(left, start, goal, *around), problem, *around, until)
    arrived = arrives(along.states[-1], goal, vehicle) and is_free_closely(along, vehicle, scene)
    if arrived and not polishes:
        return along
    if problem.asks_for_pose:
        better = polish_guesses(problem, [along], *around, until)[1].plan
    else:  # this keeps some centimetres off obstacles, where that costs little
        better = polish(problem, along, *around, seconds=until - working_clock()).plan
    plans = [each for each in (better, along if arrived else None) if each is not None]
    return min(plans, key=lambda each: cost_of(each, vehicle), default=None)


def _driven_along(
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
    for later, full_control in product(LATER if reached >= 0 else (0,), FULL_CONTROLS):
        steps = last + later
        model = workspace.buffers(allocate_model, ROOM * (1 + steps // ROOM), len(start))
        model.states[: last + 1] = plan.states[: last + 1]
        model.states[last + 1 : steps + 1] = plan.states[last]
        model.states[: steps + 1, 2] += turns
        model.states[0] = start
        model.controls[:last] = plan.controls[:last]
        model.controls[last:steps] = 0.0
        follow(model, steps, goal, full_control, vehicle)
        controls = np.clip(model.tried_controls[:steps], np.negative(most), most)
        along = Plan(simulate(start, controls, vehicle), controls, vehicle.dt)
        if arrives(along.states[-1], goal, vehicle):
            best = best or along
            if is_free_closely(along, vehicle, scene):
                return along
    return best or along


def _led_around(
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
    goal = _rounded(goal_of(problem, vehicle))
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
        behind = _driven_along(behind, leaving.states[-1], goal, *around)
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


def is_near(current: Plan, state: Floats, vehicle: Vehicle) -> bool:
    """Whether a robot in a ``state [S]`` is near enough to its plan to drive what is left of it."""
    return bool(_off(_nearest(current, state, vehicle)[1], vehicle) <= OFF)


def steps_left(current: Plan, state: Floats, vehicle: Vehicle) -> int:
    """How many steps of its plan are ahead of a robot in a ``state [S]``."""
    return len(current.controls) - _nearest(current, state, vehicle)[0]


def fits(current: Plan, vehicle: Vehicle) -> bool:
    """Whether states and steps of a plan are those of a vehicle."""
    states, controls = current.states, current.controls
    return (
        current.dt == vehicle.dt
        and states.ndim == 2
        and states.shape[1] == state_size(vehicle)
        and controls.shape == (len(states) - 1, 2)
    )


def _nearest(current: Plan, state: Floats, vehicle: Vehicle) -> tuple[int, Floats]:
    """The last of a plan's states that are nearest to a ``state [S]``, and by what it differs ``[S]``."""
    differences = current.states - state
    differences[:, 2] = all_wrapped(differences[:, 2])
    off = _off(differences, vehicle)
    nearest = len(off) - 1 - int(off[::-1].argmin())
    return nearest, differences[nearest]


def _rounded(goal: Floats) -> Floats:
    """A goal that plans to it still reach where sums were rounded in another way, as by another frame."""
    rounded = goal.copy()
    rounded[RADIUS] += 0.5 * ROUNDING  # of which the judge allows no more
    rounded[LEAST_SPEED] -= ROUNDING
    rounded[[HEADING_TOLERANCE, MOST_SPEED, MOST_TURN]] += ROUNDING
    rounded[HITCHES + 1 :: 2] += ROUNDING
    return rounded


def _off(differences: Floats, vehicle: Vehicle) -> Floats:
    """How large ``differences [..., S]`` are: lengths, radians and shares of full speed together."""
    x, y, turn, speed, *others = np.moveaxis(differences, -1, 0)
    away, faster = np.hypot(x, y) / (vehicle.front + vehicle.rear), np.abs(speed) / vehicle.max_speed
    off: Floats = away + faster + np.abs(turn) + np.abs(others).sum(axis=0)
    return off


def _is_within_limits(states: Floats, vehicle: Vehicle) -> bool:
    """Whether speeds and steering, or turn rates, of ``states [T, S]`` are those of a vehicle."""
    speeds, turns = states[:, 3], np.abs(states[:, 4])
    lowest, highest = vehicle.min_speed - ROUNDING, vehicle.max_speed + ROUNDING
    return bool(
        (speeds >= lowest).all()
        and (speeds <= highest).all()
        and turns.max() <= turn_limit(vehicle) + ROUNDING
    )
