"""Chooses which of many solved problems to keep: greedily, those whose plans together save most driving.

Recall hands out the free plan that costs least to drive, so a set of plans is worth what that plan saves.
This is counted in the candidates' own problems, each by the plans of the others: that a plan fits its own
problem says nothing about it, and a plan that fits no other problem is kept last. Where no plan is free, a
problem costs what its own plan takes and ``MISSED_S`` more. So both count: to be free in many problems, and
to be quick. Once no plan saves driving any more, those that are free in most problems come first. A problem
may have several candidates, plans of its own that compete; at most one of them is kept.

A plan takes off only a share of what it could save, so that a new problem finds several good plans. The kept
plans are in the order of the greedy choice, so the first of them are a good choice of fewer. (The savings are
submodular: Nemhauser, Wolsey and Fisher 1978. Gains of earlier steps are bounds that spare most of the work:
Minoux 1978.)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from planners.memory.labelling import label_problems
from planners.memory.plans.experience import Experience
from planners.memory.plans.sweeps import sweep_plans
from planners.world.arrays import Flags, Floats, Integers
from planners.world.driving_cost import cost_of
from planners.world.jit import jit
from planners.world.vehicles.vehicle import CAR, Vehicle

PROBLEMS: Final = 1_000  # to cover: of the first candidates; 500 chose nearly as well (docs/method.md)
MISSED_S: Final = 3.0  # what it costs, in seconds of driving, that no plan is free
LEFT: Final = 0.35  # share of a saving that is left to other plans; 0.1 to 0.5: as well


def curate(candidates: Sequence[Experience], count: int, vehicle: Vehicle = CAR) -> Integers:
    """Choose which candidates to keep, at most one of each problem.

    Args:
        candidates: solved problems with plans.
        count: how many to keep.
        vehicle: what is driven.

    Returns:
        The numbers ``[count]`` of the candidates to keep, the most useful first; if there are no more
        problems than ``count``, the first candidate of each problem, as they come.
    """
    numbers: dict[str, int] = {}
    owners = np.array([numbers.setdefault(each.problem.id, len(numbers)) for each in candidates], np.int32)
    _, first = np.unique(owners, return_index=True)
    if count >= len(numbers):
        return first.astype(np.int32)
    sweeps = sweep_plans([candidate.plan for candidate in candidates], vehicle)
    labels = label_problems([candidates[i].problem for i in first[:PROBLEMS]], sweeps).free
    labels &= owners != np.arange(len(labels))[:, np.newaxis]
    durations = np.array([cost_of(each.plan, vehicle) for each in candidates])
    quickest = np.full(len(numbers), np.inf)
    np.minimum.at(quickest, owners, durations)
    return choose(labels, durations, quickest[: len(labels)] + MISSED_S, count, owners)


def choose(labels: Flags, durations: Floats, without: Floats, count: int, owners: Integers) -> Integers:
    """Choose some of N plans greedily, at most one of each owner.

    Args:
        labels: ``[M, N]`` which plans are free in which problem.
        durations: ``[N]`` what the plans cost to drive, in seconds.
        without: ``[M]`` what a problem costs without any plan, in seconds.
        count: how many plans to choose.
        owners: ``[N]`` which problem each plan was made for.

    Returns:
        Their numbers ``[count]`` in the order of the choice.

    Raises:
        ValueError: There are fewer than ``count`` owners, or the arrays are of different plans or problems.
    """
    plans = len(durations)
    if labels.shape != (len(without), plans) or not 0 <= count <= len(set(owners.tolist())):
        raise ValueError(f"{count} of {plans} plans cannot be chosen by labels {list(labels.shape)}")
    free = np.ascontiguousarray(labels.T)
    costs = without.copy()
    bounds = np.full(plans, np.inf)
    unmet = np.ones(len(without))  # what it is worth that one more plan is free in a problem
    eligible = np.ones(plans, np.bool_)
    order = np.empty(count, np.int32)
    for step in range(count):
        best = _most_useful(free, durations, costs, bounds, eligible)
        if bounds[best] <= 0.0:
            best = int(np.argmax(np.where(eligible, free @ unmet, -1.0)))
        order[step] = best
        saves = free[best] & (durations[best] < costs)
        costs[saves] -= (1.0 - LEFT) * (costs[saves] - durations[best])
        unmet[free[best]] *= LEFT
        eligible[owners == owners[best]] = False
    return order


def coverage(labels: Flags, order: Integers) -> Floats:
    """The share ``[n]`` of problems in which one of the first 1, 2, ... n plans of ``order [n]`` is free.

    ``labels [M, N]``: which plans are free in which problem.
    """
    covered: Floats = np.logical_or.accumulate(labels[:, order], axis=1).mean(0)
    return covered


@jit
def _most_useful(free: Flags, durations: Floats, costs: Floats, bounds: Floats, eligible: Flags) -> int:
    """The eligible plan that saves most, the first of equals; ``bounds [N]`` are tightened.

    Costs only fall from step to step, so an earlier gain of a plan bounds its gain now.
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
        for j in range(costs.shape[0]):
            if free[best, j]:
                gain += max(costs[j] - durations[best], 0.0)
        bounds[best] = gain
        exact[best] = True
