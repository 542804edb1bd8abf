"""Makes what an optimisation found a drive: its controls within all limits, its end at the asked speed."""

from __future__ import annotations

import numpy as np

from planners.optimisation.descent import steps_to_goal
from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene, count_free_prefix
from planners.world.goal import LEAST_SPEED, MOST_SPEED, SLACK
from planners.world.jit import jit
from planners.world.problem import Plan
from planners.world.vehicles.dynamics import admissible, control_limits, load, simulate, step, store
from planners.world.vehicles.vehicle import Vehicle


def driven(start: Floats, controls: Floats, goal: Floats, vehicle: Vehicle, scene: Scene) -> Plan | None:
    """The drive that ``controls [T - 1, 2]`` lead to from ``start [S]``, if it is free and arrives."""
    controls = controls.copy()
    states = _keep_within(controls, start, vehicle)
    controls = at_asked_speed(controls, float(states[-1, 3]), goal, vehicle)
    states = simulate(start, controls, vehicle)
    arrives = steps_to_goal(states[-1:], 0, goal, vehicle) == 0
    if not arrives or count_free_prefix(states, vehicle, scene) <= len(controls):
        return None
    return Plan(states, controls, vehicle.dt)


def at_asked_speed(controls: Floats, speed: float, goal: Floats, vehicle: Vehicle) -> Floats:
    """Controls ``[T - 1, 2]`` that end at a speed that is asked for, where these end at ``speed`` (m/s).

    Rounding leaves a little speed, which the last steps take away. What they are to leave lies within what is
    asked by its slack, so that rounding again does no harm.
    """
    most = control_limits(vehicle)[0]
    asked = min(max(speed, goal[LEAST_SPEED] + SLACK), goal[MOST_SPEED] - SLACK)
    missing = (asked - speed) / vehicle.dt
    controls = controls.copy()
    for k in range(len(controls) - 1, -1, -1):
        before = controls[k, 0]
        controls[k, 0] = min(max(before + missing, -most), most)
        missing -= controls[k, 0] - before
        if missing == 0.0:
            break
    return controls


@jit
def _keep_within(controls: Floats, start: Floats, vehicle: Vehicle) -> Floats:
    """Reduce ``controls [T - 1, 2]`` that lead past a limit, and return the states ``[T, S]``."""
    states = np.empty((controls.shape[0] + 1, start.shape[0]))
    for c in range(start.shape[0]):
        states[0, c] = start[c]
    for k in range(controls.shape[0]):
        state = load(states, k, vehicle)
        controls[k, 0], controls[k, 1] = admissible(state, controls[k, 0], controls[k, 1], vehicle)
        store(states, k + 1, step(state, controls[k, 0], controls[k, 1], vehicle))
    return states
