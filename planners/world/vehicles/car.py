"""Car: x' = v cos(theta), y' = v sin(theta), theta' = v tan(psi) / L; of second order v' = a, psi' = omega.

Of first order v and psi are constant in a step: v + h a and psi + h omega of the state before.
"""

from __future__ import annotations

import math

from planners.world.arrays import Box, Floats
from planners.world.jit import implements, inlined
from planners.world.trigonometry import angle_to, sincos, tan, turned_by, wrapped
from planners.world.vehicles import interface
from planners.world.vehicles.interface import State, fastest_with, kept_within, leading_body, turn_limit_at
from planners.world.vehicles.vehicle import Car, CarWithTrailers

CarLike = Car | CarWithTrailers


@inlined
def turn_rates(
    speed: float, steering: float, acceleration: float, steering_rate: float, car: CarLike
) -> tuple[float, float, float]:
    """Turn rates (rad/s) at the beginning, middle and end of a step.

    They are known beforehand, because speed and steering are linear in time.
    """
    h = car.dt
    return (
        speed * tan(steering) / car.wheelbase,
        (speed + 0.5 * h * acceleration) * tan(steering + 0.5 * h * steering_rate) / car.wheelbase,
        (speed + h * acceleration) * tan(steering + h * steering_rate) / car.wheelbase,
    )


@inlined
def directions_in(heading: float, turns: tuple[float, float, float], h: float) -> tuple[float, ...]:
    """Sine and cosine of the headings at the four points of a Runge-Kutta step of ``h`` seconds."""
    sin_1, cos_1 = sincos(heading)
    sin_2, cos_2 = turned_by(sin_1, cos_1, 0.5 * h * turns[0])
    sin_3, cos_3 = turned_by(sin_1, cos_1, 0.5 * h * turns[1])
    sin_4, cos_4 = turned_by(sin_1, cos_1, h * turns[1])
    return sin_1, cos_1, sin_2, cos_2, sin_3, cos_3, sin_4, cos_4


@inlined
def drive(
    x: float,
    y: float,
    heading: float,
    speed: float,
    end_speed: float,
    turns: tuple[float, float, float],
    h: float,
) -> tuple[float, float, float]:
    """The pose after a Runge-Kutta step of ``h`` seconds with the turn rates of ``turn_rates``."""
    half_speed = 0.5 * (speed + end_speed)
    sin_1, cos_1, sin_2, cos_2, sin_3, cos_3, sin_4, cos_4 = directions_in(heading, turns, h)
    return (
        x + h / 6.0 * (speed * cos_1 + 2.0 * half_speed * (cos_2 + cos_3) + end_speed * cos_4),
        y + h / 6.0 * (speed * sin_1 + 2.0 * half_speed * (sin_2 + sin_3) + end_speed * sin_4),
        heading + h / 6.0 * (turns[0] + 4.0 * turns[1] + turns[2]),
    )


@implements(interface.load, Car)
def _load(states: Floats, i: int, vehicle: Car) -> State:
    row = states[i]
    return row[0], row[1], row[2], row[3], row[4]


@implements(interface.step, Car)
def _step(state: State, first: float, second: float, vehicle: Car) -> State:
    x, y, heading, speed, steering = state
    end_speed = speed + vehicle.dt * first
    end_steering = steering + vehicle.dt * second
    if vehicle.first_order:
        speed, steering, first, second = end_speed, end_steering, 0.0, 0.0
    turns = turn_rates(speed, steering, first, second, vehicle)
    x, y, heading = drive(x, y, heading, speed, end_speed, turns, vehicle.dt)
    return (
        x,
        y,
        heading,
        min(max(end_speed, vehicle.min_speed), vehicle.max_speed),
        min(max(end_steering, -vehicle.max_steering), vehicle.max_steering),
    )


@implements(interface.trailing, Car)
def _trailing(state: State, speed: float, turn: float, vehicle: Car) -> State:
    return state


@implements(interface.control_limits, Car, CarWithTrailers)
def _control_limits(vehicle: CarLike) -> tuple[float, float]:
    return vehicle.max_acceleration, vehicle.max_steering_rate


@implements(interface.turn_limit, Car, CarWithTrailers)
def _turn_limit(vehicle: CarLike) -> float:
    return vehicle.max_steering


@implements(interface.within_ranges, Car, CarWithTrailers)
def _within_ranges(state: State, first: float, second: float, vehicle: CarLike) -> tuple[float, float]:
    return (
        kept_within(first, state[3], vehicle.min_speed, vehicle.max_speed, vehicle.dt),
        kept_within(second, state[4], -vehicle.max_steering, vehicle.max_steering, vehicle.dt),
    )


