"""Clearance around points and along straight lines."""

from __future__ import annotations

import math

from planners.world.geometry.collision import NORMAL_X, NORMAL_Y, OFFSET, Scene, X, Y, box_is_free
from planners.world.jit import lean
from planners.world.trigonometry import gap_to_segment, length
from planners.world.vehicles.reach import REACH_M


@lean
def clearance(x: float, y: float, limit: float, scene: Scene) -> float:
    """Distance in metres from a point to the nearest obstacle or bound, at most ``limit``."""
    bounds = scene.bounds
    best = min(limit, x - bounds[0], bounds[2] - x, y - bounds[1], bounds[3] - y)
    edges = scene.edges
    starts = scene.piece_starts
    for p in range(starts.shape[0] - 1):
        outside = -math.inf  # the largest distance to an edge's line: at most the distance to the piece
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
        # beyond an end of that edge its corner is nearest: measure the distance to the edge itself
        other = edge + 1 if edge + 1 < starts[p + 1] else starts[p]
        gap_x, gap_y = gap_to_segment(x, y, edges[edge, X], edges[edge, Y], edges[other, X], edges[other, Y])
        best = min(best, length(gap_x, gap_y))
    return float(max(best, 0.0))


@lean
def strip_is_free(
    ax: float, ay: float, bx: float, by: float, half_width: float, scene: Scene
) -> tuple[bool, int]:
    """Whether a strip from a to b is free, and how many boxes were checked, each short enough for a scene."""
    metres = length(bx - ax, by - ay)
    if metres == 0.0:
        return True, 0
    cos = (bx - ax) / metres
    sin = (by - ay) / metres
    longest = 1.9 * math.sqrt(REACH_M * REACH_M - half_width * half_width)
    pieces = math.ceil(metres / longest)
    half = 0.5 * metres / pieces
    for i in range(pieces):
        along = (2 * i + 1) * half
        box = (ax + along * cos, ay + along * sin, cos, sin, half, half_width)
        if not box_is_free(box, scene):
            return False, i + 1
    return True, pieces
