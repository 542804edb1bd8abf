"""The encoder's ranking: the stored plans that score best for an embedding.

Both training objectives rank by an inner product and a bias, one row a plan: for the triplet objective
``w = c, b = -|c|^2 / 2``, whose order is that of the distance to the centroids; for the label objective the
learned vector and bias. Row 0 stands for "no stored plan is free": where it scores best, nothing is recalled.
"""

from __future__ import annotations

import numpy as np

from planners.memory.encoder import Floats32
from planners.world.jit import lean
from planners.world.problem import Integers

MOST_INSERTED = 1024  # plans that are kept sorted one by one: with more, sorting all is faster


@lean
def _select(scores: Floats32, biases: Floats32, best: Integers, highest: Floats32) -> tuple[int, bool]:
    """Fill ``best [k]`` with the plans that score highest; how many, and whether row 0 scores higher."""
    k = best.shape[0]
    found = 0
    nothing = scores[0] + biases[0]
    for row in range(1, scores.shape[0]):
        score = scores[row] + biases[row]
        if found == k and not score > highest[k - 1]:
            continue
        place = min(found, k - 1)
        while place > 0 and score > highest[place - 1]:  # equal ones in order of storing
            highest[place] = highest[place - 1]
            best[place] = best[place - 1]
            place -= 1
        highest[place] = score
        best[place] = row - 1
        found = min(found + 1, k)
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