@implements(interface.turn_rate, Car, CarWithTrailers)
def _turn_rate(speed: float, turn: float, vehicle: CarLike) -> tuple[float, float, float]:
    slope = tan(turn)
    per_slope = speed / vehicle.wheelbase
    return per_slope * slope, slope / vehicle.wheelbase, per_slope * (1.0 + slope * slope)


@implements(interface.lateral_acceleration, Car, CarWithTrailers)
def _lateral_acceleration(state: State, vehicle: CarLike) -> tuple[float, float, float]:
    speed = state[3]
    slope = tan(state[4])
    per_slope = speed * speed / vehicle.wheelbase
    return per_slope * slope, 2.0 * speed * slope / vehicle.wheelbase, per_slope * (1.0 + slope * slope)


@implements(interface.fastest_with, Car, CarWithTrailers)
def _fastest_with(turn: float, most: float, vehicle: CarLike) -> float:
    slope = abs(tan(turn))
    return math.sqrt(most * vehicle.wheelbase / slope) if slope > 0.0 else math.inf


@implements(interface.sharpest_at, Car, CarWithTrailers)
def _sharpest_at(speed: float, most: float, vehicle: CarLike) -> float:
    return math.atan(most * vehicle.wheelbase / (speed * speed))


@implements(interface.turning_speed, Car, CarWithTrailers)
def _turning_speed(vehicle: CarLike) -> float:
    turning = fastest_with(vehicle.max_steering, vehicle.max_lateral_acceleration, vehicle)
    return max(min(vehicle.max_speed, turning), vehicle.min_speed)


@implements(interface.turn_error, Car, CarWithTrailers)
def _turn_error(state: State, x: float, y: float, vehicle: CarLike) -> float:
    """The angle between the direction to (x, y) and that of the wheels."""
    return wrapped(angle_to(x - state[0], y - state[1]) - state[2] - state[4])


@implements(interface.tightest_bend, Car, CarWithTrailers)
def _tightest_bend(speed: float, vehicle: CarLike) -> float:
    return turn_limit_at(speed, vehicle)


@implements(interface.bend_rate, Car, CarWithTrailers)
def _bend_rate(speed: float, vehicle: CarLike) -> float:
    return vehicle.max_steering_rate


@implements(interface.curvature_of, Car, CarWithTrailers)
def _curvature_of(bend: float, vehicle: CarLike) -> float:
    return tan(bend) / vehicle.wheelbase


@implements(interface.bend_with, Car, CarWithTrailers)
def _bend_with(curvature: float, vehicle: CarLike) -> float:
    return math.atan(curvature * vehicle.wheelbase)


@implements(interface.bend_of, Car, CarWithTrailers)
def _bend_of(state: State, vehicle: CarLike) -> float:
    return state[4]


@implements(interface.top_speed, Car, CarWithTrailers)
def _top_speed(gear: float, bend: float, vehicle: CarLike) -> float:
    top = vehicle.max_speed if gear > 0.0 else -vehicle.min_speed
    if vehicle.max_lateral_acceleration < math.inf:
        top = min(top, fastest_with(bend, vehicle.max_lateral_acceleration, vehicle))
    return top


@implements(interface.turn_in, Car, CarWithTrailers)
def _turn_in(bend: float, speed: float, vehicle: CarLike) -> float:
    return bend


@implements(interface.is_folded, Car)
def _is_folded(state: State, vehicle: Car) -> bool:
    return False


@inlined
def most_motion(speed: float, steering: float, car: CarLike) -> tuple[float, float]:
    """The largest speed (m/s) and turn rate (rad/s) at the rear axle in a step into or out of a state."""
    fastest = min(abs(speed) + car.max_acceleration * car.dt, max(car.max_speed, -car.min_speed))
    sharpest = min(abs(steering) + car.max_steering_rate * car.dt, car.max_steering)
    return fastest, fastest * tan(sharpest) / car.wheelbase


@inlined
def swept_motion(state: State, car: CarLike) -> tuple[State, float, float]:
    """The pose from which a state's steps are covered, and the largest speed and turn rate of these.

    Of first order it is the middle of the step into the state, of which all is known.
    """
    if car.first_order:
        turn = state[3] * tan(state[4]) / car.wheelbase
        turns = (turn, turn, turn)
        pose = drive(state[0], state[1], state[2], state[3], state[3], turns, -0.5 * car.dt)
        return pose, abs(state[3]), abs(turn)
    speed, turn = most_motion(state[3], state[4], car)
    return (state[0], state[1], state[2]), speed, turn


@implements(interface.swept_bodies, Car)
def _swept_bodies(state: State, vehicle: Car) -> tuple[Box, ...]:
    pose, speed, turn = swept_motion(state, vehicle)
    return (leading_body(pose, speed, turn, vehicle),)
