"""Second-order differential drive: x' = v cos(theta), y' = v sin(theta), theta' = w, v' = a, w' = alpha."""

from __future__ import annotations

from planners.world.arrays import Floats
from planners.world.jit import implements
from planners.world.trigonometry import angle_to, wrapped
from planners.world.vehicles.car import drive
from planners.world.vehicles.interface import (
    Box,
    State,
    admissible,
    control_limits,
    is_folded,
    kept_within,
    leading_body,
    load,
    step,
    swept_bodies,
    turn_error,
)
from planners.world.vehicles.vehicle import DifferentialDrive

LOOK_AHEAD_S = 0.5  # the turn under way counts for this long: damps the controller as steering does a car's


@implements(load, DifferentialDrive)
def _load(states: Floats, i: int, vehicle: DifferentialDrive) -> State:
    row = states[i]
    return row[0], row[1], row[2], row[3], row[4]


@implements(step, DifferentialDrive)
def _step(state: State, first: float, second: float, vehicle: DifferentialDrive) -> State:
    x, y, heading, speed, turn = state
    h = vehicle.dt
    end_speed = speed + h * first
    end_turn = turn + h * second
    turns = (turn, turn + 0.5 * h * second, end_turn)
    x, y, heading = drive(x, y, heading, speed, end_speed, turns, h)
    return (
        x,
        y,
        heading,
        min(max(end_speed, vehicle.min_speed), vehicle.max_speed),
        min(max(end_turn, -vehicle.max_turn_rate), vehicle.max_turn_rate),
    )


@implements(control_limits, DifferentialDrive)
def _control_limits(vehicle: DifferentialDrive) -> tuple[float, float]:
    return vehicle.max_acceleration, vehicle.max_turn_acceleration


@implements(admissible, DifferentialDrive)
def _admissible(state: State, first: float, second: float, vehicle: DifferentialDrive) -> tuple[float, float]:
    return (
        kept_within(first, state[3], vehicle.min_speed, vehicle.max_speed, vehicle.dt),
        kept_within(second, state[4], -vehicle.max_turn_rate, vehicle.max_turn_rate, vehicle.dt),
    )


@implements(turn_error, DifferentialDrive)
def _turn_error(state: State, x: float, y: float, vehicle: DifferentialDrive) -> float:
    return wrapped(angle_to(x - state[0], y - state[1]) - state[2] - LOOK_AHEAD_S * state[4])


@implements(is_folded, DifferentialDrive)
def _is_folded(state: State, vehicle: DifferentialDrive) -> bool:
    return False


@implements(swept_bodies, DifferentialDrive)
def _swept_bodies(state: State, vehicle: DifferentialDrive) -> tuple[Box, ...]:
    h = vehicle.dt
    speed = min(abs(state[3]) + vehicle.max_acceleration * h, max(vehicle.max_speed, -vehicle.min_speed))
    turn = min(abs(state[4]) + vehicle.max_turn_acceleration * h, vehicle.max_turn_rate)
    return (leading_body(state, speed, turn, vehicle),)
