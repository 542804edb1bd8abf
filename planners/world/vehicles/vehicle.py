"""The robots: a car, a differential drive and a car with trailers; their bodies, limits, states and controls.

A body is a box around a reference point: ``front`` metres ahead of it, ``rear`` behind, ``width`` across.
Lengths in metres, angles in radians. The first four variables of every state are x, y, heading and speed of
the leading body; every robot starts at rest, wheels straight, trailers straight behind.
"""

from __future__ import annotations

from typing import NamedTuple


class Car(NamedTuple):
    """A second-order car with its reference point at the rear axle."""

    front: float = 1.8
    rear: float = 0.2
    width: float = 0.9
    wheelbase: float = 1.6
    max_steering: float = 0.6981317007977318  # 40 degrees
    min_speed: float = -1.0  # m/s
    max_speed: float = 4.0  # m/s
    max_acceleration: float = 2.0  # m/s^2
    max_steering_rate: float = 1.6  # rad/s
    dt: float = 0.1  # seconds a step


class DifferentialDrive(NamedTuple):
    """A second-order differential drive with its reference point at the middle of the axle."""

    front: float = 0.6
    rear: float = 0.6
    width: float = 0.9
    min_speed: float = -1.0  # m/s
    max_speed: float = 4.0  # m/s
    max_acceleration: float = 2.0  # m/s^2
    max_turn_rate: float = 2.0  # rad/s
    max_turn_acceleration: float = 4.0  # rad/s^2
    dt: float = 0.1  # seconds a step


class CarWithTrailers(NamedTuple):
    """The car, pulling a chain of one or two trailers.

    The first trailer is hitched to the car's rear axle, the second to the axle of the first. A hitch angle is
    the heading of the body in front less that of the trailer.
    """

    front: float = 1.8
    rear: float = 0.2
    width: float = 0.9
    wheelbase: float = 1.6
    max_steering: float = 0.6981317007977318  # 40 degrees
    min_speed: float = -1.0  # m/s
    max_speed: float = 4.0  # m/s
    max_acceleration: float = 2.0  # m/s^2
    max_steering_rate: float = 1.6  # rad/s
    dt: float = 0.1  # seconds a step
    hitch_lengths: tuple[float, ...] = (1.9,)  # from each trailer's hitch back to its axle
    trailer_front: float = 1.2  # from a trailer's axle towards its hitch
    trailer_rear: float = 0.5  # with 0.6 the next trailer would touch its corners
    trailer_width: float = 0.8
    max_hitch: float = 1.0  # more is jack-knifed


Vehicle = Car | DifferentialDrive | CarWithTrailers

CAR = Car()
DIFFERENTIAL_DRIVE = DifferentialDrive()
CAR_1_TRAILER = CarWithTrailers()
CAR_2_TRAILERS = CarWithTrailers(hitch_lengths=(1.9, 1.9))

VEHICLES: dict[str, Vehicle] = {
    "car": CAR,
    "differential-drive": DIFFERENTIAL_DRIVE,
    "car-1-trailer": CAR_1_TRAILER,
    "car-2-trailers": CAR_2_TRAILERS,
}


def vehicle_named(name: str) -> Vehicle:
    """Return the vehicle of that name. Raises ValueError if there is none."""
    if name not in VEHICLES:
        raise ValueError(f"No vehicle is named {name!r}; the vehicles are {', '.join(VEHICLES)}.")
    return VEHICLES[name]


def name_of(vehicle: Vehicle) -> str:
    """Return the vehicle's name; a vehicle with settings of its own is named by these."""
    return next((name for name, named in VEHICLES.items() if named == vehicle), repr(vehicle))


def state_names(vehicle: Vehicle) -> tuple[str, ...]:
    """Name the variables of a state, in order."""
    pose = ("x", "y", "heading", "speed")
    if isinstance(vehicle, DifferentialDrive):
        return (*pose, "turn_rate")
    if isinstance(vehicle, CarWithTrailers):
        return (*pose, "steering", *(f"hitch_{i + 1}" for i in range(len(vehicle.hitch_lengths))))
    return (*pose, "steering")


def state_size(vehicle: Vehicle) -> int:
    """Count the variables of a state: ``S`` in ``[T, S]``."""
    return len(state_names(vehicle))


def control_names(vehicle: Vehicle) -> tuple[str, str]:
    """Name the two controls, in order."""
    turning = "turn_acceleration" if isinstance(vehicle, DifferentialDrive) else "steering_rate"
    return "acceleration", turning
