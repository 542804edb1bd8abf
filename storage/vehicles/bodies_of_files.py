"""Bodies as files describe them: convex polygons, and the box around them."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np

from planners.world.arrays import Floats
from planners.world.vehicles.vehicle import Corners, Trailer, Vehicle
from storage.fields import short
from storage.yaml_text import yaml_number

MOST_POLYGONS: Final = 16
MOST_CORNERS: Final = 32
FARTHEST_M: Final = 100.0  # of a corner from the reference point
SMALLEST_M: Final = 0.001  # side or thickness of a polygon


class Box(NamedTuple):
    """The box around a body, along its axis and as wide to the left as to the right, in metres."""

    front: float
    rear: float
    width: float


def outline_of(polygons: object, where: str) -> tuple[tuple[Corners, ...], Box]:
    """The convex polygons of a body, counter-clockwise, and the box around them.

    There are no polygons if there is just one and it is the box itself.

    Args:
        polygons: what a file holds of them: a list of lists of x, y in metres.
        where: name of the field, for messages.

    Raises:
        ValueError: the end of a sentence, if a polygon is malformed or not convex.
    """
    if not isinstance(polygons, list) or not 1 <= len(polygons) <= MOST_POLYGONS:
        raise ValueError(
            f"has {where} {short(polygons)}; expected a list of 1 to {MOST_POLYGONS} convex polygons"
        )
    outlines = [_polygon(points, f"{where} polygon {i}") for i, points in enumerate(polygons, start=1)]
    every = np.concatenate(outlines)
    (rear, _), (front, _) = -every.min(axis=0), every.max(axis=0)
    if rear < 0.0 or front < 0.0 or every[:, 1].min() > 0.0 or every[:, 1].max() < 0.0:
        raise ValueError(
            f"has a {where} that does not surround the reference point (0, 0), the middle of its axle; "
            "measure it from there"
        )
    box = Box(float(front), float(rear), float(2.0 * np.abs(every[:, 1]).max()))
    half = 0.5 * box.width
    corners = {(x, y) for x in (-box.rear, box.front) for y in (-half, half)}
    if len(outlines) == 1 and len(outlines[0]) == 4 and set(map(tuple, outlines[0].tolist())) == corners:
        return (), box
    return tuple(tuple((x, y) for x, y in outline.tolist()) for outline in outlines), box


def corners_in_file(body: Vehicle | Trailer, scale: float) -> list[list[list[float]]]:
    """The polygons of a ``body`` as a file has them, in metres of the world outside."""
    half = 0.5 * body.width
    box = ((-body.rear, -half), (body.front, -half), (body.front, half), (-body.rear, half))
    return [[[scale * x, scale * y] for x, y in polygon] for polygon in body.about.outline or (box,)]


def _polygon(points: Any, where: str) -> Floats:
    """The corners ``[n, 2]`` of a convex polygon, counter-clockwise."""
    if not isinstance(points, list) or not 3 <= len(points) <= MOST_CORNERS:
        raise ValueError(
            f"has {where} {short(points)}; expected 3 to {MOST_CORNERS} corners [x, y] in metres"
        )
    for point in points:
        if not isinstance(point, list) or len(point) != 2:
            raise ValueError(f"has the corner {short(point)} in {where}; expected [x, y] in metres")
    corners = np.array([[yaml_number(value, f"{where} corner") for value in point] for point in points])
    if not np.abs(corners).max() <= FARTHEST_M:
        raise ValueError(f"has a corner in {where} farther than {FARTHEST_M:g} m away; is it in metres?")
    sides = np.roll(corners, -1, axis=0) - corners
    lengths = np.hypot(*sides.T)
    if lengths.min() < SMALLEST_M:
        raise ValueError(f"has two corners of {where} at the same place; leave one out")
    after = np.roll(sides, -1, axis=0)
    turns = sides[:, 0] * after[:, 1] - sides[:, 1] * after[:, 0]
    angles = np.arctan2(turns, (sides * after).sum(axis=1))
    once_round = abs(abs(angles.sum()) - 2.0 * np.pi) < 1e-6
    if not once_round or not ((angles > 1e-6).all() or (angles < -1e-6).all()):
        raise ValueError(f"has {where}, which is not convex; divide it into convex polygons")
    return corners if angles.sum() > 0.0 else corners[::-1]
