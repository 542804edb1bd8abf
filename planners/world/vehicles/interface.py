"""The kernels that each kind of vehicle implements, in a file of its own.

The bodies here never run: ``by_vehicle`` takes the implementation for the kind of vehicle instead.

A state is a tuple of numbers that begins with x, y (metres), heading (radians) and speed (m/s). The two
controls are constant during a step. A new kind of vehicle needs its settings in ``vehicle``, a file here, an
entry in ``dynamics.KINDS``, its equations in ``slopes``, and a branch wherever the kind of a vehicle is asked
for (docs/architecture.md).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from planners.world.arrays import Box, Floats
from planners.world.jit import by_vehicle, inlined, replacing, unseen
from planners.world.trigonometry import sincos
from planners.world.vehicles.vehicle import About, Vehicle

State = tuple[float, ...]

SPARE: Final = 1.0 + 1.0 / 32.0  # of half a step is covered, as the authority rounds up
ROUNDING: Final = 1e-6  # of the largest lateral acceleration: planners keep off it, and states may pass it

unseen(About)
# the vehicle with another length of step; only in kernels
with_step: Callable[[Vehicle, float], Vehicle] = replacing("dt")


@by_vehicle
def load(states: Floats, i: int, vehicle: Vehicle) -> State:
    """Row ``i`` of ``states [T, S]`` as a state."""
    raise NotImplementedError


@inlined
def store(states: Floats, i: int, state: State) -> None:
    """Write a state into row ``i`` of ``states [T, S]``."""
    for k in range(len(state)):
        states[i, k] = state[k]


@inlined
def numbers_of(states: Floats, vehicle: Vehicle) -> int:
    """How many numbers a state has: known when compiling, so that loops over them are unrolled."""
    return len(load(states, 0, vehicle))


@by_vehicle
def step(state: State, first: float, second: float, vehicle: Vehicle) -> State:
    """The state after a classical fourth-order Runge-Kutta step of ``vehicle.dt`` seconds."""
    raise NotImplementedError


@by_vehicle
def trailing(state: State, speed: float, turn: float, vehicle: Vehicle) -> State:
    """The state with its trailers where they are after a step at a speed (m/s) and a turn rate (rad/s).

    ``state`` holds the pose after the step, and the hitch angles before it.
    """
    raise NotImplementedError


@by_vehicle
def control_limits(vehicle: Vehicle) -> tuple[float, float]:
    """The largest absolute value of each control."""
    raise NotImplementedError


@by_vehicle
def turn_limit(vehicle: Vehicle) -> float:
    """The largest absolute value of the fifth variable of a state: a steering angle or a turn rate."""
    raise NotImplementedError


@by_vehicle
def within_ranges(state: State, first: float, second: float, vehicle: Vehicle) -> tuple[float, float]:
    """The controls, reduced if a step with them would lead out of the range of speed or of turning.

    So no state of a plan is ever clamped, and the margins of ``swept_bodies`` hold.
    """
    raise NotImplementedError


@by_vehicle
def turn_rate(speed: float, turn: float, vehicle: Vehicle) -> tuple[float, float, float]:
    """The turn rate (rad/s) at a speed (m/s) and a fifth variable.

    Returns this, and its derivatives by speed and by the fifth variable.
    """
    raise NotImplementedError


@by_vehicle
def lateral_acceleration(state: State, vehicle: Vehicle) -> tuple[float, float, float]:
    """How strongly the reference point is accelerated to the left (m/s^2).

    Returns this, and its derivatives by speed and by the fifth variable.
    """
    raise NotImplementedError


@by_vehicle
def fastest_with(turn: float, most: float, vehicle: Vehicle) -> float:
    """The speed (m/s) at which a fifth variable causes the lateral acceleration ``most`` (m/s^2)."""
    raise NotImplementedError


@by_vehicle
def sharpest_at(speed: float, most: float, vehicle: Vehicle) -> float:
    """The fifth variable that causes the lateral acceleration ``most`` (m/s^2) at a speed above 0 (m/s)."""
    raise NotImplementedError


@by_vehicle
def turning_speed(vehicle: Vehicle) -> float:
    """The largest speed (m/s) at which a vehicle may bend as it could at full speed without a limit."""
    raise NotImplementedError


@by_vehicle
def turn_error(state: State, x: float, y: float, vehicle: Vehicle) -> float:
    """The angle (radians, left positive) by which to turn to head for (x, y): a controller's error."""
    raise NotImplementedError


@by_vehicle
def tightest_bend(speed: float, vehicle: Vehicle) -> float:
    """The largest bend that the vehicle can drive at all speeds (m/s) up to this one.

    A bend is what stays as it is in an arc: the steering angle of a car, the curvature of the way otherwise.
    """
    raise NotImplementedError


@by_vehicle
def bend_rate(speed: float, vehicle: Vehicle) -> float:
    """How much a bend can change in a second at all speeds (m/s) up to this one."""
    raise NotImplementedError


@by_vehicle
def curvature_of(bend: float, vehicle: Vehicle) -> float:
    """The curvature of the way (1/m, left positive) in a bend."""
    raise NotImplementedError


