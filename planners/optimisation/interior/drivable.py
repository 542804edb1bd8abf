"""Makes what an optimisation found a drive: its controls within all limits, its end in the asked motion."""

from __future__ import annotations

import numpy as np

from planners.optimisation.descent import arrives
from planners.optimisation.local_model import Model
from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene, count_free_prefix
from planners.world.goal import LEAST_SPEED, MOST_SPEED, MOST_TURN, SLACK
from planners.world.jit import jit
from planners.world.problem import Plan
from planners.world.vehicles.dynamics import admissible, control_limits, load, simulate, step, store
from planners.world.vehicles.vehicle import Vehicle


def driven(model: Model, steps: int, goal: Floats, vehicle: Vehicle, scene: Scene) -> Plan | None:
    """The drive that the controls in ``model`` lead to, with its feedback, if it is free and arrives."""
    controls: Floats = np.empty((steps, 2))
    states = _follow(model, controls, vehicle)
    controls = in_asked_motion(controls, states[-1], goal, vehicle)
    states = simulate(states[0], controls, vehicle)
    if not arrives(states[-1], goal, vehicle) or count_free_prefix(states, vehicle, scene) <= len(controls):
        return None
    return Plan(states, controls, vehicle.dt)


def in_asked_motion(controls: Floats, last: Floats, goal: Floats, vehicle: Vehicle) -> Floats:
    """Controls ``[T - 1, 2]`` that end as fast and turning as is asked for, where these end in ``last [S]``.

    Rounding leaves a little speed, which the last steps take away. What they are to leave lies within what is
    asked by its slack, so that rounding again does no harm.
    """
    most_turn = goal[MOST_TURN] - SLACK
    low = goal[LEAST_SPEED] + SLACK, -most_turn
    high = goal[MOST_SPEED] - SLACK, most_turn
    controls = controls.copy()
    for c, most in enumerate(control_limits(vehicle)):
        moves = last[3 + c]
        missing = (min(max(moves, low[c]), high[c]) - moves) / vehicle.dt
        for k in range(len(controls) - 1, -1, -1):
            if missing == 0.0:
                break
            before = controls[k, c]
            controls[k, c] = min(max(before + missing, -most), most)
            missing -= controls[k, c] - before
    return controls


@jit
def _follow(model: Model, controls: Floats, vehicle: Vehicle) -> Floats:
    """Fill in ``controls [T - 1, 2]`` that follow the drive of a model, within all limits; its states."""
    size = model.states.shape[1]
    most_0, most_1 = control_limits(vehicle)
    states = np.empty((controls.shape[0] + 1, size))
    for c in range(size):
        states[0, c] = model.states[0, c]
    for k in range(controls.shape[0]):
        first = model.controls[k, 0]
        second = model.controls[k, 1]
        for c in range(size):
            off = states[k, c] - model.states[k, c]
            first += model.feedback[k, 0, c] * off
            second += model.feedback[k, 1, c] * off
        state = load(states, k, vehicle)
        first = min(max(first, -most_0), most_0)
        second = min(max(second, -most_1), most_1)
        controls[k, 0], controls[k, 1] = admissible(state, first, second, vehicle)
        store(states, k + 1, step(state, controls[k, 0], controls[k, 1], vehicle))
    return states
