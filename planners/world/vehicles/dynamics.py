"""The motion of any vehicle: its kernels, and the simulation of whole drives."""

from __future__ import annotations

import numpy as np

from planners.world.arrays import Floats
from planners.world.jit import jit
from planners.world.vehicles import car, car_with_trailers, differential_drive
from planners.world.vehicles.interface import State as State
from planners.world.vehicles.interface import admissible as admissible
from planners.world.vehicles.interface import bend_of as bend_of
from planners.world.vehicles.interface import bend_rate as bend_rate
from planners.world.vehicles.interface import bend_with as bend_with
from planners.world.vehicles.interface import control_limits as control_limits
from planners.world.vehicles.interface import curvature_of as curvature_of
from planners.world.vehicles.interface import is_folded as is_folded
from planners.world.vehicles.interface import lateral_acceleration as lateral_acceleration
from planners.world.vehicles.interface import load as load
from planners.world.vehicles.interface import numbers_of as numbers_of
from planners.world.vehicles.interface import sharpest_at as sharpest_at
from planners.world.vehicles.interface import slides as slides
from planners.world.vehicles.interface import step as step
from planners.world.vehicles.interface import store as store
from planners.world.vehicles.interface import swept_bodies as swept_bodies
from planners.world.vehicles.interface import tightest_bend as tightest_bend
from planners.world.vehicles.interface import top_speed as top_speed
from planners.world.vehicles.interface import trailing as trailing
from planners.world.vehicles.interface import turn_error as turn_error
from planners.world.vehicles.interface import turn_in as turn_in
from planners.world.vehicles.interface import turn_limit as turn_limit
from planners.world.vehicles.interface import turn_limit_at as turn_limit_at
from planners.world.vehicles.interface import turn_rate as turn_rate
from planners.world.vehicles.interface import turning_speed as turning_speed
from planners.world.vehicles.interface import with_step as with_step
from planners.world.vehicles.interface import within_ranges as within_ranges
from planners.world.vehicles.vehicle import Vehicle

KINDS = (car, differential_drive, car_with_trailers)  # imported so that their kernels are registered


@jit
def simulate(start: Floats, controls: Floats, vehicle: Vehicle) -> Floats:
    """Simulate ``controls [T - 1, 2]`` from ``start [S]``; returns all states ``[T, S]``."""
    states = np.empty((controls.shape[0] + 1, start.shape[0]))
    for k in range(start.shape[0]):  # one by one, because assigning a row takes two seconds to compile
        states[0, k] = start[k]
    state = load(states, 0, vehicle)
    for i in range(controls.shape[0]):
        state = step(state, controls[i, 0], controls[i, 1], vehicle)
        store(states, i + 1, state)
    return states
