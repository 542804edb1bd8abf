"""What is left of the plan that a robot drives now, from where the robot is.

Each search begins anew. Half-way through a drive it may find one of a worse kind than the robot is driving,
so a robot that plans again and again would arrive later than it was promised, and change its mind. What is
left of its plan is an answer, too, and only a cheaper one replaces it.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from planners.along_plan import driven_along, led_around, rounded_goal
from planners.optimisation.descent import arrives, steps_to_goal
from planners.optimisation.polish import polish, polish_guesses
from planners.search.braking import is_free_closely
from planners.world.arrays import Floats
from planners.world.compiling import working_clock
from planners.world.driving_cost import cost_of
from planners.world.geometry.collision import Scene
from planners.world.goal import goal_of
from planners.world.problem import Plan, Problem, start_state
from planners.world.trigonometry import all_wrapped
from planners.world.vehicles.dynamics import control_limits, simulate, turn_limit
from planners.world.vehicles.vehicle import Vehicle, state_size
from planners.world.workspace import Workspace

OFF: Final = 1.0  # by which a robot may be off its plan: lengths, radians and shares of full speed together
ROUNDING: Final = 1e-9  # on limits, m/s and radians
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
    start, goal = start_state(problem, vehicle), rounded_goal(goal_of(problem, vehicle))
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
    along = led_around(driven_along(left, start, goal, *around), problem, *around, until)
    arrived = arrives(along.states[-1], goal, vehicle) and is_free_closely(along, vehicle, scene)
    if arrived and not polishes:
        return along
    if problem.asks_for_pose:
        better = polish_guesses(problem, [along], *around, until)[1].plan
    else:  # this keeps some centimetres off obstacles, where that costs little
        better = polish(problem, along, *around, seconds=until - working_clock()).plan
    plans = [each for each in (better, along if arrived else None) if each is not None]
    return min(plans, key=lambda each: cost_of(each, vehicle), default=None)


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
