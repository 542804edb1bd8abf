"""The encoder's ranking: the stored plans that score best for an embedding.

Both training objectives rank by an inner product and a bias, one row a plan: for the triplet objective
``w = c, b = -|c|^2 / 2``, whose order is that of the distance to the centroids; for the label objective the
learned vector and bias. Row 0 stands for "no stored plan is free": where it scores best, nothing is recalled.
"""

from __future__ import annotations

import numpy as np

from planners.world.arrays import Floats32, Integers
from planners.world.jit import inlined, lean

MOST_INSERTED = 1024  # plans that are kept sorted one by one: with more, sorting all is faster


@inlined
def insert(item: int, score: float, found: int, items: Integers, scores: Floats32) -> int:
    """Put an item among the ``found`` best, if it is; how many there are then. Equal ones stay in order."""
    if found == items.shape[0] and not score > scores[found - 1]:
        return found
    place = min(found, items.shape[0] - 1)
    while place > 0 and score > scores[place - 1]:
        scores[place] = scores[place - 1]
        items[place] = items[place - 1]
        place -= 1
    scores[place] = score
    items[place] = item
    return min(found + 1, items.shape[0])


@lean
def _select(scores: Floats32, biases: Floats32, best: Integers, highest: Floats32) -> tuple[int, bool]:
    """Fill ``best [k]`` with the plans that score highest; how many, and whether row 0 scores higher."""
    found = 0
    nothing = scores[0] + biases[0]
    for row in range(1, scores.shape[0]):
        found = insert(row - 1, scores[row] + biases[row], found, best, highest)
    return found, found == 0 or nothing > highest[0]


def best_plans(
    vectors: Floats32, biases: Floats32, embedding: Floats32, k: int, never_none: bool = False
) -> Integers:
    """The (at most) ``k`` plans with the best scores for an embedding ``[D]``, best first.

    ``vectors [N + 1, D]`` and ``biases [N + 1]`` are a memory's readout. None where row 0 scores best, unless
    ``never_none``. ValueError: k below 1.
    """
    if k < 1:
        raise ValueError(f"top k is {k}, it must be at least 1")
    k = min(k, len(biases) - 1)
    if k == 0:
        return np.empty(0, np.int32)
    if k > MOST_INSERTED:
        scores = vectors @ embedding + biases
        sorted_plans = np.argsort(-scores[1:], kind="stable")[:k].astype(np.int32)
        return sorted_plans if never_none or scores[0] <= scores[1 + sorted_plans[0]] else sorted_plans[:0]
    best = np.empty(k, np.int32)
    found, nothing = _select(vectors @ embedding, biases, best, np.empty(k, np.float32))
    return best[:0] if nothing and not never_none else best[:found]
