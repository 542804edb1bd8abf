"""Which of many solved problems to keep: greedily, those whose plans together answer the most problems.

What is covered are the candidates' own problems, each by the plans of the others: a plan's own problem says
nothing of it, and a plan that answers no other is kept last. A problem that is covered already counts less
each time it is covered again, so that a new one finds several plans. The kept plans are in the order of the
greedy choice, so the first of them are a good choice of fewer. (The coverage is submodular: Nemhauser, Wolsey
and Fisher 1978; gains of earlier steps are bounds that spare most of the work: Minoux 1978.)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from planners.memory.labelling import label_problems
from planners.memory.plans.cell_masks import masks_of
from planners.memory.plans.experience import Experience
from planners.memory.plans.sweeps import sweep_plans
from planners.world.arrays import Flags, Floats, Integers
from planners.world.geometry.occupancy import ALL_CELLS, Bits
from planners.world.jit import jit
from planners.world.vehicles.vehicle import CAR, Vehicle

PROBLEMS: Final = 1_000  # of the candidates, the first, to cover; 500 chose nearly as well (docs/method.md)
AGAIN: Final = 0.35  # what a problem counts once more each time it is covered; 0.1 to 0.5 chose as well
ALIKE: Final = 0.8  # share of common swept cells, of all that either sweeps, from which two plans are one


def curate(candidates: Sequence[Experience], count: int, vehicle: Vehicle = CAR) -> Integers:
    """Numbers of the ``count`` candidates to keep, best first; all in their order if there are no more."""
    if count >= len(candidates):
        return np.arange(len(candidates), dtype=np.int32)
    sweeps = sweep_plans([candidate.plan for candidate in candidates], vehicle)
    labels = label_problems([each.problem for each in candidates[:PROBLEMS]], sweeps).free
    np.fill_diagonal(labels, False)
    return choose(labels, masks_of(sweeps), count)


def choose(labels: Flags, masks: Bits, count: int) -> Integers:
    """Numbers of ``count`` of N plans in the order of the greedy choice, near-duplicates after all others.

    ``labels [M, N]``: which plans are free in which problem. ``masks [N, 64]``: the plans' swept cells.

    Raises ValueError where there are fewer plans than asked for, or labels and masks are not of the same.
    """
    plans = len(masks)
    if labels.shape[1:] != (plans,) or not 0 <= count <= plans:
        raise ValueError(f"{count} of {plans} plans cannot be chosen by labels {list(labels.shape)}")
    free = np.ascontiguousarray(labels.T)
    weights = np.ones(len(labels))
    bounds = np.full(plans, np.inf)
    eligible, alike = np.ones(plans, np.bool_), np.zeros(plans, np.bool_)
    order = np.empty(count, np.int32)
    for step in range(count):
        if not eligible.any():
            eligible, alike = alike, np.zeros(plans, np.bool_)
        best = order[step] = _most_useful(free, weights, bounds, eligible)
        weights[free[best]] *= AGAIN
        eligible[best] = False
        same = eligible & (similarity(masks, masks[best]) >= ALIKE)
        eligible &= ~same
        alike |= same
    return order


def similarity(masks: Bits, mask: Bits) -> Floats:
    """Cells that plans ``[N, 64]`` share with one ``[64]``, of all that either sweeps: ``[N]``, 0 to 1.

    Nothing is like a plan that leaves the window, of which all cells are set.
    """
    if (mask == ALL_CELLS).all():
        return np.zeros(len(masks))
    both = np.bitwise_count(masks & mask).sum(1, dtype=np.int64)
    either = np.bitwise_count(masks | mask).sum(1, dtype=np.int64)
    share: Floats = both / np.maximum(either, 1)
    return share


def coverage(labels: Flags, order: Integers) -> Floats:
    """Share ``[len(order)]`` of the problems ``[M, N]`` in which any of the first 1, 2, ... plans is free."""
    covered: Floats = np.logical_or.accumulate(labels[:, order], axis=1).mean(0)
    return covered


@jit
def _most_useful(free: Flags, weights: Floats, bounds: Floats, eligible: Flags) -> int:
    """The eligible plan whose free problems weigh most, the first of equals; ``bounds [N]`` are tightened.

    Weights only fall from step to step, so what a plan gained before bounds what it gains now.
    """
    known = np.zeros(bounds.shape[0], np.bool_)
    while True:
        best = -1
        for i in range(bounds.shape[0]):
            if eligible[i] and (best < 0 or bounds[i] > bounds[best]):
                best = i
        if known[best]:
            return best
        gain = 0.0
        for j in range(weights.shape[0]):
            if free[best, j]:
                gain += weights[j]
        bounds[best] = gain
        known[best] = True
