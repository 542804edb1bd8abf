"""Dijkstra's search over the cells of a map: how far each is from one of them, and which comes next.

Cells wait in buckets by how many whole cells they are away. No step is shorter than a bucket is wide, so the
cells of the nearest bucket are settled in any order, and no heap is needed (Denardo and Fox, "Shortest-route
methods: 1. Reaching, pruning, and buckets", Operations Research 27(1), 1979).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from planners.world.arrays import Floats, Integers
from planners.world.jit import jit

OCCUPIED: Final = -1  # the part of the map that a cell belongs to which is not free
_STEPS: Final = ((0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, -1), (-1, 1))  # row, column
_DIAGONAL: Final = math.sqrt(2.0)
_BUCKETS: Final = 3  # a diagonal step leads at most two buckets on
_ROUNDING: Final = 1e-9  # ways whose lengths differ by no more are equally long


@jit
def distances_to(goal: int, parts: Integers) -> tuple[Floats, Integers]:
    """Find the shortest ways to a cell. A diagonal step needs the cells on both sides free.

    Args:
        goal: number of the cell, counted row by row.
        parts: ``[rows, columns]`` which part of the map each cell belongs to, or ``OCCUPIED``, as all at the
            border have to be. No way leads from one part to another.

    Returns:
        ``[rows * columns]`` how far each cell is from the goal, in cells (infinite: no way leads there), and
        the next cell on the way (-1: none).
    """
    columns = parts.shape[1]
    part = parts.ravel()
    far = np.full(part.size, math.inf)
    after = np.full(part.size, -1, np.int32)
    waiting = np.empty((_BUCKETS, part.size), np.int32)
    counts = np.zeros(_BUCKETS, np.int64)
    far[goal] = 0.0
    if part[goal] == OCCUPIED:
        return far, after
    waiting[0, 0] = goal
    counts[0] = 1
    whole = 0
    while counts.sum() > 0:
        bucket = whole % _BUCKETS
        for entry in range(counts[bucket]):
            cell = waiting[bucket, entry]
            if far[cell] < whole:
                continue  # settled since, from a nearer bucket
            for k in range(len(_STEPS)):
                down, right = _STEPS[k]
                other = cell + down * columns + right
                if part[other] != part[cell]:
                    continue
                is_diagonal = down != 0 and right != 0
                if is_diagonal and (
                    part[cell + down * columns] == OCCUPIED or part[cell + right] == OCCUPIED
                ):
                    continue
                there = far[cell] + (_DIAGONAL if is_diagonal else 1.0)
                if there < far[other] - _ROUNDING:
                    into = int(there)
                    if far[other] == math.inf or int(far[other]) != into:
                        waiting[into % _BUCKETS, counts[into % _BUCKETS]] = other
                        counts[into % _BUCKETS] += 1
                    far[other] = there
                    after[other] = cell
        counts[bucket] = 0
        whole += 1
    return far, after
