"""The vehicles once more, for the authority alone: equations, limits and bodies in plain NumPy.

Shares no code with the planners' kernels. Everything is bounded over a whole step, from its first state and
its controls, so that the authority can say of every instant what it knows of two.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planners.world.arrays import Floats
from planners.world.vehicles.vehicle import CarWithTrailers, DifferentialDrive, Vehicle


class Limit(NamedTuple):
    """What a vehicle allows of one variable."""

    name: str
    values: Floats
    low: float
    high: float
    unit: str


class Body(NamedTuple):
    """One body of a vehicle along a plan of T states."""

    name: str
    half_length: float  # metres
    half_width: float  # metres
    centres: Floats  # [T, 2] metres
    along: Floats  # [T, 2] unit vector of the heading
    bend: Floats  # [T - 1] metres: farthest way of a point from where a straight line or an arc would have it


class _Pace(NamedTuple):
    """How fast a body moves within each step, at most: reference point and heading, ``[T - 1]`` each."""

    speed: Floats  # m/s
    acceleration: Floats  # m/s^2
    turn: Floats  # rad/s
    twist: Floats  # rad/s^2, how fast the turn changes


def limits_of(states: Floats, controls: Floats, vehicle: Vehicle) -> list[Limit]:
    """Every limited variable of a plan: ``states [T, S]``, ``controls [T - 1, 2]``."""
    speeds = Limit("Speed", states[:, 3], vehicle.min_speed, vehicle.max_speed, "m/s")
    most = vehicle.max_acceleration
    accelerations = Limit("Acceleration", controls[:, 0], -most, most, "m/s^2")
    if isinstance(vehicle, DifferentialDrive):
        rate, change = vehicle.max_turn_rate, vehicle.max_turn_acceleration
        return [
            speeds,
            Limit("Turn rate", states[:, 4], -rate, rate, "rad/s"),
            accelerations,
            Limit("Turn acceleration", controls[:, 1], -change, change, "rad/s^2"),
        ]
    angle, change = vehicle.max_steering, vehicle.max_steering_rate
    found = [
        speeds,
        Limit("Steering", states[:, 4], -angle, angle, "rad"),
        accelerations,
        Limit("Steering rate", controls[:, 1], -change, change, "rad/s"),
    ]
    if isinstance(vehicle, CarWithTrailers):
        fold = vehicle.max_hitch
        found += [
            Limit(f"Hitch {i + 1}", hitch, -fold, fold, "rad") for i, hitch in enumerate(states[:, 5:].T)
        ]
    return found


def simulate_again(start: Floats, controls: Floats, vehicle: Vehicle) -> Floats:
    """States ``[T, S]`` from ``start [S]`` under ``controls [T - 1, 2]``: RK4, speed and steering clamped.

    Speed and steering (or the turn rate) follow from the controls alone, hitch angles and heading from these,
    and the position from these: sums do the rest.
    """
    states = np.tile(np.asarray(start, dtype=float), (len(controls) + 1, 1))
    most = vehicle.max_turn_rate if isinstance(vehicle, DifferentialDrive) else vehicle.max_steering
    speed, steering = float(start[3]), float(start[4])
    for i, (acceleration, steering_rate) in enumerate(controls.tolist()):
        speed = min(max(speed + vehicle.dt * acceleration, vehicle.min_speed), vehicle.max_speed)
        steering += vehicle.dt * steering_rate
        steering = min(max(steering, -most), most)
        states[i + 1, 3:5] = speed, steering
    states[1:, 2] = start[2] + np.cumsum(_increments(states[:-1], controls, vehicle)[:, 2])
    states[1:, :2] = start[:2] + np.cumsum(_increments(states[:-1], controls, vehicle)[:, :2], axis=0)
    if isinstance(vehicle, CarWithTrailers):
        states[1:, 5:] = _hitches(states, controls, vehicle)
    return states


def _increments(states: Floats, controls: Floats, vehicle: Vehicle) -> Floats:
    """What one Runge-Kutta step adds to the first five variables of each of ``states [T, S]``."""

    def slopes(at: Floats) -> Floats:
        _, _, heading, speed, steering = at.T
        turn = (
            steering
            if isinstance(vehicle, DifferentialDrive)
            else (speed * np.tan(steering) / vehicle.wheelbase)
        )
        return np.column_stack((speed * np.cos(heading), speed * np.sin(heading), turn, controls))

    h = vehicle.dt
    begin = states[:, :5]
    k1 = slopes(begin)
    k2 = slopes(begin + 0.5 * h * k1)
    k3 = slopes(begin + 0.5 * h * k2)
    k4 = slopes(begin + h * k3)
    return h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


def _hitches(states: Floats, controls: Floats, vehicle: CarWithTrailers) -> Floats:
    """Hitch angles ``[T - 1, n]`` after each step: the only variables that feed back on themselves.

    How fast the car drives and turns at the beginning, middle and end of each step is computed beforehand.
    """
    h = vehicle.dt
    times = h * np.array([[0.0], [0.5], [1.0]])
    speeds = states[:-1, 3] + times * controls[:, 0]
    turns = speeds * np.tan(states[:-1, 4] + times * controls[:, 1]) / vehicle.wheelbase
    lengths = vehicle.hitch_lengths

    def slopes(motion: list[float], hitches: list[float]) -> list[float]:
        speed, turn = motion
        rates = []
        for hitch, length in zip(hitches, lengths, strict=True):
            trailing = speed * math.sin(hitch) / length
            rates.append(turn - trailing)
            turn, speed = trailing, speed * math.cos(hitch)
        return rates

    hitches: list[float] = states[0, 5:].tolist()
    after = []
    for begin, middle, end in zip(*np.stack((speeds, turns), axis=2).tolist(), strict=True):
        k1 = slopes(begin, hitches)
        k2 = slopes(middle, [b + 0.5 * h * k for b, k in zip(hitches, k1, strict=True)])
        k3 = slopes(middle, [b + 0.5 * h * k for b, k in zip(hitches, k2, strict=True)])
        k4 = slopes(end, [b + h * k for b, k in zip(hitches, k3, strict=True)])
        every = zip(hitches, k1, k2, k3, k4, strict=True)
        hitches = [b + h / 6.0 * (p + 2.0 * (q + r) + s) for b, p, q, r, s in every]
        after.append(hitches)
    return np.array(after).reshape(len(after), len(lengths))


def bodies_of(states: Floats, controls: Floats, vehicle: Vehicle) -> list[Body]:
    """The bodies along a plan, the leading one first: ``states [T, S]``, ``controls [T - 1, 2]``."""
    pace = _leading_pace(states, controls, vehicle)
    heading, reference = states[:, 2], states[:, :2]
    bodies = [
        _body("vehicle", vehicle.front, vehicle.rear, vehicle.width, heading, reference, pace, vehicle.dt)
    ]
    if isinstance(vehicle, CarWithTrailers):
        size = vehicle.trailer_front, vehicle.trailer_rear, vehicle.trailer_width
        for i, (hitch, length) in enumerate(zip(states[:, 5:].T, vehicle.hitch_lengths, strict=True)):
            heading = heading - hitch
            reference = reference - length * np.column_stack((np.cos(heading), np.sin(heading)))
            pace = _trailing_pace(pace, hitch, length, vehicle.dt)
            bodies.append(_body(f"trailer {i + 1}", *size, heading, reference, pace, vehicle.dt))
    return bodies


def _body(
    name: str,
    front: float,
    rear: float,
    width: float,
    heading: Floats,
    reference: Floats,
    pace: _Pace,
    dt: float,
) -> Body:
    """A box around its reference points ``[T, 2]``.

    A motion differs from a straight one between the same places by an eighth of the squared time step times
    its largest second derivative, so two motions differ by at most twice that.
    """
    along = np.column_stack((np.cos(heading), np.sin(heading)))
    reach = math.hypot(max(front, rear), 0.5 * width)
    second = pace.acceleration + pace.speed * pace.turn + reach * (pace.turn**2 + pace.twist)
    return Body(
        name,
        0.5 * (front + rear),
        0.5 * width,
        reference + 0.5 * (front - rear) * along,
        along,
        2.0 * dt**2 / 8.0 * second,
    )


def _leading_pace(states: Floats, controls: Floats, vehicle: Vehicle) -> _Pace:
    """Bounds for the leading body: it drives along its heading, at no more than it may reach in a step."""
    acceleration, change = np.abs(controls).T
    speed = np.abs(states[:-1, 3]) + vehicle.dt * acceleration
    steering = np.abs(states[:-1, 4]) + vehicle.dt * change
    if isinstance(vehicle, DifferentialDrive):
        return _Pace(speed, acceleration, steering, change)
    turn = speed * np.tan(steering) / vehicle.wheelbase
    twist = acceleration * np.tan(steering) + speed * change / np.cos(steering) ** 2
    return _Pace(speed, acceleration, turn, twist / vehicle.wheelbase)


def _trailing_pace(ahead: _Pace, hitch: Floats, length: float, dt: float) -> _Pace:
    """Bounds for a trailer whose hitch is the reference point of the body ahead; ``hitch [T]`` radians.

    Its axle moves along its heading with v cos(hitch) and turns with v sin(hitch) / length. The hitch angle
    stays near those of both ends of the step, by half a step at the rate that it can have: first at any
    angle, then at the angles so found.
    """
    largest = np.maximum(np.abs(hitch[:-1]), np.abs(hitch[1:]))
    sine = np.ones_like(largest)
    for _ in range(3):
        rate = ahead.turn + ahead.speed * sine / length
        sine = np.sin(np.minimum(largest + 0.5 * dt * rate, 0.5 * math.pi))
    return _Pace(
        speed=ahead.speed,
        acceleration=ahead.acceleration + ahead.speed * sine * rate,
        turn=ahead.speed * sine / length,
        twist=(ahead.acceleration * sine + ahead.speed * rate) / length,
    )
