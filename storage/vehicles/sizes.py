"""How the sizes, limits and step of a vehicle must fit together, and the scale that follows from them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from planners.world.arrays import Floats
from planners.world.vehicles.reach import least_scale, paces
from planners.world.vehicles.vehicle import DifferentialDrive, Trailer, Vehicle, trailers_of

BEHIND_M: Final = 8.0  # room for trailers behind the start of canonical problems
SCALES: Final = (2.0**-6, 2.0**6)
ANGLES: Final = 41  # hitch angles at which bodies may not meet
FOLDS: Final = 7  # of each hitch, where there are several between two bodies


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
    trailers = trailers_of(vehicle)
    chains = itertools.combinations_with_replacement(range(len(trailers)), 2)
    for first, last in sorted(chains, key=lambda ends: ends[1] - ends[0]):  # neighbours first
        _check_apart(trailers[first - 1] if first else vehicle, trailers[first : last + 1], last + 1)


def _check_apart(ahead: Vehicle | Trailer, chain: Sequence[Trailer], number: int) -> None:
    """Raise ValueError, the end of a sentence, if a body meets the last of a chain of trailers behind it.

    Where they overlap in line they may: a semi-trailer lies on the tractor that carries it. ``number`` is
    that of the last trailer.
    """
    shape, count = _shape(ahead), ANGLES if len(chain) == 1 else FOLDS
    if shape.intersects(_behind(chain, [0.0] * len(chain))):
        return
    for hitches in itertools.product(
        *(np.linspace(-each.max_hitch, each.max_hitch, count) for each in chain)
    ):
        if shape.intersects(_behind(chain, hitches)):
            told = (
                f"a trailer {number} that touches the body in front at a hitch angle of {abs(hitches[0]):.2f}"
            )
            if len(chain) > 1:
                first = number - len(chain)
                who = f"trailer {first}" if first else "the vehicle in front"
                angles = ", ".join(f"{hitch:.2f}" for hitch in hitches)
                told = f"{who} and trailer {number} that touch each other at hitch angles of {angles}"
            raise ValueError(
                f"has {told} rad; give a smaller max_hitch, a longer hitch_length or shorter bodies"
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


def _behind(chain: Sequence[Trailer], hitches: Sequence[float]) -> Any:
    """The last of some trailers behind a body whose axle is at (0, 0), at their hitch angles."""
    import shapely

    back, heading = np.zeros(2), 0.0
    for trailer, hitch in zip(chain, hitches, strict=True):
        heading -= hitch
        cos, sin = math.cos(heading), math.sin(heading)
        back -= trailer.hitch_length * np.array([cos, sin])
    turn = np.array([[cos, sin], [-sin, cos]])
    return shapely.union_all([shapely.Polygon(polygon @ turn + back) for polygon in _polygons(chain[-1])])
