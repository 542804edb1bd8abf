"""Chooses which of many solved problems to keep: greedily, those whose plans together fit most problems.

The problems to cover are the candidates' own, each by the plans of the others: that a plan fits its own
problem says nothing about it, and a plan that fits no other problem is kept last. A covered problem counts
less each time it is covered again, so that a new problem finds several plans. The kept plans are in the order
of the greedy choice, so the first of them are a good choice of fewer. (Coverage is submodular: Nemhauser,
Wolsey and Fisher 1978. Gains of earlier steps are bounds that spare most of the work: Minoux 1978.)
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

PROBLEMS: Final = 1_000  # to cover: of the first candidates; 500 chose nearly as well (docs/method.md)
AGAIN: Final = 0.35  # a problem's weight falls to this share each time it is covered; 0.1 to 0.5: as well
ALIKE: Final = 0.8  # plans are near-duplicates from this share of common cells on, of all that either sweeps


def curate(candidates: Sequence[Experience], count: int, vehicle: Vehicle = CAR) -> Integers:
    """Return the numbers ``[count]`` of the candidates to keep, best first, or all if there are no more."""
    if count >= len(candidates):
        return np.arange(len(candidates), dtype=np.int32)
    sweeps = sweep_plans([candidate.plan for candidate in candidates], vehicle)
    labels = label_problems([each.problem for each in candidates[:PROBLEMS]], sweeps).free
    np.fill_diagonal(labels, False)
    return choose(labels, masks_of(sweeps), count)


def choose(labels: Flags, masks: Bits, count: int) -> Integers:
    """Choose some of N plans greedily, near-duplicates after all others.

    Args:
        labels: ``[M, N]`` which plans are free in which problem.
        masks: ``[N, 64]`` the cells that each plan sweeps.
        count: how many plans to choose.

    Returns:
        Their numbers ``[count]`` in the order of the choice.

    Raises:
        ValueError: There are fewer than ``count`` plans, or labels and masks are of different plans.
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
        duplicates = eligible & (similarity(masks, masks[best]) >= ALIKE)
        eligible &= ~duplicates
        alike |= duplicates
    return order


def similarity(masks: Bits, mask: Bits) -> Floats:
    """The share ``[N]``, 0 to 1, of common cells of plans ``[N, 64]`` and a plan ``[64]``, of all they sweep.

    It is 0 if the one plan leaves the window and so has all cells set.
    """
    if (mask == ALL_CELLS).all():
        return np.zeros(len(masks))
    both = np.bitwise_count(masks & mask).sum(1, dtype=np.int64)
    either = np.bitwise_count(masks | mask).sum(1, dtype=np.int64)
    share: Floats = both / np.maximum(either, 1)
    return share


def coverage(labels: Flags, order: Integers) -> Floats:
    """The share ``[n]`` of problems in which one of the first 1, 2, ... n plans of ``order [n]`` is free.

    ``labels [M, N]``: which plans are free in which problem.
    """
    covered: Floats = np.logical_or.accumulate(labels[:, order], axis=1).mean(0)
    return covered


@jit
def _most_useful(free: Flags, weights: Floats, bounds: Floats, eligible: Flags) -> int:
    """The eligible plan whose free problems weigh most, the first of equals; ``bounds [N]`` are tightened.

    Weights only fall from step to step, so an earlier gain of a plan bounds its gain now.
    """
    exact = np.zeros(bounds.shape[0], np.bool_)
    while True:
        best = -1
        for i in range(bounds.shape[0]):
            if eligible[i] and (best < 0 or bounds[i] > bounds[best]):
                best = i
        if exact[best]:
            return best
        gain = 0.0
        for j in range(weights.shape[0]):
            if free[best, j]:
                gain += weights[j]
        bounds[best] = gain
        exact[best] = True
