"""How far the bodies of a vehicle reach in a step, which collision checks have to look."""

from __future__ import annotations

import functools
import math
from typing import Final, NamedTuple

from planners.world.vehicles.vehicle import DifferentialDrive, Trailer, Vehicle, trailers_of

REACH_M: Final = 1.75  # the largest half-diagonal of a box that may be checked
ROOM: Final = 1.5  # roadmaps look for places this many times as long as the body


class Pace(NamedTuple):
    """The greatest distance that a body's points move in half a step."""

    body: str
    half_length: float
    half_width: float
    half_way: float  # metres


def paces(vehicle: Vehicle, straight: bool = False) -> list[Pace]:
    """How far each body moves in half a step, in any motion, or if the vehicle drives ``straight``."""
    fastest = max(vehicle.max_speed, -vehicle.min_speed)
    if straight:
        turn = 0.0
    elif isinstance(vehicle, DifferentialDrive):
        turn = vehicle.max_turn_rate
    else:
        turn = fastest * math.tan(vehicle.max_steering) / vehicle.wheelbase
    found = [_pace("the vehicle", vehicle, fastest, turn, vehicle.dt)]
    for i, trailer in enumerate(trailers_of(vehicle), start=1):
        turn = 0.0 if straight else fastest / trailer.hitch_length
        found.append(_pace(f"trailer {i}", trailer, fastest, turn, vehicle.dt))
    return found


def _pace(name: str, body: Vehicle | Trailer, speed: float, turn: float, dt: float) -> Pace:
    half_width = 0.5 * body.width
    way = 0.5 * dt * math.hypot(speed + half_width * turn, max(body.front, body.rear) * turn)
    return Pace(name, 0.5 * (body.front + body.rear), half_width, way)


@functools.lru_cache(maxsize=64)
def least_scale(vehicle: Vehicle) -> float:
    """How many metres must make one canonical metre, at least, so that planners can check every box."""
    return max(
        max(math.hypot(length + way, width + way), ROOM * math.hypot(length, width)) / REACH_M
        for _, length, width, way in paces(vehicle)
    )
