"""What is left of the plan that a robot drives now, from where the robot is.

Each search begins anew. Half-way through a drive it may find one of a worse kind than the robot is driving,
so a robot that plans again and again would arrive later than it was promised, and change its mind. What is
left of its plan is an answer, too, and only a cheaper one replaces it.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from planners.optimisation.descent import steps_to_goal
from planners.optimisation.polish import polish, polish_guesses
from planners.search.braking import is_free_drive
from planners.world.arrays import Floats
from planners.world.compiling import working_clock
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
    current: Plan, problem: Problem, vehicle: Vehicle, scene: Scene, workspace: Workspace, until: float
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

    Returns:
        A plan for the problem; None if the robot is not near its plan, or no drive near what is left of it is
        free and leads to the goal.
    """
    start, goal = start_state(problem, vehicle), goal_of(problem, vehicle)
    differences = _differences(current.states, start)
    off = _off(differences, vehicle)
    nearest = len(off) - 1 - int(off[::-1].argmin())  # the last of those where it stands
    if off[nearest] > OFF:
        return None
    most = control_limits(vehicle)  # which may be lower than when the plan was made
    controls = np.clip(current.controls[nearest:], np.negative(most), most)
    states = simulate(start, controls, vehicle)
    if np.abs(differences[nearest]).max() <= SAME and _is_within_limits(states, vehicle):
        steps = int(steps_to_goal(states, len(controls), goal, vehicle))
        if steps >= 0 and is_free_drive(states[: steps + 1], vehicle, scene):
            return Plan(states[: steps + 1], controls[:steps].copy(), vehicle.dt)
    if len(controls) == 0:
        return None
    guess, around = Plan(states, controls, vehicle.dt), (vehicle, scene, workspace)
    if not problem.asks_for_pose:  # this keeps some centimetres off obstacles, where that costs little
        return polish(problem, guess, *around, seconds=until - working_clock()).plan
    return polish_guesses(problem, [guess], *around, until)[1].plan


def fits(current: Plan, vehicle: Vehicle) -> bool:
    """Whether states and steps of a plan are those of a vehicle."""
    states, controls = current.states, current.controls
    return (
        current.dt == vehicle.dt
        and states.ndim == 2
        and states.shape[1] == state_size(vehicle)
        and controls.shape == (len(states) - 1, 2)
    )


def _differences(states: Floats, state: Floats) -> Floats:
    """Each of ``states [T, S]`` less a state ``[S]``; headings may differ by whole turns besides."""
    differences: Floats = states - state
    differences[:, 2] = all_wrapped(differences[:, 2])
    return differences


def _off(differences: Floats, vehicle: Vehicle) -> Floats:
    """How much each of the ``differences [T, S]`` is: lengths, radians and shares of full speed together."""
    away = np.hypot(differences[:, 0], differences[:, 1]) / (vehicle.front + vehicle.rear)
    faster = np.abs(differences[:, 3]) / vehicle.max_speed
    off: Floats = away + faster + np.abs(differences[:, [2, *range(4, differences.shape[1])]]).sum(axis=1)
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
