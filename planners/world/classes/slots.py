"""Places to park, what stands in them, and the sizes by which manoeuvres are drawn."""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from planners.world.arrays import Bounds, Floats, Point, Pose
from planners.world.vehicles.bodies import swept_boxes
from planners.world.vehicles.vehicle import (
    DifferentialDrive,
    Vehicle,
    length_of_trailers,
    state_size,
    trailers_of,
)


class Sizes(NamedTuple):
    """What a manoeuvre's room is measured by: the box around a vehicle and its trailers, all straight."""

    length: float  # metres, from the front of the vehicle to the rear of its last trailer
    width: float  # metres, of its widest body
    front: float  # metres, from the reference point to the front
    turning: float  # metres, least radius that the reference point can drive for ever; 0 on the spot

    @property
    def rear(self) -> float:
        """Metres from the reference point to the rear."""
        return self.length - self.front

    @property
    def unit(self) -> float:
        """What aisles are measured by, in metres: the largest of length, width and turning radius."""
        return max(self.length, self.width, self.turning)


class Slot(NamedTuple):
    """A rectangle to park in."""

    x: float  # metres, of its middle
    y: float
    heading: float  # radians, along its length
    length: float  # metres
    width: float

    def point(self, along: float, across: float) -> Point:
        """The point so many metres from the middle along the slot's length and to the left of it."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return self.x + along * cos - across * sin, self.y + along * sin + across * cos


class Ground(NamedTuple):
    """A manoeuvre in the frame in which it is drawn."""

    start: Pose
    goal: Pose
    bounds: Bounds
    obstacles: list[Floats]  # convex polygons, each [n, 2] metres


@functools.lru_cache(maxsize=64)
def sizes_of(vehicle: Vehicle) -> Sizes:
    """The sizes of a ``vehicle``, in metres of its problems, with the planners' margin at rest."""
    bodies = (vehicle, *trailers_of(vehicle))
    boxes = swept_boxes(np.zeros((1, state_size(vehicle))), vehicle)
    margins = [
        float(box[4]) - 0.5 * (body.front + body.rear) for box, body in zip(boxes, bodies, strict=True)
    ]
    turning = 0.0
    if not isinstance(vehicle, DifferentialDrive):
        turning = vehicle.wheelbase / math.tan(vehicle.max_steering)
    behind = 0.0  # what the axle of a trailer needs, which drives round within the one in front
    for trailer in reversed(trailers_of(vehicle)):
        unfolded = trailer.hitch_length / math.sin(min(trailer.max_hitch, 0.5 * math.pi))
        behind = max(unfolded, math.hypot(behind, trailer.hitch_length))
    front = vehicle.front + margins[0]
    rear = bodies[-1].rear + margins[-1] + length_of_trailers(vehicle)
    width = max(body.width + 2.0 * margin for body, margin in zip(bodies, margins, strict=True))
    return Sizes(front + rear, width, front, max(turning, behind))


def between(rng: np.random.Generator, low: float, high: float) -> float:
    """A number drawn evenly."""
    return low + (high - low) * float(rng.random())


def rectangle(slot: Slot) -> Floats:
    """The corners ``[4, 2]`` of a slot, counter-clockwise."""
    half_length, half_width = 0.5 * slot.length, 0.5 * slot.width
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    return np.array([slot.point(u * half_length, w * half_width) for u, w in signs])


def wall(x_min: float, y_min: float, x_max: float, y_max: float) -> Floats:
    """The corners ``[4, 2]`` of a box along the axes."""
    return np.array([[x_min, y_min], [x_max, y_min], [x_max, y_max], [x_min, y_max]])


def standing(
    slot: Slot, rng: np.random.Generator, length: float, width: float, skew: float, lean: Point = (0.0, 0.0)
) -> Floats:
    """A parked body ``[4, 2]``, wholly in its slot and so in nobody else's.

    Args:
        slot: where it stands.
        rng: decides size, skew and place.
        length: metres; it is 0.85 to 1.1 times as long and wide as it is said to be, less if it has no room.
        width: metres.
        skew: radians by which it may be turned to either side.
        lean: between -1 and 1 along and across, towards which end and side it stands; 0: anywhere.
    """
    length *= between(rng, 0.85, 1.1)
    width *= between(rng, 0.85, 1.1)
    turn = between(rng, -skew, skew)
    cos, sin = math.cos(turn), abs(math.sin(turn))
    along, across = length * cos + width * sin, length * sin + width * cos
    shrunk = min(1.0, slot.length / along, slot.width / across)
    rooms = 0.5 * (slot.length - shrunk * along), 0.5 * (slot.width - shrunk * across)
    shares = [each if each else between(rng, -1.0, 1.0) for each in lean]
    x, y = slot.point(shares[0] * rooms[0], shares[1] * rooms[1])
    return rectangle(Slot(x, y, slot.heading + turn, shrunk * length, shrunk * width))


def parked(slot: Slot, sizes: Sizes, across: float = 0.0, backwards: bool = False) -> Pose:
    """The pose of the reference point of a vehicle that stands in the middle of a slot.

    ``across``: metres to the left of the slot's middle line. ``backwards``: facing against its heading.
    """
    ahead = 0.5 * (sizes.front - sizes.rear)
    x, y = slot.point(ahead if backwards else -ahead, across)
    return x, y, math.remainder(slot.heading + (math.pi if backwards else 0.0), math.tau)


def placed(x: float, y: float, heading: float, sizes: Sizes) -> Pose:
    """The pose of the reference point of a vehicle whose middle is at (x, y)."""
    return parked(Slot(x, y, heading, sizes.length, sizes.width), sizes)


def half_across(sizes: Sizes, turn: float) -> float:
    """Half of the room in metres that a vehicle takes across a lane at an angle ``turn`` to it."""
    return 0.5 * (sizes.length * abs(math.sin(turn)) + sizes.width * abs(math.cos(turn)))


def mirrored(ground: Ground) -> Ground:
    """The same with left and right exchanged."""
    (x, y, heading), (goal_x, goal_y, goal_heading), bounds, obstacles = ground
    return Ground(
        (x, -y, -heading),
        (goal_x, -goal_y, -goal_heading),
        (bounds[0], -bounds[3], bounds[2], -bounds[1]),
        [polygon * (1.0, -1.0) for polygon in obstacles],
    )
