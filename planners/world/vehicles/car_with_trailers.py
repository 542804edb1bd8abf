"""A car with one to three trailers (LaValle 2006, section 13.1.2.4), each hitched to the axle in front of it.

Hitch angle beta_i = theta_(i-1) - theta_i, theta_0 the car's heading; theta_i' = v_(i-1) sin(beta_i) / d_i,
v_i = v_(i-1) cos(beta_i). The car moves as without trailers.
"""

from __future__ import annotations

import math

from planners.world.arrays import Box, Floats
from planners.world.jit import implements, inlined
from planners.world.trigonometry import sincos, tan
from planners.world.vehicles import interface
from planners.world.vehicles.car import drive, most_motion, swept_motion, turn_rates
from planners.world.vehicles.interface import State, box_at, half_step_ways, leading_body
from planners.world.vehicles.vehicle import FIRST_HITCH, CarWithTrailers, Trailer

Three = tuple[float, float, float]  # a number of each trailer; those of missing ones count for nothing


@implements(interface.load, CarWithTrailers)
def _load(states: Floats, i: int, vehicle: CarWithTrailers) -> State:
    return _load_row(states[i], vehicle.trailers)


@inlined
def _load_row(row: Floats, trailers: tuple[Trailer, ...]) -> State:
    if len(trailers) == 1:  # decided when compiling: a state's size is part of its type
        return row[0], row[1], row[2], row[3], row[4], row[5]
    elif len(trailers) == 2:
        return row[0], row[1], row[2], row[3], row[4], row[5], row[6]
    else:
        return row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7]


@inlined
def _second(trailers: tuple[Trailer, ...]) -> Trailer:
    """The second trailer, or the first if it is the only one."""
    if len(trailers) == 1:
        return trailers[0]
    else:
        return trailers[1]


@inlined
def _second_hitch(state: State) -> float:
    if len(state) == 6:
        return state[FIRST_HITCH]
    else:
        return state[6]


@inlined
def hitches_of(state: State) -> Three:
    """The hitch angle of each trailer."""
    return state[FIRST_HITCH], _second_hitch(state), state[-1]


@inlined
def hitch_lengths(vehicle: CarWithTrailers) -> Three:
    """How far each trailer's axle is behind its hitch, in metres."""
    trailers = vehicle.trailers
    return trailers[0].hitch_length, _second(trailers).hitch_length, trailers[-1].hitch_length


@inlined
def hitch_rates(speed: float, turn: float, hitches: Three, lengths: Three) -> Three:
    """Beta' (rad/s) of each trailer at the car's speed and turn rate."""
    sin_1, cos_1 = sincos(hitches[0])
    sin_2, cos_2 = sincos(hitches[1])
    sin_3, _ = sincos(hitches[2])
    turn_1 = speed * sin_1 / lengths[0]
    turn_2 = speed * cos_1 * sin_2 / lengths[1]
    turn_3 = speed * cos_1 * cos_2 * sin_3 / lengths[2]
    return turn - turn_1, turn_1 - turn_2, turn_2 - turn_3


@inlined
def after_rates(hitches: Three, h: float, rates: Three) -> Three:
    """The hitch angles ``h`` seconds later at constant rates."""
    return hitches[0] + h * rates[0], hitches[1] + h * rates[1], hitches[2] + h * rates[2]


@inlined
def _runge_kutta(start: float, h: float, k1: float, k2: float, k3: float, k4: float) -> float:
    return start + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


@inlined
def hitch_stages(
    h: float, speeds: Three, turns: Three, hitches: Three, lengths: Three
) -> tuple[Three, Three, Three, Three]:
    """The rates of ``hitch_rates`` at the four points of a Runge-Kutta step of ``h`` seconds.

    Speeds and turn rates of the car are those at beginning, middle and end.
    """
    k = hitch_rates(speeds[0], turns[0], hitches, lengths)
    p = hitch_rates(speeds[1], turns[1], after_rates(hitches, 0.5 * h, k), lengths)
    q = hitch_rates(speeds[1], turns[1], after_rates(hitches, 0.5 * h, p), lengths)
    return k, p, q, hitch_rates(speeds[2], turns[2], after_rates(hitches, h, q), lengths)


