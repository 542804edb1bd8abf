"""Room around places and along straight ways."""

from __future__ import annotations

import math

from planners.world.collision import REACH_M, Scene, box_is_free
from planners.world.jit import jit


@jit
def clearance(x: float, y: float, limit: float, scene: Scene) -> float:
    """Distance in metres from a point to the nearest obstacle or bound, at most ``limit``."""
    bounds = scene.bounds
    best = min(limit, x - bounds[0], bounds[2] - x, y - bounds[1], bounds[3] - y)
    vertices = scene.vertices
    starts = scene.piece_starts
    for p in range(starts.shape[0] - 1):
        outside = -math.inf  # the largest edge distance is a lower bound of the distance to the piece
        edge = starts[p]
        for i in range(starts[p], starts[p + 1]):
            gap = scene.normals[i, 0] * x + scene.normals[i, 1] * y - scene.offsets[i]
            if gap > outside:
                outside = gap
                edge = i
                if outside >= best:
                    break
        if outside >= best:
            continue
        if outside <= 0.0:
            return 0.0
        # beyond an end of that edge a corner is nearer still: measure to the edge itself
        other = edge + 1 if edge + 1 < starts[p + 1] else starts[p]
        ex = vertices[other, 0] - vertices[edge, 0]
        ey = vertices[other, 1] - vertices[edge, 1]
        dx = x - vertices[edge, 0]
        dy = y - vertices[edge, 1]
        share = min(max((dx * ex + dy * ey) / (ex * ex + ey * ey), 0.0), 1.0)
        best = min(best, math.hypot(dx - share * ex, dy - share * ey))
    return float(max(best, 0.0))


@jit
def strip_is_free(
    ax: float, ay: float, bx: float, by: float, half_width: float, scene: Scene
) -> tuple[bool, int]:
    """Whether a strip from a to b is free, and how many boxes, short enough for the scene, were checked."""
    length = math.hypot(bx - ax, by - ay)
    if length == 0.0:
        return True, 0
    cos = (bx - ax) / length
    sin = (by - ay) / length
    longest = 1.9 * math.sqrt(REACH_M * REACH_M - half_width * half_width)
    pieces = math.ceil(length / longest)
    half = 0.5 * length / pieces
    for i in range(pieces):
        along = (2 * i + 1) * half
        if not box_is_free(ax + along * cos, ay + along * sin, cos, sin, half, half_width, scene):
            return False, i + 1
    return True, pieces
