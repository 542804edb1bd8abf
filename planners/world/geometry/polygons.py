"""Cuts simple polygons of any kind into convex pieces, without moving a vertex."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import shapely

from planners.world.arrays import Flags, Floats, Indices, Integers
from planners.world.jit import inlined, jit, lean
from planners.world.problem import Obstacles, counter_clockwise

Corner = tuple[float, ...]

LARGEST_COORDINATE_M: Final = 10_000.0  # up to here float32 is exact to 1 mm
SURE_TURN_M2: Final = 1e-6  # far more than rounding can make of a straight angle


class PolygonError(ValueError):
    """Says what is wrong with a polygon and what to do, as the end of a sentence that names the polygon."""


def cut_polygons(points: Floats, starts: Indices | Integers) -> Obstacles:
    """Cut simple polygons into convex pieces, as ``convex_pieces`` does, those that are convex in one go.

    Args:
        points: ``[m, 2]`` metres, of all polygons one after another.
        starts: ``[n + 1]`` polygon i owns ``points[starts[i] : starts[i + 1]]``.

    Returns:
        Each polygon as an obstacle.

    Raises:
        PolygonError: As for ``convex_pieces``. The message names the polygon, "obstacle 1" being the first.
    """
    points, starts = np.ascontiguousarray(points, np.float64), np.asarray(starts, np.int64)
    vertices, piece_starts, convex = _convex_polygons(points, starts)
    if convex.all():
        return Obstacles(vertices, piece_starts, np.arange(len(starts), dtype=np.int32))
    pieces: list[Floats] = []
    piece_counts = []
    for i, whole in enumerate(convex.tolist()):
        if whole:
            cut = [vertices[piece_starts[i] : piece_starts[i + 1]]]
        else:
            try:
                cut = convex_pieces(points[starts[i] : starts[i + 1]])
            except PolygonError as error:
                raise PolygonError(f"obstacle {i + 1} {error}") from None
        pieces += cut
        piece_counts.append(len(cut))
    return Obstacles(
        np.concatenate(pieces),
        np.cumsum([0] + [len(piece) for piece in pieces], dtype=np.int32),
        np.cumsum([0, *piece_counts], dtype=np.int32),
    )


@jit
def _convex_polygons(points: Floats, starts: Indices) -> tuple[Floats, Integers, Flags]:
    """The vertices ``[V, 2]`` and starts ``[n + 1]`` of convex polygons, and which ``[n]`` surely are convex.

    The vertices are rounded to float32, counter-clockwise, and none is repeated. Polygons that may be
    anything else are left out. One whose every corner turns left is convex if its edges go round only once.
    """
    count = starts.shape[0] - 1
    vertices = np.empty((points.shape[0], 2))
    piece_starts = np.zeros(count + 1, np.int32)
    convex = np.zeros(count, np.bool_)
    end = 0
    for p in range(count):
        first = starts[p]
        last = starts[p + 1]
        corners = 0
        usable = last - first >= 3
        for i in range(first, last):
            j = i + 1 if i + 1 < last else first
            usable &= abs(points[i, 0]) <= LARGEST_COORDINATE_M and abs(points[i, 1]) <= LARGEST_COORDINATE_M
            x = np.float64(np.float32(points[i, 0]))
            y = np.float64(np.float32(points[i, 1]))
            if x != np.float64(np.float32(points[j, 0])) or y != np.float64(np.float32(points[j, 1])):
                vertices[end + corners, 0] = x
                vertices[end + corners, 1] = y
                corners += 1
        if usable and corners >= 3:
            convex[p] = _goes_round(vertices, end, corners)
        if convex[p]:
            end += corners
        piece_starts[p + 1] = end
    return vertices[:end], piece_starts, convex


@lean
def _goes_round(vertices: Floats, first: int, corners: int) -> bool:
    """Whether a polygon surely is convex. Its vertices are turned round if they are clockwise."""
    least = math.inf
    most = -math.inf
    rounds = 0
    dx = vertices[first, 0] - vertices[first + corners - 1, 0]
    dy = vertices[first, 1] - vertices[first + corners - 1, 1]
    for i in range(first, first + corners):
        j = i + 1 if i + 1 < first + corners else first
        next_dx = vertices[j, 0] - vertices[i, 0]
        next_dy = vertices[j, 1] - vertices[i, 1]
        turn = dx * next_dy - dy * next_dx
        least = min(least, turn)
        most = max(most, turn)
        rounds += _leads_up(dx, dy) and not _leads_up(next_dx, next_dy)
        dx = next_dx
        dy = next_dy
    if rounds != 1 or (least <= SURE_TURN_M2 and most >= -SURE_TURN_M2):
        return False
    if most < 0.0:
        for k in range(corners // 2):
            i = first + k
            j = first + corners - 1 - k
            for axis in range(2):
                vertices[i, axis], vertices[j, axis] = vertices[j, axis], vertices[i, axis]
    return True


@inlined
def _leads_up(dx: float, dy: float) -> bool:
    return dy > 0.0 or (dy == 0.0 and dx > 0.0)


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
            f"reaches farther from the start than {LARGEST_COORDINATE_M:.0f} m times the scale; is it in "
            "metres? What lies outside the bounds may be left out"
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
