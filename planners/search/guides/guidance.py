"""From ways to the sampling of a guided planner: where to sample, and how often."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence

import numpy as np

from planners.search.query import Guide
from planners.world.arrays import Floats
from planners.world.jit import jit

RATIO = 0.3  # each next way is sampled 0.3 times as often; measured against 0.6 and 0.8 (docs/planners.md)
SPACING_M = 1.0  # between the points of a way, so that slow stretches are not sampled more often


@jit
def spaced(way: Floats, spacing_m: float) -> Floats:
    """A way's (``[T, >= 2]``) first point, and each that is ``spacing_m`` from the one before: ``[M, 2]``."""
    points = np.empty((way.shape[0], 2))
    count = 0
    for i in range(way.shape[0]):
        x = way[i, 0]
        y = way[i, 1]
        if count > 0 and math.hypot(x - points[count - 1, 0], y - points[count - 1, 1]) < spacing_m:
            continue
        points[count, 0] = x
        points[count, 1] = y
        count += 1
    return points[:count].copy()


def guidance(ways: Sequence[Floats]) -> Guide:
    """Guide along ``ways`` (each ``[T, >= 2]`` metres), best first: ``b_1 > ... > b_k > b_goal > b_other``.

    The probabilities are a geometric series of ratio ``RATIO`` over the k ways, the goal, the whole space.
    Raises ValueError when there is no way to be guided by.
    """
    if not ways:
        raise ValueError("there is no way to guide along: search without a guide")
    points = [spaced(way, SPACING_M) for way in ways]
    starts = list(itertools.accumulate((len(each) for each in points), initial=0))
    return Guide(
        points[0] if len(points) == 1 else np.concatenate(points),
        np.array(starts, np.int32),
        *_probabilities(len(ways)),
    )


@functools.lru_cache(maxsize=16)
def _probabilities(ways: int) -> tuple[Floats, float]:
    weights: Floats = np.power(RATIO, np.arange(ways + 2))
    weights /= weights.sum()
    return weights[:-2].copy(), float(weights[-2])
