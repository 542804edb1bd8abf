"""Motion of the second-order car: one Runge-Kutta step, and how far a body point moves in it."""

from __future__ import annotations

import math

import numpy as np

from planners.world.jit import inlined, jit
from planners.world.problem import Floats
from planners.world.vehicle import Vehicle


@inlined
def step(
    x: float,
    y: float,
    heading: float,
    speed: float,
    steering: float,
    acceleration: float,
    steering_rate: float,
    car: Vehicle,
) -> tuple[float, float, float, float, float]:
    """One classical fourth-order Runge-Kutta step of ``car.dt`` seconds, speed and steering clamped after.

    x' = v cos(theta), y' = v sin(theta), theta' = v tan(psi) / L, v' = a, psi' = omega (rear drive). Speed
    and steering are linear in time, so the heading's slopes are known beforehand.
    """
    h = car.dt
    half_speed = speed + 0.5 * h * acceleration
    end_speed = speed + h * acceleration
    half_steering = steering + 0.5 * h * steering_rate
    end_steering = steering + h * steering_rate
    turn_1 = speed * math.tan(steering) / car.wheelbase
    turn_2 = half_speed * math.tan(half_steering) / car.wheelbase
    turn_4 = end_speed * math.tan(end_steering) / car.wheelbase
    heading_2 = heading + 0.5 * h * turn_1
    heading_3 = heading + 0.5 * h * turn_2
    heading_4 = heading + h * turn_2
    new_x = x + h / 6.0 * (
        speed * math.cos(heading)
        + 2.0 * half_speed * (math.cos(heading_2) + math.cos(heading_3))
        + end_speed * math.cos(heading_4)
    )
    new_y = y + h / 6.0 * (
        speed * math.sin(heading)
        + 2.0 * half_speed * (math.sin(heading_2) + math.sin(heading_3))
        + end_speed * math.sin(heading_4)
    )
    new_heading = heading + h / 6.0 * (turn_1 + 4.0 * turn_2 + turn_4)
    new_speed = min(max(end_speed, car.min_speed), car.max_speed)
    new_steering = min(max(end_steering, -car.max_steering), car.max_steering)
    return new_x, new_y, new_heading, new_speed, new_steering


@inlined
def admissible(
    speed: float, steering: float, acceleration: float, steering_rate: float, car: Vehicle
) -> tuple[float, float]:
    """The controls, reduced where a step with them would lead past the limits of speed or steering.

    So nothing is clamped in the middle of a plan, and ``step_margin`` holds.
    """
    h = car.dt
    return (
        min(max(acceleration, (car.min_speed - speed) / h), (car.max_speed - speed) / h),
        min(max(steering_rate, (-car.max_steering - steering) / h), (car.max_steering - steering) / h),
    )


@inlined
def step_margin(speed: float, steering: float, car: Vehicle) -> float:
    """Half of the farthest way, in metres, that a body point goes in an admissible step at a state.

    A footprint inflated by it at both ends of a step covers the sweep between them: nothing is jumped.
    """
    fastest = min(abs(speed) + car.max_acceleration * car.dt, max(car.max_speed, -car.min_speed))
    sharpest = min(abs(steering) + car.max_steering_rate * car.dt, car.max_steering)
    curvature = math.tan(sharpest) / car.wheelbase
    reach = max(car.front, car.rear) * curvature
    return 0.5 * car.dt * fastest * math.hypot(1.0 + 0.5 * car.width * curvature, reach)


@jit
def simulate(start: Floats, controls: Floats, car: Vehicle) -> Floats:
    """States ``[T, 5]`` that ``controls [T-1, 2]`` drive through from ``start [5]``."""
    states = np.empty((controls.shape[0] + 1, 5))
    for k in range(5):  # one by one: assigning a row compiles for two seconds
        states[0, k] = start[k]
    for i in range(controls.shape[0]):
        s = states[i]
        x, y, heading, speed, steering = step(
            s[0], s[1], s[2], s[3], s[4], controls[i, 0], controls[i, 1], car
        )
        states[i + 1, 0] = x
        states[i + 1, 1] = y
        states[i + 1, 2] = heading
        states[i + 1, 3] = speed
        states[i + 1, 4] = steering
    return states
