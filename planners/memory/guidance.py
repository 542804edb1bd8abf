"""From recalled plans to the sampling of an open-box planner: where to sample, and how often."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from planners.world.problem import Floats, Integers, Plan

RATIO = 0.8  # each next best is sampled 0.8 times as often; near 1, so that no choice is all but excluded


class Guidance(NamedTuple):
    """What a planner's guide is made of; what remains of the probabilities to 1 is ``b_other``."""

    points: Floats  # [M, 2] metres, positions of all recalled plans one after another
    starts: Integers  # [k + 1] plan i owns points[starts[i] : starts[i + 1]]
    probabilities: Floats  # [k] b_1 > ... > b_k
    goal_probability: float


def guidance(plans: Sequence[Plan]) -> Guidance:
    """Guide the sampling by ``plans``, best first: ``b_1 > ... > b_k > b_goal > b_other``, sum 1.

    The probabilities are a geometric series of ratio ``RATIO`` over the k plans, the goal, the whole space.
    Raises ValueError when there is no plan to be guided by.
    """
    if not plans:
        raise ValueError("no plan was recalled, so there is nothing to guide by: search without a guide")
    weights: Floats = np.power(RATIO, np.arange(len(plans) + 2))
    weights /= weights.sum()
    return Guidance(
        np.concatenate([plan.states[:, :2] for plan in plans]),
        np.cumsum([0] + [len(plan.states) for plan in plans], dtype=np.int32),
        weights[:-2],
        float(weights[-2]),
    )
