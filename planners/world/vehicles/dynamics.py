"""Motion of any vehicle: the kernels of ``vehicles``, and whole drives."""

from __future__ import annotations

import numpy as np

from planners.world.arrays import Floats
from planners.world.jit import jit
from planners.world.vehicles import car, car_with_trailers, differential_drive
from planners.world.vehicles.interface import (
    State,
    admissible,
    control_limits,
    is_folded,
    load,
    step,
    store,
    swept_bodies,
    turn_error,
)
from planners.world.vehicles.vehicle import Vehicle

KINDS = (car, differential_drive, car_with_trailers)  # imported: so that their kernels are known


@jit
def simulate(start: Floats, controls: Floats, vehicle: Vehicle) -> Floats:
    """States ``[T, S]`` that ``controls [T-1, 2]`` drive through from ``start [S]``."""
    states = np.empty((controls.shape[0] + 1, start.shape[0]))
    for k in range(start.shape[0]):  # one by one: assigning a row compiles for two seconds
        states[0, k] = start[k]
    state = load(states, 0, vehicle)
    for i in range(controls.shape[0]):
        state = step(state, controls[i, 0], controls[i, 1], vehicle)
        store(states, i + 1, state)
    return states


__all__ = [
    "State",
    "admissible",
    "control_limits",
    "is_folded",
    "load",
    "simulate",
    "step",
    "store",
    "swept_bodies",
    "turn_error",
]
