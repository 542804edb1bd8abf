"""Room around places and along straight ways."""

from __future__ import annotations

import math

from planners.world.geometry.collision import NORMAL_X, NORMAL_Y, OFFSET, REACH_M, Scene, X, Y, box_is_free
from planners.world.jit import lean
from planners.world.trigonometry import length


@lean
def clearance(x: float, y: float, limit: float, scene: Scene) -> float:
    """Distance in metres from a point to the nearest obstacle or bound, at most ``limit``."""
    bounds = scene.bounds
    best = min(limit, x - bounds[0], bounds[2] - x, y - bounds[1], bounds[3] - y)
    edges = scene.edges
    starts = scene.piece_starts
    for p in range(starts.shape[0] - 1):
        outside = -math.inf  # the largest edge distance is a lower bound of the distance to the piece
        edge = starts[p]
        for i in range(starts[p], starts[p + 1]):
            gap = edges[i, NORMAL_X] * x + edges[i, NORMAL_Y] * y - edges[i, OFFSET]
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
        ex = edges[other, X] - edges[edge, X]
        ey = edges[other, Y] - edges[edge, Y]
        dx = x - edges[edge, X]
        dy = y - edges[edge, Y]
        share = min(max((dx * ex + dy * ey) / (ex * ex + ey * ey), 0.0), 1.0)
        best = min(best, length(dx - share * ex, dy - share * ey))
    return float(max(best, 0.0))


@lean
def strip_is_free(
    ax: float, ay: float, bx: float, by: float, half_width: float, scene: Scene
) -> tuple[bool, int]:
    """Whether a strip from a to b is free, and how many boxes, short enough for the scene, were checked."""
    way = length(bx - ax, by - ay)
    if way == 0.0:
        return True, 0
    cos = (bx - ax) / way
    sin = (by - ay) / way
    longest = 1.9 * math.sqrt(REACH_M * REACH_M - half_width * half_width)
    pieces = math.ceil(way / longest)
    half = 0.5 * way / pieces
    for i in range(pieces):
        along = (2 * i + 1) * half
        if not box_is_free(ax + along * cos, ay + along * sin, cos, sin, half, half_width, scene):
            return False, i + 1
    return True, pieces