@inlined
def _hitches_after(h: float, speeds: Three, turns: Three, state: State, vehicle: CarWithTrailers) -> Three:
    """The hitch angles ``h`` seconds later; speeds and turn rates of the car at beginning, middle and end."""
    hitches = hitches_of(state)
    k, p, q, r = hitch_stages(h, speeds, turns, hitches, hitch_lengths(vehicle))
    return (
        _runge_kutta(hitches[0], h, k[0], p[0], q[0], r[0]),
        _runge_kutta(hitches[1], h, k[1], p[1], q[1], r[1]),
        _runge_kutta(hitches[2], h, k[2], p[2], q[2], r[2]),
    )


@inlined
def _as_many(hitches: Three, state: State) -> tuple[float, ...]:
    """The hitch angles of the trailers that a state has."""
    if len(state) == 6:
        return (hitches[0],)
    elif len(state) == 7:
        return hitches[:2]
    else:
        return hitches


@implements(interface.step, CarWithTrailers)
def _step(state: State, first: float, second: float, vehicle: CarWithTrailers) -> State:
    h = vehicle.dt
    speed = state[3]
    steering = state[4]
    end_speed = speed + h * first
    end_steering = steering + h * second
    if vehicle.first_order:
        speed, steering, first, second = end_speed, end_steering, 0.0, 0.0
    middle_speed = speed + 0.5 * h * first
    turns = turn_rates(speed, steering, first, second, vehicle)
    x, y, heading = drive(state[0], state[1], state[2], speed, end_speed, turns, h)
    hitches = _hitches_after(h, (speed, middle_speed, end_speed), turns, state, vehicle)
    end_speed = min(max(end_speed, vehicle.min_speed), vehicle.max_speed)
    end_steering = min(max(end_steering, -vehicle.max_steering), vehicle.max_steering)
    return (x, y, heading, end_speed, end_steering, *_as_many(hitches, state))


@implements(interface.trailing, CarWithTrailers)
def _trailing(state: State, speed: float, turn: float, vehicle: CarWithTrailers) -> State:
    speeds = (speed, speed, speed)
    hitches = _hitches_after(vehicle.dt, speeds, (turn, turn, turn), state, vehicle)
    return (*state[:5], *_as_many(hitches, state))


@implements(interface.is_folded, CarWithTrailers)
def _is_folded(state: State, vehicle: CarWithTrailers) -> bool:
    trailers = vehicle.trailers
    room_1 = trailers[0].max_hitch - abs(state[FIRST_HITCH])
    room_2 = _second(trailers).max_hitch - abs(_second_hitch(state))
    room_3 = trailers[-1].max_hitch - abs(state[-1])
    room = min(room_1, room_2, room_3)
    if room < 0.0:
        return True
    speed = state[3]
    if speed == 0.0:  # it may begin at a limit, and at rest nothing folds
        return False
    lengths = hitch_lengths(vehicle)
    turn = speed * tan(state[4]) / vehicle.wheelbase
    rates = hitch_rates(speed, turn, hitches_of(state), lengths)
    bends = _hitch_bends(state, lengths, vehicle)
    return (
        _may_fold_between(room_1, rates[0], bends[0], vehicle)
        or (len(state) > 6 and _may_fold_between(room_2, rates[1], bends[1], vehicle))
        or (len(state) > 7 and _may_fold_between(room_3, rates[2], bends[2], vehicle))
    )


