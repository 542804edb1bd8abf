"""The robots: cars, differential drives and cars with trailers; their bodies, limits, states and controls.

A body is a box around a reference point: ``front`` metres ahead of it, ``rear`` behind, ``width`` across. It
may have an ``outline`` that fills the box only partly. Lengths in metres, angles in radians. The first four
variables of every state are x, y, heading and speed of the leading body; unless a problem says otherwise,
every robot starts at rest, wheels straight, trailers straight behind.

A vehicle of the first order changes speed and steering (or turn rate) at once, at the beginning of a step.
Its controls are these changes, divided by the step: as large as its range of speeds allows, and no larger.

Lengths here are canonical: ``scale`` says how many metres of the world outside make one of them.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

Corners = tuple[tuple[float, float], ...]  # of a convex polygon, metres around the reference point


class About(NamedTuple):
    """What kernels do not see of a body, so that bodies that differ in it run the same compiled code."""

    name: bytes = b""  # of a vehicle; bytes, because Numba tells the kinds of texts apart slowly
    outline: tuple[Corners, ...] = ()  # convex polygons that the body consists of; none if it fills its box


class Costs(NamedTuple):
    """What a drive costs, in seconds; by default its time."""

    gear_change: float = 0.0  # what each change between forwards and backwards adds
    forwards: float = 1.0  # what a second forwards counts as
    backwards: float = 1.0


class Car(NamedTuple):
    """A car with its reference point at the rear axle."""

    front: float = 1.8
    rear: float = 0.2
    width: float = 0.9
    wheelbase: float = 1.6
    max_steering: float = 0.6981317007977318  # 40 degrees
    min_speed: float = -1.0  # m/s
    max_speed: float = 4.0  # m/s
    max_acceleration: float = 2.0  # m/s^2
    max_steering_rate: float = 1.6  # rad/s
    max_lateral_acceleration: float = math.inf  # m/s^2
    dt: float = 0.1  # seconds a step
    first_order: bool = False
    scale: float = 1.0
    costs: Costs = Costs()
    about: About = About(b"car")


class DifferentialDrive(NamedTuple):
    """A differential drive with its reference point at the middle of the axle; of first order a unicycle."""

    front: float = 0.6
    rear: float = 0.6
    width: float = 0.9
    min_speed: float = -1.0  # m/s
    max_speed: float = 4.0  # m/s
    max_acceleration: float = 2.0  # m/s^2
    max_turn_rate: float = 2.0  # rad/s
    max_turn_acceleration: float = 4.0  # rad/s^2
    max_lateral_acceleration: float = math.inf  # m/s^2
    dt: float = 0.1  # seconds a step
    first_order: bool = False
    scale: float = 1.0
    costs: Costs = Costs()
    about: About = About(b"differential-drive")


class Trailer(NamedTuple):
    """A trailer with its reference point at the middle of its axle."""

    hitch_length: float = 1.9  # from its hitch back to its axle
    front: float = 1.2  # from its axle towards its hitch
    rear: float = 0.5  # with 0.6 the next trailer would touch its corners
    width: float = 0.8
    max_hitch: float = 1.0  # more is jack-knifed
    about: About = About()


class CarWithTrailers(NamedTuple):
    """A car that pulls a chain of one to three trailers.

    The first trailer is hitched to the car's rear axle, each other to the axle of the one before. A hitch
    angle is the heading of the body in front less that of the trailer.
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
    max_lateral_acceleration: float = math.inf  # m/s^2
    dt: float = 0.1  # seconds a step
    first_order: bool = False
    scale: float = 1.0
    costs: Costs = Costs()
    about: About = About(b"car-1-trailer")
    trailers: tuple[Trailer, ...] = (Trailer(),)


Vehicle = Car | DifferentialDrive | CarWithTrailers
MOST_TRAILERS = 3
SHORT_STEPS: Final = 4  # into which a step is cut to look at it closely
FIRST_HITCH: Final = 5  # index into a state: hitch angles follow x, y, heading, speed and turning

CAR = Car()
DIFFERENTIAL_DRIVE = DifferentialDrive()
CAR_1_TRAILER = CarWithTrailers()
CAR_2_TRAILERS = CarWithTrailers(trailers=(Trailer(), Trailer()), about=About(b"car-2-trailers"))

VEHICLES: dict[str, Vehicle] = {
    vehicle.about.name.decode(): vehicle
    for vehicle in (CAR, DIFFERENTIAL_DRIVE, CAR_1_TRAILER, CAR_2_TRAILERS)
}


def in_short_steps(vehicle: Vehicle) -> Vehicle:
    """The vehicle in steps so short that its margins hardly count, for drives that are looked at closely."""
    return vehicle._replace(dt=vehicle.dt / SHORT_STEPS)


def name_of(vehicle: Vehicle) -> str:
    """Return the vehicle's name; a built-in one with settings of its own is named by these."""
    name = vehicle.about.name.decode()
    return name if VEHICLES.get(name, vehicle) == vehicle else repr(vehicle)


def trailers_of(vehicle: Vehicle) -> tuple[Trailer, ...]:
    """Return the trailers of a vehicle, the first one first; none if it pulls none."""
    return vehicle.trailers if isinstance(vehicle, CarWithTrailers) else ()


def length_of_trailers(vehicle: Vehicle) -> float:
    """How far behind the vehicle's reference point that of its last trailer is if all are straight, in m."""
    return sum(trailer.hitch_length for trailer in trailers_of(vehicle))


def state_names(vehicle: Vehicle) -> tuple[str, ...]:
    """Name the variables of a state, in order."""
    turning = "turn_rate" if isinstance(vehicle, DifferentialDrive) else "steering"
    hitches = (f"hitch_{i + 1}" for i in range(len(trailers_of(vehicle))))
    return ("x", "y", "heading", "speed", turning, *hitches)


def state_size(vehicle: Vehicle) -> int:
    """Count the variables of a state: ``S`` in ``[T, S]``."""
    return len(state_names(vehicle))


def control_names(vehicle: Vehicle) -> tuple[str, str]:
    """Name the two controls, in order."""
    turning = "turn_acceleration" if isinstance(vehicle, DifferentialDrive) else "steering_rate"
    return "acceleration", turning
