"""Differential drive: x' = v cos(theta), y' = v sin(theta), theta' = w; of second order v' = a, w' = alpha.

Of first order, as a unicycle, v and w are constant in a step: v + h a and w + h alpha of the state before.
"""

from __future__ import annotations

import math

from planners.world.arrays import Box, Floats
from planners.world.jit import implements
from planners.world.trigonometry import angle_to, wrapped
from planners.world.vehicles import interface
from planners.world.vehicles.car import drive
from planners.world.vehicles.interface import State, kept_within, leading_body, turn_limit_at
from planners.world.vehicles.vehicle import DifferentialDrive

LOOK_AHEAD_S = 0.5  # the present turn is counted on for this long: damps the controller, as steering a car's
BEND_SHARE = 0.75  # of the turn acceleration is for changing bends, the rest for changing speed in a bend
SLOW = 0.5  # m/s, below which a turn is no bend that it would be worth to go on with


@implements(interface.load, DifferentialDrive)
def _load(states: Floats, i: int, vehicle: DifferentialDrive) -> State:
    row = states[i]
    return row[0], row[1], row[2], row[3], row[4]


@implements(interface.step, DifferentialDrive)
def _step(state: State, first: float, second: float, vehicle: DifferentialDrive) -> State:
    x, y, heading, speed, turn = state
    h = vehicle.dt
    end_speed = speed + h * first
    end_turn = turn + h * second
    if vehicle.first_order:
        speed, turn, second = end_speed, end_turn, 0.0
    turns = (turn, turn + 0.5 * h * second, end_turn)
    x, y, heading = drive(x, y, heading, speed, end_speed, turns, h)
    return (
        x,
        y,
        heading,
        min(max(end_speed, vehicle.min_speed), vehicle.max_speed),
        min(max(end_turn, -vehicle.max_turn_rate), vehicle.max_turn_rate),
    )


@implements(interface.trailing, DifferentialDrive)
def _trailing(state: State, speed: float, turn: float, vehicle: DifferentialDrive) -> State:
    return state


@implements(interface.control_limits, DifferentialDrive)
def _control_limits(vehicle: DifferentialDrive) -> tuple[float, float]:
    return vehicle.max_acceleration, vehicle.max_turn_acceleration


@implements(interface.turn_limit, DifferentialDrive)
def _turn_limit(vehicle: DifferentialDrive) -> float:
    return vehicle.max_turn_rate


@implements(interface.within_ranges, DifferentialDrive)
def _within_ranges(
    state: State, first: float, second: float, vehicle: DifferentialDrive
) -> tuple[float, float]:
    return (
        kept_within(first, state[3], vehicle.min_speed, vehicle.max_speed, vehicle.dt),
        kept_within(second, state[4], -vehicle.max_turn_rate, vehicle.max_turn_rate, vehicle.dt),
    )


@implements(interface.turn_rate, DifferentialDrive)
def _turn_rate(speed: float, turn: float, vehicle: DifferentialDrive) -> tuple[float, float, float]:
    return turn, 0.0, 1.0


@implements(interface.lateral_acceleration, DifferentialDrive)
def _lateral_acceleration(state: State, vehicle: DifferentialDrive) -> tuple[float, float, float]:
    return state[3] * state[4], state[4], state[3]


@implements(interface.fastest_with, DifferentialDrive)
def _fastest_with(turn: float, most: float, vehicle: DifferentialDrive) -> float:
    return most / abs(turn) if turn != 0.0 else math.inf


@implements(interface.sharpest_at, DifferentialDrive)
def _sharpest_at(speed: float, most: float, vehicle: DifferentialDrive) -> float:
    return most / speed


@implements(interface.turning_speed, DifferentialDrive)
def _turning_speed(vehicle: DifferentialDrive) -> float:
    radius = vehicle.max_speed / vehicle.max_turn_rate
    turning = math.sqrt(vehicle.max_lateral_acceleration * radius)
    return max(min(vehicle.max_speed, turning), vehicle.min_speed)


@implements(interface.turn_error, DifferentialDrive)
def _turn_error(state: State, x: float, y: float, vehicle: DifferentialDrive) -> float:
    return wrapped(angle_to(x - state[0], y - state[1]) - state[2] - LOOK_AHEAD_S * state[4])


@implements(interface.tightest_bend, DifferentialDrive)
def _tightest_bend(speed: float, vehicle: DifferentialDrive) -> float:
    return turn_limit_at(speed, vehicle) / speed


@implements(interface.bend_rate, DifferentialDrive)
def _bend_rate(speed: float, vehicle: DifferentialDrive) -> float:
    return BEND_SHARE * vehicle.max_turn_acceleration / speed


@implements(interface.curvature_of, DifferentialDrive)
def _curvature_of(bend: float, vehicle: DifferentialDrive) -> float:
    return bend


@implements(interface.bend_with, DifferentialDrive)
def _bend_with(curvature: float, vehicle: DifferentialDrive) -> float:
    return curvature


@implements(interface.bend_of, DifferentialDrive)
def _bend_of(state: State, vehicle: DifferentialDrive) -> float:
    return state[4] / max(abs(state[3]), SLOW) * (1.0 if state[3] >= 0.0 else -1.0)


@implements(interface.top_speed, DifferentialDrive)
def _top_speed(gear: float, bend: float, vehicle: DifferentialDrive) -> float:
    top = vehicle.max_speed if gear > 0.0 else -vehicle.min_speed
    if bend != 0.0:
        bent = abs(bend)
        top = min(top, vehicle.max_turn_rate / bent, math.sqrt(vehicle.max_lateral_acceleration / bent))
    return top


@implements(interface.turn_in, DifferentialDrive)
def _turn_in(bend: float, speed: float, vehicle: DifferentialDrive) -> float:
    return bend * speed


@implements(interface.is_folded, DifferentialDrive)
def _is_folded(state: State, vehicle: DifferentialDrive) -> bool:
    return False


@implements(interface.swept_bodies, DifferentialDrive)
def _swept_bodies(state: State, vehicle: DifferentialDrive) -> tuple[Box, ...]:
    h = vehicle.dt
    if vehicle.first_order:  # covered is the step into the state, from its middle
        turns = (state[4], state[4], state[4])
        pose = drive(state[0], state[1], state[2], state[3], state[3], turns, -0.5 * h)
        return (leading_body(pose, abs(state[3]), abs(state[4]), vehicle),)
    speed = min(abs(state[3]) + vehicle.max_acceleration * h, max(vehicle.max_speed, -vehicle.min_speed))
    turn = min(abs(state[4]) + vehicle.max_turn_acceleration * h, vehicle.max_turn_rate)
    return (leading_body(state, speed, turn, vehicle),)