@inlined
def _may_fold_between(room: float, rate: float, bend: float, vehicle: CarWithTrailers) -> bool:
    """Whether an angle may pass its limit, ``room`` away, between this state and the middle of a step.

    If both ends of a step are within the limit, it passes it only around an instant of rate 0. The nearer
    end is at most half a step away from there, and so has at most half a step of ``bend`` (rad/s^2) as its
    rate, and the angle moves by at most an eighth of the squared step of it. Of first order rates jump.
    """
    h = vehicle.dt
    return room < 0.125 * h * h * bend and (vehicle.first_order or abs(rate) < 0.5 * h * bend)


@inlined
def _hitch_bends(state: State, lengths: Three, vehicle: CarWithTrailers) -> Three:
    """The largest |beta''| (rad/s^2) of each trailer in a step into or out of a state."""
    speed, turn = most_motion(state[3], state[4], vehicle)
    acceleration, twist = 0.0, 0.0
    if not vehicle.first_order:
        acceleration = vehicle.max_acceleration
        sharpest = min(abs(state[4]) + vehicle.max_steering_rate * vehicle.dt, vehicle.max_steering)
        slope = tan(sharpest)
        twist = (acceleration * slope + speed * vehicle.max_steering_rate * (1.0 + slope * slope)) / (
            vehicle.wheelbase
        )
    rate_1 = turn + speed / lengths[0]
    twist_1 = (acceleration + speed * rate_1) / lengths[0]
    acceleration_1 = acceleration + speed * rate_1
    rate_2 = speed / lengths[0] + speed / lengths[1]
    twist_2 = (acceleration_1 + speed * rate_2) / lengths[1]
    acceleration_2 = acceleration_1 + speed * rate_2
    rate_3 = speed / lengths[1] + speed / lengths[2]
    twist_3 = (acceleration_2 + speed * rate_3) / lengths[2]
    return twist + twist_1, twist_1 + twist_2, twist_2 + twist_3


@inlined
def _behind(
    x: float, y: float, heading: float, hitch: float, speed: float, turn: float, dt: float, trailer: Trailer
) -> tuple[float, float, float, float, Box]:
    """Axle (x, y), heading, largest turn rate and swept box of the trailer behind a body at this pose.

    ``speed`` (m/s) and ``turn`` (rad/s) are the largest of the axle in front within a step.
    """
    length = trailer.hitch_length
    widest = min(abs(hitch) + dt * (turn + speed / length), 0.5 * math.pi)
    turn_here = speed * sincos(widest)[0] / length
    heading_here = heading - hitch
    sin, cos = sincos(heading_here)
    axle_x = x - length * cos
    axle_y = y - length * sin
    reach = max(trailer.front, trailer.rear)
    margins = half_step_ways(dt, speed, turn_here, reach, 0.5 * trailer.width)
    box = box_at(axle_x, axle_y, cos, sin, trailer.front, trailer.rear, trailer.width, margins)
    return axle_x, axle_y, heading_here, turn_here, box


@implements(interface.swept_bodies, CarWithTrailers)
def _swept_bodies(state: State, vehicle: CarWithTrailers) -> tuple[Box, ...]:
    pose, speed, turn = swept_motion(state, vehicle)
    hitches = hitches_of(state)
    if vehicle.first_order:  # those in the middle of the step into the state, too
        rate = state[3] * tan(state[4]) / vehicle.wheelbase
        speeds = (state[3], state[3], state[3])
        hitches = _hitches_after(-0.5 * vehicle.dt, speeds, (rate, rate, rate), state, vehicle)
    car = leading_body(pose, speed, turn, vehicle)
    trailers, dt = vehicle.trailers, vehicle.dt
    x, y, heading, turn, first = _behind(pose[0], pose[1], pose[2], hitches[0], speed, turn, dt, trailers[0])
    if len(state) == 6:
        return car, first
    x, y, heading, turn, second = _behind(x, y, heading, hitches[1], speed, turn, dt, _second(trailers))
    if len(state) == 7:
        return car, first, second
    else:
        x, y, heading, turn, third = _behind(x, y, heading, hitches[2], speed, turn, dt, trailers[-1])
        return car, first, second, third
