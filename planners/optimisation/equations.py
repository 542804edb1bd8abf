"""The vehicles as CasADi expressions: their step, their limits, and discs that cover them.

A step is the classical Runge-Kutta step of ``planners.world.vehicles.dynamics``, of variable length.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import casadi as ca
import numpy as np

from planners.world.arrays import Floats
from planners.world.vehicles.interface import SPARE
from planners.world.vehicles.vehicle import FIRST_HITCH, DifferentialDrive, Vehicle, state_size, trailers_of

SMOOTH = 0.01  # m/s, rad: around 0 an absolute value is rounded off, always upwards
SHY_OF_JACK_KNIFE = 1e-3  # rad: the solver may pass a limit by its tolerance
SHY_OF_SLIDING = 0.999  # share of the largest lateral acceleration, for the same reason


class VehicleLimits(NamedTuple):
    """The limits of a vehicle, infinite if there is none."""

    state_low: Floats  # [S]
    state_high: Floats  # [S]
    control_low: Floats  # [2]
    control_high: Floats  # [2]


def slopes(state: ca.SX, controls: ca.SX, vehicle: Vehicle) -> ca.SX:
    """Return the time derivative ``[S]`` of ``state [S]`` under ``controls [2]``."""
    heading, speed, turn = state[2], state[3], state[4]
    turning = [turn if isinstance(vehicle, DifferentialDrive) else speed * ca.tan(turn) / vehicle.wheelbase]
    hitches = []
    pull = speed
    for i, trailer in enumerate(trailers_of(vehicle)):
        turning.append(pull * ca.sin(state[FIRST_HITCH + i]) / trailer.hitch_length)
        hitches.append(turning[i] - turning[i + 1])
        pull *= ca.cos(state[FIRST_HITCH + i])
    return ca.vertcat(
        speed * ca.cos(heading), speed * ca.sin(heading), turning[0], controls[0], controls[1], *hitches
    )


def step_of(vehicle: Vehicle) -> ca.Function:
    """Return a function from state ``[S]``, controls ``[2]`` and step length (s) to the next state ``[S]``.

    Nothing is clamped.
    """
    state, controls, h = ca.SX.sym("state", state_size(vehicle)), ca.SX.sym("controls", 2), ca.SX.sym("h")
    begin, rates = state, controls
    if vehicle.first_order:  # speed and steering change at once
        begin = ca.vertcat(state[:3], state[3:5] + h * controls, state[FIRST_HITCH:])
        rates = ca.SX.zeros(2)
    return ca.Function("step", [state, controls, h], [_moved(begin, rates, h, vehicle)])


def _moved(state: ca.SX, rates: ca.SX, h: ca.SX | float, vehicle: Vehicle) -> ca.SX:
    """The state ``h`` seconds later, by Runge and Kutta."""
    k1 = slopes(state, rates, vehicle)
    k2 = slopes(state + 0.5 * h * k1, rates, vehicle)
    k3 = slopes(state + 0.5 * h * k2, rates, vehicle)
    k4 = slopes(state + h * k3, rates, vehicle)
    return state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


def limits_of(vehicle: Vehicle) -> VehicleLimits:
    """Return the limits of a vehicle. Position and heading have none."""
    if isinstance(vehicle, DifferentialDrive):
        turn, turn_control = vehicle.max_turn_rate, vehicle.max_turn_acceleration
    else:
        turn, turn_control = vehicle.max_steering, vehicle.max_steering_rate
    hitches = [trailer.max_hitch - SHY_OF_JACK_KNIFE for trailer in trailers_of(vehicle)]
    controls = np.array([vehicle.max_acceleration, turn_control])
    return VehicleLimits(
        np.array([-np.inf] * 3 + [vehicle.min_speed, -turn] + [-hitch for hitch in hitches]),
        np.array([np.inf] * 3 + [vehicle.max_speed, turn, *hitches]),
        -controls,
        controls,
    )


def lateral_acceleration_of(vehicle: Vehicle) -> ca.Function:
    """Return a function from state ``[S]`` to the lateral acceleration of the reference point, in m/s^2."""
    state = ca.SX.sym("state", state_size(vehicle))
    turn = slopes(state, ca.SX.zeros(2), vehicle)[2]
    return ca.Function("lateral_acceleration", [state], [state[3] * turn])


def discs_of(vehicle: Vehicle, a_body: int) -> ca.Function:
    """Return a function from ``state [S]`` to discs over the bodies: centres ``[2, D]``, radii ``[D]`` (m).

    The discs, ``a_body`` in a row over each body, cover it with the margins that the kernels add:
    what its points do in half a step into or out of the state.
    """
    given = state = ca.SX.sym("state", state_size(vehicle))
    limits = limits_of(vehicle)
    speed, sharpest = _absolute(state[3]), _absolute(state[4])
    if vehicle.first_order:  # covered is the step into the state, from its middle
        state = _moved(state, ca.SX.zeros(2), -0.5 * vehicle.dt, vehicle)
    else:
        fastest = max(limits.state_high[3], -limits.state_low[3])
        speed = ca.fmin(speed + vehicle.dt * limits.control_high[0], fastest)
        sharpest = ca.fmin(sharpest + vehicle.dt * limits.control_high[1], limits.state_high[4])
    if isinstance(vehicle, DifferentialDrive):
        turn = sharpest
    else:
        turn = speed * ca.tan(sharpest) / vehicle.wheelbase
    x, y, heading = state[0], state[1], state[2]
    body = (vehicle.front, vehicle.rear, vehicle.width)
    rows = [_row(x, y, heading, body, speed, turn, vehicle.dt, a_body)]
    for i, trailer in enumerate(trailers_of(vehicle)):
        hitch, length = state[FIRST_HITCH + i], trailer.hitch_length
        heading -= hitch
        x -= length * ca.cos(heading)
        y -= length * ca.sin(heading)
        widest = _absolute(hitch) + vehicle.dt * (turn + speed / length)
        turn = speed * ca.sin(ca.fmin(widest, 0.5 * math.pi)) / length
        body = (trailer.front, trailer.rear, trailer.width)
        rows.append(_row(x, y, heading, body, speed, turn, vehicle.dt, a_body))
    return ca.Function("discs", [given], [ca.horzcat(*part) for part in zip(*rows, strict=True)])


def _absolute(value: ca.SX) -> ca.SX:
    return ca.sqrt(value**2 + SMOOTH**2)


def _row(
    x: ca.SX,
    y: ca.SX,
    heading: ca.SX,
    body: tuple[float, float, float],
    speed: ca.SX,
    turn: ca.SX,
    dt: float,
    count: int,
) -> tuple[ca.SX, ca.SX]:
    """Centres ``[2, count]`` and radii ``[1, count]`` of discs over one body, inflated by its margin."""
    front, rear, width = body
    half = 0.5 * SPARE * dt  # the rest is ``half_step_ways`` of the kernels, for symbols
    ahead, across = speed + 0.5 * width * turn, max(front, rear) * turn
    turned = 0.5 * half * turn
    half_length = 0.5 * (front + rear) + half * (ahead + turned * across)
    centres = []
    for i in range(count):
        along = 0.5 * (front - rear) + (2 * i + 1 - count) / count * half_length
        centres.append(ca.vertcat(x + along * ca.cos(heading), y + along * ca.sin(heading)))
    radius = ca.sqrt((half_length / count) ** 2 + (0.5 * width + half * (across + turned * ahead)) ** 2)
    return ca.horzcat(*centres), ca.repmat(radius, 1, count)
