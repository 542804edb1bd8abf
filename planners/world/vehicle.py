"""The robot: a second-order car, its body and its limits."""

from __future__ import annotations

from typing import NamedTuple


class Vehicle(NamedTuple):
    """A car with its reference point at the rear axle. Lengths in metres, angles in radians.

    State ``(x, y, heading, speed, steering)``, controls ``(acceleration, steering_rate)``.
    """

    front: float = 1.8  # from the rear axle to the foremost point
    rear: float = 0.2  # from the rear axle to the rearmost point
    width: float = 0.9
    wheelbase: float = 1.6
    max_steering: float = 0.6981317007977318  # 40 degrees
    min_speed: float = -1.0  # m/s
    max_speed: float = 4.0  # m/s
    max_acceleration: float = 2.0  # m/s^2
    max_steering_rate: float = 1.6  # rad/s
    dt: float = 0.1  # seconds a step


CAR = Vehicle()