@by_vehicle
def bend_with(curvature: float, vehicle: Vehicle) -> float:
    """The bend of a way with this curvature (1/m, left positive)."""
    raise NotImplementedError


@by_vehicle
def bend_of(state: State, vehicle: Vehicle) -> float:
    """The bend that a state drives."""
    raise NotImplementedError


@by_vehicle
def top_speed(gear: float, bend: float, vehicle: Vehicle) -> float:
    """The largest speed (m/s) in a gear and a bend; 0 or less if the vehicle does not drive in that gear."""
    raise NotImplementedError


@by_vehicle
def turn_in(bend: float, speed: float, vehicle: Vehicle) -> float:
    """The fifth variable of a state that drives a bend at this speed (m/s)."""
    raise NotImplementedError


@by_vehicle
def is_folded(state: State, vehicle: Vehicle) -> bool:
    """Whether parts of the vehicle are too close (jack-knifed), or may come to be within half a step."""
    raise NotImplementedError


@by_vehicle
def swept_bodies(state: State, vehicle: Vehicle) -> tuple[Box, ...]:
    """A box around each body, larger by what its points do along and across it in half a step.

    So the boxes at both ends of a step cover the sweep between them, and no obstacle is jumped over. Of
    first order a state knows the step that led to it: its boxes lie around the middle of that step, and
    cover all of it.
    """
    raise NotImplementedError


@inlined
def kept_within(control: float, value: float, low: float, high: float, dt: float) -> float:
    """The control, reduced if ``dt`` seconds of it would lead ``value`` out of ``low`` to ``high``."""
    return min(max(control, (low - value) / dt), (high - value) / dt)


@inlined
def slides(state: State, vehicle: Vehicle) -> bool:
    """Whether a state needs more lateral acceleration than the vehicle allows."""
    most = vehicle.max_lateral_acceleration
    return most < math.inf and abs(lateral_acceleration(state, vehicle)[0]) > most * (1.0 + ROUNDING)


@inlined
def turn_limit_at(speed: float, vehicle: Vehicle) -> float:
    """The largest absolute value of the fifth variable of a state at a speed (m/s)."""
    most = vehicle.max_lateral_acceleration
    if most == math.inf or speed == 0.0:
        return turn_limit(vehicle)
    return min(turn_limit(vehicle), sharpest_at(abs(speed), most, vehicle))


@inlined
def admissible(state: State, first: float, second: float, vehicle: Vehicle) -> tuple[float, float]:
    """The controls, reduced if a step with them would lead past a limit of the state.

    Where the way asked for bends too sharply for the speed, it brakes; what braking leaves too sharp, it
    turns less.
    """
    first, second = within_ranges(state, first, second, vehicle)
    most = vehicle.max_lateral_acceleration
    if most == math.inf:
        return first, second
    most *= 1.0 - ROUNDING
    h = vehicle.dt
    speed = state[3] + h * first
    turn = state[4] + h * second
    fastest = fastest_with(turn, most, vehicle)
    if abs(speed) <= fastest:
        return first, second
    least = abs(state[3]) - h * control_limits(vehicle)[0]
    if speed > 0.0:
        speed = max(fastest, least, vehicle.min_speed)
    else:
        speed = min(-max(fastest, least), vehicle.max_speed)
    if abs(speed) > fastest:
        sharpest = sharpest_at(abs(speed), most, vehicle)
        turn = min(max(turn, -sharpest), sharpest)
    return (speed - state[3]) / h, (turn - state[4]) / h


@inlined
def half_step_ways(
    dt: float, speed: float, turn: float, reach: float, half_width: float
) -> tuple[float, float]:
    """How far in metres a body point gets along the body and across it, at most, in half of ``dt`` seconds.

    Both are those of the frame in which the body stands at the beginning, or at the end, and a little more.

    ``speed`` (m/s) and ``turn`` (rad/s) are the largest at the body's reference point, which moves along the
    body only, and from which the body extends ``reach`` metres along and ``half_width`` metres across.
    """
    half = 0.5 * SPARE * dt
    ahead = speed + half_width * turn
    across = reach * turn
    turned = 0.5 * half * turn  # the mean angle by which the two mix
    return half * (ahead + turned * across), half * (across + turned * ahead)


@inlined
def box_at(
    x: float,
    y: float,
    cos: float,
    sin: float,
    front: float,
    rear: float,
    width: float,
    margins: tuple[float, float],
) -> Box:
    """The box of a body with its reference point at (x, y), larger by ``margins`` (m) along and across."""
    ahead = 0.5 * (front - rear)
    half_length = 0.5 * (front + rear) + margins[0]
    return x + ahead * cos, y + ahead * sin, cos, sin, half_length, 0.5 * width + margins[1]


@inlined
def leading_body(state: State, speed: float, turn: float, vehicle: Vehicle) -> Box:
    """The swept box of the first body, for the largest ``speed`` (m/s) and ``turn`` (rad/s) in a step."""
    reach = max(vehicle.front, vehicle.rear)
    margins = half_step_ways(vehicle.dt, speed, turn, reach, 0.5 * vehicle.width)
    sin, cos = sincos(state[2])
    return box_at(state[0], state[1], cos, sin, vehicle.front, vehicle.rear, vehicle.width, margins)
