"""Cuts simple polygons of any kind into convex pieces, without moving a vertex."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import shapely

from planners.world.arrays import Floats
from planners.world.problem import counter_clockwise

Corner = tuple[float, ...]

LARGEST_COORDINATE_M: Final = 10_000.0  # up to here float32 is exact to 1 mm
SURE_TURN_M2: Final = 1e-6  # far more than rounding can make of a straight angle


class PolygonError(ValueError):
    """Says what is wrong with a polygon and what to do, as the end of a sentence that names the polygon."""


def convex_pieces(polygon: Floats) -> list[Floats]:
    """Cut a simple polygon into convex pieces.

    Vertices are rounded to float32 first, and none is added. A convex polygon is its own only piece. Others
    are triangulated, and triangles are joined as long as they stay convex (Hertel and Mehlhorn 1983).

    Args:
        polygon: ``[m, 2]`` metres, in any orientation.

    Returns:
        Counter-clockwise pieces ``[n, 2]``, which cover the polygon.

    Raises:
        PolygonError: The polygon has fewer than 3 points or no area, crosses itself, or has coordinates that
            are not finite or too large.
    """
    corners = counter_clockwise(_corners(polygon))
    if len(corners) <= 4 and _turns(corners).min() > SURE_TURN_M2:  # five such points can make a star
        return [corners]
    shape = shapely.Polygon(corners)
    if shape.convex_hull.area == 0.0:
        raise PolygonError("has no area; remove it or move a point")
    if not shape.is_valid:
        reason = shapely.is_valid_reason(shape).partition("[")[0].lower()
        raise PolygonError(f"crosses or touches itself ({reason}); draw it as a simple polygon")
    return [corners] if _is_convex(corners) else joined_triangles(shape)


def joined_triangles(shape: shapely.Polygon) -> list[Floats]:
    """Cut a valid polygon, which may have holes, into convex pieces ``[n, 2]`` without a new vertex."""
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(shape))
    pieces = [counter_clockwise(shapely.get_coordinates(triangle)[:-1]) for triangle in triangles]
    return _joined([piece for piece in pieces if _is_convex(piece)])


def _corners(polygon: Floats) -> Floats:
    """Round a polygon to float32 and leave out repeated points."""
    if len(polygon) < 3:
        raise PolygonError(f"has {len(polygon)} points, expected at least 3; complete or remove it")
    farthest = float(np.abs(polygon).max())
    if not math.isfinite(farthest):
        raise PolygonError("has a coordinate that is not a finite number; correct it")
    if farthest > LARGEST_COORDINATE_M:
        raise PolygonError(
            f"reaches farther than {LARGEST_COORDINATE_M:.0f} m from the origin; "
            "move the origin near the start"
        )
    rounded = polygon.astype(np.float32).astype(np.float64)
    corners: Floats = rounded[(rounded != _after(rounded)).any(axis=1)]
    if len(corners) < 3:
        raise PolygonError("has no area; remove it or move a point")
    return corners


def _is_convex(corners: Floats) -> bool:
    """Whether a simple counter-clockwise polygon with area is convex. Straight angles are allowed."""
    turns = _turns(corners)
    return bool((turns >= 0.0).all() and (turns > 0.0).any())


def _turns(corners: Floats) -> Floats:
    """The cross product of each edge with the next one, in square metres: above 0 for a left turn."""
    edges = _after(corners) - corners
    after = _after(edges)
    turns: Floats = edges[:, 0] * after[:, 1] - edges[:, 1] * after[:, 0]
    return turns


def _after(corners: Floats) -> Floats:
    """The next corner of each corner; ``np.roll`` takes ten times as long."""
    return np.concatenate((corners[1:], corners[:1]))


def _joined(pieces: list[Floats]) -> list[Floats]:
    """Join neighbouring pieces over their common edges, one edge after another, if the union is convex."""
    loops = [[tuple(corner) for corner in piece.tolist()] for piece in pieces]
    owner = {edge: i for i, loop in enumerate(loops) for edge in _edges(loop)}
    for begin, end in list(owner):
        i, j = owner[begin, end], owner.get((end, begin))
        if j is None or i == j:
            continue
        first, second = loops[i], loops[j]
        at = first.index(end)
        there = second.index(begin)
        union = first[at:] + first[:at] + (second[there:] + second[:there])[1:-1]
        joint = len(first) - 1  # the union begins at one end of the common edge; the other end is here
        if (
            len(set(union)) == len(union)
            and _turns_left(union[-1], union[0], union[1])
            and _turns_left(union[joint - 1], union[joint], union[(joint + 1) % len(union)])
        ):
            loops[i], loops[j] = union, []
            owner.update((edge, i) for edge in _edges(second))
    return [np.array(loop) for loop in loops if loop]


def _turns_left(before: Corner, corner: Corner, after: Corner) -> bool:
    """Whether the outline turns left or goes straight on at ``corner``."""
    to, on = (corner[0] - before[0], corner[1] - before[1]), (after[0] - corner[0], after[1] - corner[1])
    return to[0] * on[1] - to[1] * on[0] >= 0.0


def _edges(loop: list[Corner]) -> list[tuple[Corner, Corner]]:
    return list(zip(loop, [*loop[1:], loop[0]], strict=True))
