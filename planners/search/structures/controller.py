"""The controller that drives a vehicle towards a point: one PID controller each for heading and for speed."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from planners.world.jit import inlined
from planners.world.vehicles.dynamics import State, control_limits, turn_error, turn_limit_at
from planners.world.vehicles.interface import kept_within
from planners.world.vehicles.vehicle import Vehicle

Errors = tuple[float, float, float, float]  # of heading (rad) and speed (m/s) a step ago; their integrals
NO_ERRORS = (0.0, 0.0, 0.0, 0.0)
WIDE: Final = 0.6  # radians: for smaller errors a vehicle does not brake so that it may turn more sharply


class Gains(NamedTuple):
    """Of both PID controllers."""

    proportional: float = 10.0
    integral: float = 0.1
    derivative: float = 0.1


@inlined
def _pid(error: float, last: float, total: float, gains: Gains, dt: float, limit: float) -> float:
    """The control for an error, between ``-limit`` and ``limit``."""
    control = gains.proportional * error + gains.integral * total + gains.derivative * (error - last) / dt
    return min(max(control, -limit), limit)


@inlined
def steer(
    state: State, x: float, y: float, speed: float, last: Errors, first: bool, gains: Gains, vehicle: Vehicle
) -> tuple[float, float, Errors]:
    """The controls that drive towards (x, y) at ``speed`` (m/s), and the errors for the next step.

    ``first`` says that the drive begins, so that the errors have not changed yet.
    """
    limit_1, limit_2 = control_limits(vehicle)
    last_turn, last_slow, turn_sum, slow_sum = last
    turn = turn_error(state, x, y, vehicle)
    slow = speed - state[3]
    if first:
        last_turn = turn
        last_slow = slow
    turn_sum += turn * vehicle.dt
    slow_sum += slow * vehicle.dt
    control_1 = _pid(slow, last_slow, slow_sum, gains, vehicle.dt, limit_1)
    control_2 = _pid(turn, last_turn, turn_sum, gains, vehicle.dt, limit_2)
    if vehicle.max_lateral_acceleration < math.inf and abs(turn) < WIDE:
        sharpest = turn_limit_at(state[3] + vehicle.dt * control_1, vehicle)
        within = kept_within(control_2, state[4], -sharpest, sharpest, vehicle.dt)
        control_2 = min(max(within, -limit_2), limit_2)
    return control_1, control_2, (turn, slow, turn_sum, slow_sum)
