"""Splits problems: some to train with, some to choose the best epoch with, some to measure recall with."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planners.world.arrays import Flags, Integers
from planners.world.randomness import generator


class Splits(NamedTuple):
    """Numbers of problems in ascending order."""

    training: Integers
    validation: Integers  # to choose the best epoch and the best seed with
    held_out: Integers  # to measure recall with


def split(plan_index: Integers, labels: Flags, validation_share: float, held_out_share: float) -> Splits:
    """Split n problems at random, in the same way for every training seed.

    Args:
        plan_index: ``[n]`` the plan that each problem was made for, -1 for none.
        labels: ``[n, N]`` which plans are free.
        validation_share: share of the problems to choose the best epoch with.
        held_out_share: share of the problems to measure recall with.

    Raises:
        ValueError: There are fewer than three problems, or none that was made for some plan.
    """
    count, plans = labels.shape
    if count < 3:
        raise ValueError(f"{count} problems cannot be split in three: hallucinate more")
    missing = np.setdiff1d(np.arange(plans), plan_index)
    if len(missing):
        raise ValueError(
            f"problems belong to {plans - len(missing)} of {plans} plans (without problems: "
            f"{missing.tolist()}): hallucinate problems for each stored plan"
        )
    order = generator(0, "split").permutation(count).astype(np.int32)
    held_out = max(1, round(held_out_share * count))
    seen = held_out + max(1, round(validation_share * count))
    parts = [np.sort(part) for part in np.split(order, [held_out, seen])]
    return Splits(parts[2], parts[1], parts[0])


def first_of_each(values: Integers, count: int) -> Integers:
    """Return, in order, where the first ``count`` occurrences of each value that is not negative are."""
    order = np.argsort(values, kind="stable")
    order = order[values[order] >= 0]
    begins = np.flatnonzero(np.diff(values[order], prepend=-1))
    rank = np.arange(len(order)) - np.repeat(begins, np.diff(begins, append=len(order)))
    return np.sort(order[rank < count]).astype(np.int32)
