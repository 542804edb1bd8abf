"""Nearest neighbour in the plane by buckets, looking at a bounded number of points in each.

A linear scan is the bottleneck of a tree planner, and crowded buckets make its tails: only the newest
points of a bucket are looked at, but none is ever refused.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planners.world.jit import inlined, lean
from planners.world.problem import Floats

# one width of integer in all search buffers: another would compile each kernel twice
Indices = np.ndarray[tuple[int, ...], np.dtype[np.int64]]

BUCKETS_A_SIDE = 64
NEWEST = 16  # points looked at in a bucket


class Buckets(NamedTuple):
    """The newest points of each bucket."""

    items: Indices  # [BUCKETS_A_SIDE^2, NEWEST] point numbers, used as a ring
    counts: Indices  # [BUCKETS_A_SIDE^2] points ever put into each bucket
    frame: Floats  # [3] x_min, y_min, bucket size, metres
    points: Floats  # [C, >= 2] positions in metres, by point number


def allocate_buckets(points: Floats) -> Buckets:
    """Empty buckets over a buffer of ``points``."""
    cells = BUCKETS_A_SIDE**2
    return Buckets(np.empty((cells, NEWEST), np.int64), np.zeros(cells, np.int64), np.zeros(3), points)


@lean
def clear_buckets(buckets: Buckets, bounds: Floats, size_m: float) -> None:
    """Empty the buckets and lay them over ``bounds``, ``size_m`` wide or as wide as the bounds need."""
    buckets.counts.fill(0)
    buckets.frame[0] = bounds[0]
    buckets.frame[1] = bounds[1]
    widest = max(bounds[2] - bounds[0], bounds[3] - bounds[1])
    buckets.frame[2] = max(size_m, widest / BUCKETS_A_SIDE)


@inlined
def bucket_index(offset: float, size: float) -> int:
    """Row or column of a coordinate, clipped to the grid."""
    return min(max(int(offset / size), 0), BUCKETS_A_SIDE - 1)


@inlined
def put(buckets: Buckets, item: int) -> None:
    """Add point ``item``."""
    column = bucket_index(buckets.points[item, 0] - buckets.frame[0], buckets.frame[2])
    row = bucket_index(buckets.points[item, 1] - buckets.frame[1], buckets.frame[2])
    cell = row * BUCKETS_A_SIDE + column
    buckets.items[cell, buckets.counts[cell] % NEWEST] = item
    buckets.counts[cell] += 1


@lean
def remove(buckets: Buckets, item: int) -> None:
    """Take point ``item`` out, if it is still among the newest of its bucket."""
    column = bucket_index(buckets.points[item, 0] - buckets.frame[0], buckets.frame[2])
    row = bucket_index(buckets.points[item, 1] - buckets.frame[1], buckets.frame[2])
    cell = row * BUCKETS_A_SIDE + column
    kept = min(buckets.counts[cell], NEWEST)
    for k in range(kept):
        if buckets.items[cell, k] == item:
            buckets.items[cell, k] = buckets.items[cell, kept - 1]
            buckets.counts[cell] = kept - 1
            return


@lean
def nearest(buckets: Buckets, x: float, y: float) -> int:
    """The nearest point among the newest of each bucket; -1 when there is none."""
    size = buckets.frame[2]
    column = bucket_index(x - buckets.frame[0], size)
    row = bucket_index(y - buckets.frame[1], size)
    best = -1
    best_squared = math.inf
    for ring in range(BUCKETS_A_SIDE):
        for r in range(max(row - ring, 0), min(row + ring, BUCKETS_A_SIDE - 1) + 1):
            on_edge = r == row - ring or r == row + ring
            stride = 1 if on_edge or ring == 0 else 2 * ring
            for c in range(column - ring, column + ring + 1, stride):
                if c < 0 or c >= BUCKETS_A_SIDE:
                    continue
                cell = r * BUCKETS_A_SIDE + c
                for k in range(min(buckets.counts[cell], NEWEST)):
                    item = buckets.items[cell, k]
                    dx = buckets.points[item, 0] - x
                    dy = buckets.points[item, 1] - y
                    squared = dx * dx + dy * dy
                    if squared < best_squared:
                        best_squared = squared
                        best = item
        if best_squared <= (ring * size) ** 2:
            break
    return best


@lean
def nearest_k(buckets: Buckets, x: float, y: float, items: Indices, distances: Floats) -> int:
    """Fill ``items`` and ``distances`` (both ``[k]``, nearest first); returns how many there are."""
    size = buckets.frame[2]
    column = bucket_index(x - buckets.frame[0], size)
    row = bucket_index(y - buckets.frame[1], size)
    k = items.shape[0]
    found = 0
    for ring in range(BUCKETS_A_SIDE):
        for r in range(max(row - ring, 0), min(row + ring, BUCKETS_A_SIDE - 1) + 1):
            on_edge = r == row - ring or r == row + ring
            stride = 1 if on_edge or ring == 0 else 2 * ring
            for c in range(column - ring, column + ring + 1, stride):
                if c < 0 or c >= BUCKETS_A_SIDE:
                    continue
                cell = r * BUCKETS_A_SIDE + c
                for n in range(min(buckets.counts[cell], NEWEST)):
                    item = buckets.items[cell, n]
                    distance = math.hypot(buckets.points[item, 0] - x, buckets.points[item, 1] - y)
                    if found == k and distance >= distances[k - 1]:
                        continue
                    place = min(found, k - 1)
                    while place > 0 and distances[place - 1] > distance:
                        distances[place] = distances[place - 1]
                        items[place] = items[place - 1]
                        place -= 1
                    distances[place] = distance
                    items[place] = item
                    found = min(found + 1, k)
        if found == k and distances[k - 1] <= ring * size:
            break
    return found
