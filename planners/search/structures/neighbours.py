"""Nearest neighbours in the plane by buckets that remember only their newest points.

A linear scan would be the bottleneck of a tree planner, and crowded buckets would make some searches slow. So
each bucket compares only its newest points, but every new point is taken.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planners.world.arrays import Floats, Indices
from planners.world.jit import inlined, lean
from planners.world.trigonometry import length

BUCKETS_A_SIDE = 64
NEWEST = 16  # points that a bucket remembers


class Buckets(NamedTuple):
    """The newest points of each bucket."""

    items: Indices  # [BUCKETS_A_SIDE^2, NEWEST] point numbers, used as a ring
    positions: Floats  # [BUCKETS_A_SIDE^2, NEWEST, 2] of these points, metres
    counts: Indices  # [BUCKETS_A_SIDE^2] points ever put into each bucket
    frame: Floats  # [3] x_min, y_min, bucket size, metres
    extent: Indices  # [4] first and last column, first and last row that hold points


def allocate_buckets() -> Buckets:
    """Buffers for buckets."""
    cells = BUCKETS_A_SIDE**2
    return Buckets(
        np.empty((cells, NEWEST), np.int64),
        np.empty((cells, NEWEST, 2)),
        np.zeros(cells, np.int64),
        np.zeros(3),
        np.zeros(4, np.int64),
    )


@lean
def clear_buckets(buckets: Buckets, bounds: Floats, size_m: float) -> None:
    """Empty the buckets and lay them over ``bounds [4]``, at least ``size_m`` metres wide each."""
    buckets.counts.fill(0)
    buckets.frame[0] = bounds[0]
    buckets.frame[1] = bounds[1]
    widest = max(bounds[2] - bounds[0], bounds[3] - bounds[1])
    buckets.frame[2] = max(size_m, widest / BUCKETS_A_SIDE)
    for side in range(2):
        buckets.extent[2 * side] = BUCKETS_A_SIDE
        buckets.extent[2 * side + 1] = -1


@inlined
def bucket_index(offset: float, size: float) -> int:
    """The row or column of a coordinate, clipped to the grid."""
    return min(max(int(offset / size), 0), BUCKETS_A_SIDE - 1)


@inlined
def put(buckets: Buckets, item: int, x: float, y: float) -> None:
    """Add point ``item`` at (x, y)."""
    column = bucket_index(x - buckets.frame[0], buckets.frame[2])
    row = bucket_index(y - buckets.frame[1], buckets.frame[2])
    cell = row * BUCKETS_A_SIDE + column
    slot = buckets.counts[cell] % NEWEST
    buckets.items[cell, slot] = item
    buckets.positions[cell, slot, 0] = x
    buckets.positions[cell, slot, 1] = y
    buckets.counts[cell] += 1
    extent = buckets.extent
    extent[0] = min(extent[0], column)
    extent[1] = max(extent[1], column)
    extent[2] = min(extent[2], row)
    extent[3] = max(extent[3], row)


@lean
def remove(buckets: Buckets, item: int, x: float, y: float) -> None:
    """Take out point ``item`` at (x, y), if its bucket still remembers it."""
    column = bucket_index(x - buckets.frame[0], buckets.frame[2])
    row = bucket_index(y - buckets.frame[1], buckets.frame[2])
    cell = row * BUCKETS_A_SIDE + column
    kept = min(buckets.counts[cell], NEWEST)
    for k in range(kept):
        if buckets.items[cell, k] == item:
            buckets.items[cell, k] = buckets.items[cell, kept - 1]
            buckets.positions[cell, k, 0] = buckets.positions[cell, kept - 1, 0]
            buckets.positions[cell, k, 1] = buckets.positions[cell, kept - 1, 1]
            buckets.counts[cell] = kept - 1
            return


@inlined
def first_ring(buckets: Buckets, column: int, row: int) -> int:
    """The number of the first square ring of buckets around (column, row) that can hold a point."""
    extent = buckets.extent
    return int(max(extent[0] - column, column - extent[1], extent[2] - row, row - extent[3], 0))


@inlined
def _nearest(buckets: Buckets, x: float, y: float) -> tuple[int, float, float]:
    """The nearest point, its squared distance, and a lower bound of the squared distance of all others."""
    size = buckets.frame[2]
    column = bucket_index(x - buckets.frame[0], size)
    row = bucket_index(y - buckets.frame[1], size)
    extent = buckets.extent
    best = -1
    best_squared = math.inf
    next_squared = math.inf
    for ring in range(first_ring(buckets, column, row), BUCKETS_A_SIDE):
        for r in range(max(row - ring, extent[2]), min(row + ring, extent[3]) + 1):
            on_edge = r == row - ring or r == row + ring
            stride = 1 if on_edge else 2 * ring
            left = max(column - ring, extent[0]) if on_edge else column - ring
            for c in range(left, min(column + ring, extent[1]) + 1, stride):
                if c < extent[0]:
                    continue
                cell = r * BUCKETS_A_SIDE + c
                for k in range(min(buckets.counts[cell], NEWEST)):
                    dx = buckets.positions[cell, k, 0] - x
                    dy = buckets.positions[cell, k, 1] - y
                    squared = dx * dx + dy * dy
                    if squared < best_squared:
                        next_squared = best_squared
                        best_squared = squared
                        best = buckets.items[cell, k]
                    elif squared < next_squared:
                        next_squared = squared
        if best_squared <= (ring * size) ** 2:
            next_squared = min(next_squared, (ring * size) ** 2)
            break
    return best, best_squared, next_squared


@lean
def nearest(buckets: Buckets, x: float, y: float) -> int:
    """The nearest point that a bucket remembers; -1 if there is none."""
    return _nearest(buckets, x, y)[0]


@lean
def nearest_for(buckets: Buckets, x: float, y: float) -> tuple[int, float]:
    """The nearest point, and how far (metres) from (x, y) it certainly stays the nearest."""
    best, best_squared, next_squared = _nearest(buckets, x, y)
    return best, 0.5 * (math.sqrt(next_squared) - math.sqrt(best_squared))


@lean
def nearest_k(buckets: Buckets, x: float, y: float, items: Indices, distances: Floats) -> int:
    """Fill in ``items [k]`` and ``distances [k]`` (metres), nearest first. Returns how many there are."""
    size = buckets.frame[2]
    column = bucket_index(x - buckets.frame[0], size)
    row = bucket_index(y - buckets.frame[1], size)
    extent = buckets.extent
    k = items.shape[0]
    filled = 0
    for ring in range(first_ring(buckets, column, row), BUCKETS_A_SIDE):
        for r in range(max(row - ring, extent[2]), min(row + ring, extent[3]) + 1):
            on_edge = r == row - ring or r == row + ring
            stride = 1 if on_edge else 2 * ring
            left = max(column - ring, extent[0]) if on_edge else column - ring
            for c in range(left, min(column + ring, extent[1]) + 1, stride):
                if c < extent[0]:
                    continue
                cell = r * BUCKETS_A_SIDE + c
                for n in range(min(buckets.counts[cell], NEWEST)):
                    distance = length(buckets.positions[cell, n, 0] - x, buckets.positions[cell, n, 1] - y)
                    if filled == k and distance >= distances[k - 1]:
                        continue
                    slot = min(filled, k - 1)
                    while slot > 0 and distances[slot - 1] > distance:
                        distances[slot] = distances[slot - 1]
                        items[slot] = items[slot - 1]
                        slot -= 1
                    distances[slot] = distance
                    items[slot] = buckets.items[cell, n]
                    filled = min(filled + 1, k)
        if filled == k and distances[k - 1] <= ring * size:
            break
    return filled
