"""A car with one or two trailers (LaValle 2006, section 13.1.2.4), each hitched to the axle in front of it.

Hitch angle beta_i = theta_(i-1) - theta_i, theta_0 the car's heading; theta_i' = v_(i-1) sin(beta_i) / d_i,
v_i = v_(i-1) cos(beta_i). The car moves as without trailers.
"""

from __future__ import annotations

import math

from planners.world.arrays import Box, Floats
from planners.world.jit import implements, inlined
from planners.world.trigonometry import sincos
from planners.world.vehicles import interface
from planners.world.vehicles.car import drive, most_motion, turn_rates
from planners.world.vehicles.interface import State, box_at, half_way, leading_body
from planners.world.vehicles.vehicle import CarWithTrailers


@implements(interface.load, CarWithTrailers)
def _load(states: Floats, i: int, vehicle: CarWithTrailers) -> State:
    return _load_row(states[i], vehicle.hitch_lengths)


@inlined
def _load_row(row: Floats, hitch_lengths: tuple[float, ...]) -> State:
    if len(hitch_lengths) == 1:  # decided when compiling: a state's size is part of its type
        return row[0], row[1], row[2], row[3], row[4], row[5]
    else:
        return row[0], row[1], row[2], row[3], row[4], row[5], row[6]


@inlined
def _hitch_rates(
    speed: float, turn: float, hitch_1: float, hitch_2: float, length_1: float, length_2: float
) -> tuple[float, float]:
    """beta_1' and beta_2' (rad/s) at the car's speed and turn rate. One trailer needs only the first."""
    sin_1, cos_1 = sincos(hitch_1)
    sin_2, _ = sincos(hitch_2)
    turn_1 = speed * sin_1 / length_1
    turn_2 = speed * cos_1 * sin_2 / length_2
    return turn - turn_1, turn_1 - turn_2


@implements(interface.step, CarWithTrailers)
def _step(state: State, first: float, second: float, vehicle: CarWithTrailers) -> State:
    h = vehicle.dt
    speed = state[3]
    end_speed = speed + h * first
    middle_speed = speed + 0.5 * h * first
    end_steering = state[4] + h * second
    turns = turn_rates(speed, state[4], first, second, vehicle)
    x, y, heading = drive(state[0], state[1], state[2], speed, end_speed, turns, h)
    length_1 = vehicle.hitch_lengths[0]
    length_2 = vehicle.hitch_lengths[-1]
    hitch_1 = state[5]
    hitch_2 = state[-1]
    k1, l1 = _hitch_rates(speed, turns[0], hitch_1, hitch_2, length_1, length_2)
    k2, l2 = _hitch_rates(
        middle_speed, turns[1], hitch_1 + 0.5 * h * k1, hitch_2 + 0.5 * h * l1, length_1, length_2
    )
    k3, l3 = _hitch_rates(
        middle_speed, turns[1], hitch_1 + 0.5 * h * k2, hitch_2 + 0.5 * h * l2, length_1, length_2
    )
    k4, l4 = _hitch_rates(end_speed, turns[2], hitch_1 + h * k3, hitch_2 + h * l3, length_1, length_2)
    new_hitch_1 = hitch_1 + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    new_hitch_2 = hitch_2 + h / 6.0 * (l1 + 2.0 * l2 + 2.0 * l3 + l4)
    new_speed = min(max(end_speed, vehicle.min_speed), vehicle.max_speed)
    new_steering = min(max(end_steering, -vehicle.max_steering), vehicle.max_steering)
    if len(state) == 6:
        return x, y, heading, new_speed, new_steering, new_hitch_1
    else:
        return x, y, heading, new_speed, new_steering, new_hitch_1, new_hitch_2


@implements(interface.is_folded, CarWithTrailers)
def _is_folded(state: State, vehicle: CarWithTrailers) -> bool:
    return abs(state[5]) > vehicle.max_hitch or abs(state[-1]) > vehicle.max_hitch


@inlined
def _trailer(
    x: float,
    y: float,
    heading: float,
    hitch: float,
    length: float,
    speed: float,
    turn: float,
    vehicle: CarWithTrailers,
) -> tuple[float, float, float, float, Box]:
    """Axle (x, y), heading, largest turn rate and swept box of the trailer behind a body at this pose.

    ``speed`` (m/s) and ``turn`` (rad/s) are the largest of the axle in front within a step.
    """
    widest = min(abs(hitch) + vehicle.dt * (turn + speed / length), 0.5 * math.pi)
    turn_here = speed * sincos(widest)[0] / length
    heading_here = heading - hitch
    sin, cos = sincos(heading_here)
    axle_x = x - length * cos
    axle_y = y - length * sin
    reach = max(vehicle.trailer_front, vehicle.trailer_rear)
    margin = half_way(vehicle.dt, speed, turn_here, reach, 0.5 * vehicle.trailer_width)
    box = box_at(
        axle_x, axle_y, cos, sin, vehicle.trailer_front, vehicle.trailer_rear, vehicle.trailer_width, margin
    )
    return axle_x, axle_y, heading_here, turn_here, box


@implements(interface.swept_bodies, CarWithTrailers)
def _swept_bodies(state: State, vehicle: CarWithTrailers) -> tuple[Box, ...]:
    x = state[0]
    y = state[1]
    heading = state[2]
    speed, turn = most_motion(state[3], state[4], vehicle)
    car = leading_body(state, speed, turn, vehicle)
    x, y, heading, turn, first = _trailer(
        x, y, heading, state[5], vehicle.hitch_lengths[0], speed, turn, vehicle
    )
    if len(state) == 6:
        return car, first
    else:
        x, y, heading, turn, second = _trailer(
            x, y, heading, state[-1], vehicle.hitch_lengths[-1], speed, turn, vehicle
        )
        return car, first, second
