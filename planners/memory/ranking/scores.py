"""The encoder's ranking: finds the stored plans that score best.

Both training objectives score by an inner product and a bias, one row for each plan. For the triplet
objective ``w = c, b = -|c|^2 / 2``, which orders by the distance to the centroids; for the label objective
both are learned, and the blocked cells of a plan count as well (``Memory.scores``). Row 0 stands for "no
stored plan is free": if it scores best, nothing is recalled.
"""

from __future__ import annotations

import numpy as np

from planners.world.arrays import Floats32, Integers
from planners.world.jit import inlined, lean

MOST_INSERTED = 1024  # plans that are inserted one by one; for more, sorting all plans is faster


@inlined
def insert(item: int, score: float, count: int, items: Integers, scores: Floats32) -> int:
    """Insert an item among the ``count`` best, behind equal ones. Returns how many there are then."""
    if count == items.shape[0] and not score > scores[count - 1]:
        return count
    i = min(count, items.shape[0] - 1)
    while i > 0 and score > scores[i - 1]:
        scores[i] = scores[i - 1]
        items[i] = items[i - 1]
        i -= 1
    scores[i] = score
    items[i] = item
    return min(count + 1, items.shape[0])


@lean
def _select(scores: Floats32, best: Integers, highest: Floats32) -> tuple[int, bool]:
    """Fill in ``best [k]``, the plans that score highest: how many, and whether row 0 scores higher."""
    count = 0
    nothing = scores[0]
    for row in range(1, scores.shape[0]):
        count = insert(row - 1, scores[row], count, best, highest)
    return count, count == 0 or nothing > highest[0]


def best_plans(scores: Floats32, k: int, never_none: bool = False) -> Integers:
    """Find the plans with the best scores.

    Args:
        scores: ``[N + 1]`` of "no plan", and of N plans.
        k: how many plans to return at most.
        never_none: return plans even if row 0 scores best.

    Returns:
        Plans ``[<= k]``, best first; none if row 0 scores best.

    Raises:
        ValueError: k is below 1.
    """
    if k < 1:
        raise ValueError(f"top k is {k}, it must be at least 1")
    k = min(k, len(scores) - 1)
    if k == 0:
        return np.empty(0, np.int32)
    if k > MOST_INSERTED:
        sorted_plans = np.argsort(-scores[1:], kind="stable")[:k].astype(np.int32)
        return sorted_plans if never_none or scores[0] <= scores[1 + sorted_plans[0]] else sorted_plans[:0]
    best = np.empty(k, np.int32)
    count, nothing = _select(scores, best, np.empty(k, np.float32))
    return best[:0] if nothing and not never_none else best[:count]
