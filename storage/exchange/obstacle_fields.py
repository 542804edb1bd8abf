"""The fields of a problem that describe its obstacles: polygons, and which of them belong together."""

from __future__ import annotations

from itertools import chain
from typing import Any

import numpy as np

from planners.world.arrays import Floats
from storage.fields import number_of


def groups_of(groups: object, polygons: int) -> list[int] | None:
    """How many of the ``polygons`` each obstacle has, as a field says, or None if it says nothing.

    Raises ValueError, which says what is wrong with the field.
    """
    if groups is None:
        return None
    if not isinstance(groups, list) or not all(type(size) is int and size > 0 for size in groups):
        raise ValueError("groups must be numbers of polygons above 0; correct them or leave them out")
    if sum(groups) != polygons:
        raise ValueError(
            f"groups add up to {sum(groups)} polygons, but obstacles has {polygons}; make them agree"
        )
    return groups


def points_of(polygons: list[Any]) -> Floats:
    """The points ``[m, 2]`` of all polygons, one after another.

    Raises ValueError, which says what is wrong with one of them.
    """
    if set(map(type, polygons)) <= {list}:
        corners = list(chain.from_iterable(polygons))
        if set(map(type, corners)) <= {list} and set(map(len, corners)) <= {2}:
            numbers = list(chain.from_iterable(corners))
            if set(map(type, numbers)) <= {float, int}:
                try:
                    return np.array(numbers, np.float64).reshape(-1, 2)
                except OverflowError:  # an integer beyond all floats
                    pass
    return np.concatenate([_polygon(polygon, i) for i, polygon in enumerate(polygons, start=1)])


def _polygon(points: object, number: int) -> Floats:
    """The points ``[m, 2]`` of one polygon. Raises ValueError, which says what is wrong with them."""
    if not isinstance(points, list) or not all(
        isinstance(point, list) and len(point) == 2 for point in points
    ):
        raise ValueError(f"obstacle {number} must be a list of points [x, y] in metres; correct it")
    return np.array([[number_of(x, "a point"), number_of(y, "a point")] for x, y in points]).reshape(-1, 2)
