"""How the sizes, limits and step of a vehicle must fit together, and the scale that follows from them."""

from __future__ import annotations

import itertools
import math
from typing import Any, Final

import numpy as np

from planners.world.arrays import Floats
from planners.world.vehicles.reach import least_scale, paces
from planners.world.vehicles.vehicle import DifferentialDrive, Trailer, Vehicle, trailers_of

BEHIND_M: Final = 8.0  # room for trailers behind the start of canonical problems
SCALES: Final = (2.0**-6, 2.0**6)
ANGLES: Final = 41  # hitch angles at which bodies may not meet
FOLDS: Final = 7  # of each hitch, for bodies that are not neighbours


def check_sizes(vehicle: Vehicle) -> None:
    """Raise ValueError, the end of a sentence, if a ``vehicle`` moves too far in a step or meets itself."""
    straight = not isinstance(vehicle, DifferentialDrive)  # fast cars do not steer sharply
    for body, half_length, half_width, half_way in paces(vehicle, straight):
        narrow = min(half_length, half_width)
        if half_way > narrow:
            raise ValueError(
                f"has a step of {vehicle.dt:g} s, in which a point of {body} moves up to "
                f"{2.0 * half_way:.3g} m, more than the {2.0 * narrow:.3g} m that it is wide; give "
                f"{vehicle.dt * narrow / half_way:.2g} s or less"
            )
    ahead: Vehicle | Trailer = vehicle
    for number, trailer in enumerate(trailers_of(vehicle), start=1):
        angles = np.linspace(-trailer.max_hitch, trailer.max_hitch, ANGLES).tolist()
        if _shape(ahead).intersects(_turned(trailer, 0.0)):
            angles = []  # a semi-trailer overlaps the tractor that carries it
        for angle in angles:
            if _shape(ahead).intersects(_turned(trailer, angle)):
                raise ValueError(
                    f"has a trailer {number} that touches the body in front at a hitch angle of "
                    f"{abs(angle):.2f} rad; give a smaller max_hitch, a longer hitch_length or shorter bodies"
                )
        ahead = trailer
    _check_folded(vehicle)


def _check_folded(vehicle: Vehicle) -> None:
    """Raise ValueError, the end of a sentence, if bodies that are not neighbours meet when it is folded."""
    trailers = trailers_of(vehicle)
    if len(trailers) < 2:
        return
    from shapely import affinity  # late: few commands need it

    shapes = [_shape(body) for body in (vehicle, *trailers)]
    angles = [np.linspace(-each.max_hitch, each.max_hitch, FOLDS).tolist() for each in trailers]
    apart: set[tuple[int, int]] | None = None  # bodies that do not overlap while all are in line
    for hitches in [(0.0,) * len(trailers), *itertools.product(*angles)]:
        x = y = heading = 0.0
        bodies = shapes[:1]
        for trailer, shape, hitch in zip(trailers, shapes[1:], hitches, strict=True):
            heading -= hitch
            x -= trailer.hitch_length * math.cos(heading)
            y -= trailer.hitch_length * math.sin(heading)
            turned = affinity.rotate(shape, heading, origin=(0.0, 0.0), use_radians=True)
            bodies.append(affinity.translate(turned, x, y))
        pairs = [(one, other) for other in range(len(bodies)) for one in range(other - 1)]
        meet = {pair for pair in pairs if bodies[pair[0]].intersects(bodies[pair[1]])}
        apart = set(pairs) - meet if apart is None else apart
        for one, other in sorted(meet & apart):
            names = [f"trailer {k}" if k else "the vehicle in front" for k in (one, other)]
            told = ", ".join(f"{hitch:.2f}" for hitch in hitches)
            raise ValueError(
                f"has {names[0]} and {names[1]} that touch each other at hitch angles of {told} rad; "
                "give a smaller max_hitch, a longer hitch_length or shorter bodies"
            )


def scale_for(vehicle: Vehicle) -> float:
    """How many metres make one canonical metre, so that a ``vehicle`` suits canonical problems.

    It is the smallest power of two with which planners can check every box and trailers have room behind the
    start. It is 1 for the built-in vehicles.
    """
    trailers = trailers_of(vehicle)
    rear = trailers[-1].rear if trailers else vehicle.rear
    behind = (sum(trailer.hitch_length for trailer in trailers) + rear) / BEHIND_M
    scale = 2.0 ** math.ceil(math.log2(max(least_scale(vehicle), behind)))
    if not SCALES[0] <= scale <= SCALES[1]:
        longest = 2.0 * max(length for _, length, _, _ in paces(vehicle))
        raise ValueError(f"has a body {longest:g} m long; expected a few centimetres to 100 metres")
    return scale


def _polygons(body: Vehicle | Trailer) -> list[Floats]:
    half = 0.5 * body.width
    box = ((-body.rear, -half), (body.front, -half), (body.front, half), (-body.rear, half))
    return [np.array(polygon) for polygon in body.about.outline or (box,)]


def _shape(body: Vehicle | Trailer) -> Any:
    import shapely  # late: few commands need it

    return shapely.union_all([shapely.Polygon(polygon) for polygon in _polygons(body)])


def _turned(trailer: Trailer, hitch: float) -> Any:
    """A trailer behind a body whose axle is at (0, 0), at a hitch angle."""
    import shapely

    cos, sin = math.cos(-hitch), math.sin(-hitch)
    turn = np.array([[cos, sin], [-sin, cos]])
    back = np.array([-trailer.hitch_length * cos, -trailer.hitch_length * sin])
    return shapely.union_all([shapely.Polygon(polygon @ turn + back) for polygon in _polygons(trailer)])
