"""How a vehicle stops: braking as hard as it can, and whether a drive is free."""

from __future__ import annotations

import math

import numpy as np

from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene, count_free_prefix
from planners.world.problem import Plan, Problem, start_state
from planners.world.vehicles.dynamics import control_limits, simulate
from planners.world.vehicles.vehicle import SHORT_STEPS, Vehicle, in_short_steps


def braking(state: Floats, vehicle: Vehicle) -> Floats:
    """Return the controls ``[n, 2]`` that bring a vehicle to rest, straightened, as soon as possible."""
    slower, straighter = control_limits(vehicle)
    ramps = _ramp(-state[3], slower, vehicle.dt), _ramp(-state[4], straighter, vehicle.dt)
    controls = np.zeros((max(map(len, ramps)), 2))
    for i, ramp in enumerate(ramps):
        controls[: len(ramp), i] = ramp
    return controls


def stopping(problem: Problem, vehicle: Vehicle, scene: Scene) -> Plan | None:
    """Return the drive on which a vehicle that moves comes to rest after the start.

    Returns None if it does not move, cannot stand, or something is in the way.
    """
    start = start_state(problem, vehicle)
    if vehicle.first_order or vehicle.min_speed > 0.0 or start[3] == 0.0:
        return None
    stop = free_stop(start, vehicle, scene)
    if stop is not None:
        stop.states[-1, 3:5] = 0.0  # as it is but for rounding
    return stop


def free_stop(state: Floats, vehicle: Vehicle, scene: Scene) -> Plan | None:
    """Return the drive on which a vehicle comes to rest from a state ``[S]``, if nothing is in the way."""
    controls = braking(state, vehicle)
    states = simulate(state, controls, vehicle)
    return Plan(states, controls, vehicle.dt) if is_free_drive(states, vehicle, scene) else None


def is_free_drive(states: Floats, vehicle: Vehicle, scene: Scene) -> bool:
    """Whether a drive ``states [T, S]`` is free, including the steps between the states."""
    return bool(count_free_prefix(states, vehicle, scene) == len(states))


def is_free_closely(plan: Plan, vehicle: Vehicle, scene: Scene) -> bool:
    """Whether a drive is free if it is looked at closely where it passes something within usual margins."""
    return count_closely_free(plan, vehicle, scene) == len(plan.states)


def count_closely_free(plan: Plan, vehicle: Vehicle, scene: Scene) -> int:
    """How many states from the first one on are free, with the steps between them, if looked at closely.

    The usual margins keep what moves between two states off obstacles that neither state meets. In short
    steps they are smaller. Not for vehicles of the first order, whose controls depend on the step.
    """
    states, short, last, at = plan.states, in_short_steps(vehicle), len(plan.controls), 0
    if last == 0:
        return int(is_free_drive(states, short, scene))
    while (at := at + int(count_free_prefix(states[at:], vehicle, scene))) <= last:
        if vehicle.first_order:
            return at
        for step in range(max(at - 1, 0), min(at + 1, last)):
            within = simulate(states[step], np.tile(plan.controls[step], (SHORT_STEPS, 1)), short)
            if not is_free_drive(within, short, scene):
                return step
        at += 1
    return last + 1


def _ramp(change: float, rate: float, dt: float) -> Floats:
    """Equal controls, none above ``rate``, that together make a ``change``."""
    steps = max(math.ceil(abs(change) / (rate * dt) - 1e-12), int(change != 0.0))
    return np.full(steps, change / (steps * dt)) if steps else np.zeros(0)
