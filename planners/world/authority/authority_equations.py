"""The vehicles once more, for the authority alone: equations, limits and bodies in plain NumPy.

Shares no code with the planners' kernels. Everything is bounded over a whole step, from its first state and
its controls, so that the authority can say of every instant what it knows of two.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planners.world.arrays import Floats
from planners.world.vehicles.vehicle import CarWithTrailers, DifferentialDrive, Trailer, Vehicle, trailers_of

RELATIVE = 1e-6  # by which a lateral acceleration, computed from two rounded numbers, may pass its limit
WITHIN = 8  # shorter steps in each, at which hitch angles are looked at


class Limit(NamedTuple):
    """What a vehicle allows of one variable."""

    name: str
    values: Floats
    low: float
    high: float
    unit: str


class Body(NamedTuple):
    """A body of a vehicle, or one of its convex parts, along a plan of T states."""

    name: str
    corners: Floats  # [n, 2] metres around its centre, counter-clockwise, x along its heading
    centres: Floats  # [T, 2] metres, the middle of the box around it
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
    found = [Limit("Speed", states[:, 3], vehicle.min_speed, vehicle.max_speed, "m/s")]
    if isinstance(vehicle, DifferentialDrive):
        most, change = vehicle.max_turn_rate, vehicle.max_turn_acceleration
        found.append(Limit("Turn rate", states[:, 4], -most, most, "rad/s"))
        second = Limit("Turn acceleration", controls[:, 1], -change, change, "rad/s^2")
    else:
        most, change = vehicle.max_steering, vehicle.max_steering_rate
        found.append(Limit("Steering", states[:, 4], -most, most, "rad"))
        second = Limit("Steering rate", controls[:, 1], -change, change, "rad/s")
    if not vehicle.first_order:  # which may change as much as speed and steering themselves allow
        most = vehicle.max_acceleration
        found += [Limit("Acceleration", controls[:, 0], -most, most, "m/s^2"), second]
    if math.isfinite(vehicle.max_lateral_acceleration):
        most = vehicle.max_lateral_acceleration * (1.0 + RELATIVE)
        found.append(
            Limit("Lateral acceleration", states[:, 3] * _turns(states, vehicle), -most, most, "m/s^2")
        )
    for i, (hitch, trailer) in enumerate(zip(states[:, 5:].T, trailers_of(vehicle), strict=True)):
        found.append(Limit(f"Hitch {i + 1}", hitch, -trailer.max_hitch, trailer.max_hitch, "rad"))
    return found


def _turns(states: Floats, vehicle: Vehicle) -> Floats:
    """How fast the leading body turns (rad/s) in each of ``states [T, S]``."""
    if isinstance(vehicle, DifferentialDrive):
        return states[:, 4]
    turns: Floats = states[:, 3] * np.tan(states[:, 4]) / vehicle.wheelbase
    return turns


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
    states[1:, 2] = start[2] + np.cumsum(_increments(states, controls, vehicle)[:, 2])
    states[1:, :2] = start[:2] + np.cumsum(_increments(states, controls, vehicle)[:, :2], axis=0)
    if trailers_of(vehicle):
        states[1:, 5:] = _hitches(states, controls, vehicle)
    return states


def _held(states: Floats, controls: Floats, vehicle: Vehicle) -> tuple[Floats, Floats]:
    """Speed and steering at the beginning of each step, and their rates in it: ``[T - 1, 2]`` each."""
    if vehicle.first_order:  # what is commanded holds from the beginning of the step to its end
        return states[1:, 3:5], np.zeros_like(controls)
    return states[:-1, 3:5], controls


def _increments(states: Floats, controls: Floats, vehicle: Vehicle) -> Floats:
    """What a Runge-Kutta step adds to pose, speed and steering of each of ``states [T, S]`` but the last."""
    begin_held, rates = _held(states, controls, vehicle)

    def slopes(at: Floats) -> Floats:
        _, _, heading, speed, steering = at.T
        turn = (
            steering
            if isinstance(vehicle, DifferentialDrive)
            else (speed * np.tan(steering) / vehicle.wheelbase)
        )
        return np.column_stack((speed * np.cos(heading), speed * np.sin(heading), turn, rates))

    h = vehicle.dt
    begin = np.column_stack((states[:-1, :3], begin_held))
    k1 = slopes(begin)
    k2 = slopes(begin + 0.5 * h * k1)
    k3 = slopes(begin + 0.5 * h * k2)
    k4 = slopes(begin + h * k3)
    return h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


def _hitches(states: Floats, controls: Floats, vehicle: Vehicle) -> Floats:
    """Hitch angles ``[T - 1, n]`` after each step: the only variables that feed back on themselves.

    How fast the car drives and turns at the beginning, middle and end of each step is computed beforehand.
    """
    h = vehicle.dt
    times = h * np.array([[0.0], [0.5], [1.0]])
    held, rates_held = _held(states, controls, vehicle)
    speeds = held[:, 0] + times * rates_held[:, 0]
    steering = held[:, 1] + times * rates_held[:, 1]
    turns = steering
    if not isinstance(vehicle, DifferentialDrive):
        turns = speeds * np.tan(steering) / vehicle.wheelbase
    lengths = [trailer.hitch_length for trailer in trailers_of(vehicle)]

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


def widest_hitches(states: Floats, controls: Floats, vehicle: CarWithTrailers) -> Floats:
    """The largest size ``[n]`` (rad) of each hitch angle within the steps: ``states [T, S]``, ``[T - 1, 2]``.

    Every step is integrated again in ``WITHIN`` shorter ones, all steps at once.
    """
    h = vehicle.dt / WITHIN
    held, rates_held = _held(states, controls, vehicle)
    lengths = [trailer.hitch_length for trailer in trailers_of(vehicle)]

    def slopes(time: float, hitches: Floats) -> Floats:
        speed, steering = (held + time * rates_held).T
        turn = speed * np.tan(steering) / vehicle.wheelbase
        rates = []
        for hitch, length in zip(hitches, lengths, strict=True):
            trailing = speed * np.sin(hitch) / length
            rates.append(turn - trailing)
            turn, speed = trailing, speed * np.cos(hitch)
        return np.array(rates)

    hitches = states[:-1, 5:].T
    widest: Floats = np.abs(states[:, 5:]).max(axis=0)
    for time in h * np.arange(WITHIN):
        k1 = slopes(time, hitches)
        k2 = slopes(time + 0.5 * h, hitches + 0.5 * h * k1)
        k3 = slopes(time + 0.5 * h, hitches + 0.5 * h * k2)
        k4 = slopes(time + h, hitches + h * k3)
        hitches = hitches + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        widest = np.maximum(widest, np.abs(hitches).max(axis=1, initial=0.0))
    return widest


def bodies_of(states: Floats, controls: Floats, vehicle: Vehicle) -> list[Body]:
    """The bodies along a plan, the leading one first: ``states [T, S]``, ``controls [T - 1, 2]``.

    A body with an outline is listed once for each of its polygons.
    """
    pace = _leading_pace(states, controls, vehicle)
    heading, reference = states[:, 2], states[:, :2]
    bodies = _parts("vehicle", vehicle, heading, reference, pace, vehicle.dt)
    for i, (hitch, trailer) in enumerate(zip(states[:, 5:].T, trailers_of(vehicle), strict=True)):
        heading = heading - hitch
        behind = np.column_stack((np.cos(heading), np.sin(heading)))
        reference = reference - trailer.hitch_length * behind
        pace = _trailing_pace(pace, hitch, trailer.hitch_length, vehicle.dt)
        bodies += _parts(f"trailer {i + 1}", trailer, heading, reference, pace, vehicle.dt)
    return bodies


def bodies_within(state: Floats, control: Floats, vehicle: Vehicle) -> list[Body]:
    """The bodies in one step from a ``state [S]`` under a ``control [2]``, in ``WITHIN`` shorter steps."""
    controls = np.tile(control, (WITHIN, 1))
    if vehicle.first_order:  # what is commanded is there at once
        controls[0] *= WITHIN
        controls[1:] = 0.0
    finer = vehicle._replace(dt=vehicle.dt / WITHIN)
    return bodies_of(simulate_again(state, controls, finer), controls, finer)


def _parts(
    name: str, body: Vehicle | Trailer, heading: Floats, reference: Floats, pace: _Pace, dt: float
) -> list[Body]:
    """The convex parts of a body around its reference points ``[T, 2]``.

    A motion differs from a straight one between the same places by an eighth of the squared time step times
    its largest second derivative, so two motions differ by at most twice that.
    """
    along = np.column_stack((np.cos(heading), np.sin(heading)))
    across = np.column_stack((-along[:, 1], along[:, 0]))
    parts = []
    for polygon in _polygons(body):
        reach = np.hypot(*polygon.T).max()
        second = pace.acceleration + pace.speed * pace.turn + reach * (pace.turn**2 + pace.twist)
        middle = 0.5 * (polygon.min(axis=0) + polygon.max(axis=0))
        centres = reference + middle[0] * along + middle[1] * across
        parts.append(Body(name, polygon - middle, centres, along, 2.0 * dt**2 / 8.0 * second))
    return parts


def _polygons(body: Vehicle | Trailer) -> list[Floats]:
    """The convex polygons ``[n, 2]`` of a body, in metres around its reference point."""
    if body.about.outline:
        return [np.array(polygon) for polygon in body.about.outline]
    half = 0.5 * body.width
    return [np.array([[-body.rear, -half], [body.front, -half], [body.front, half], [-body.rear, half]])]


def _leading_pace(states: Floats, controls: Floats, vehicle: Vehicle) -> _Pace:
    """Bounds for the leading body: it drives along its heading, at no more than it may reach in a step."""
    held, rates = _held(states, controls, vehicle)
    acceleration, change = np.abs(rates).T
    speed, steering = np.abs(held).T + vehicle.dt * np.array([acceleration, change])
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
