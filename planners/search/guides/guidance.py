"""Makes a guide of paths: where a guided planner samples, and how often."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence

import numpy as np

from planners.search.query import Guide
from planners.world.arrays import Floats
from planners.world.jit import jit

RATIO = 0.3  # each path is sampled 0.3 times as often as the one before; 0.6, 0.8: worse (docs/planners.md)
PUBLISHED_RATIO = 0.8  # of the paper's open box, which gives no number: b_goal is 0.08 with five plans
LEAD = 16  # points ahead, each SPACING_M after the one before
SPACING_M = 1.0  # between the points of a path, so that slow stretches are not sampled more often


@jit
def spaced(path: Floats, spacing_m: float) -> Floats:
    """Thin out a path ``[T, >= 2]`` to points ``[M, 2]``, each at least ``spacing_m`` from the one before."""
    points = np.empty((path.shape[0], 2))
    count = 0
    for i in range(path.shape[0]):
        x = path[i, 0]
        y = path[i, 1]
        if count > 0 and math.hypot(x - points[count - 1, 0], y - points[count - 1, 1]) < spacing_m:
            continue
        points[count, 0] = x
        points[count, 1] = y
        count += 1
    return points[:count].copy()


def guidance(paths: Sequence[Floats]) -> Guide:
    """Make a guide along paths, with probabilities ``b_1 > ... > b_k > b_goal > b_other``.

    The probabilities are a geometric series of ratio ``RATIO`` over the k paths, the goal and all the rest.

    Args:
        paths: best first, each ``[T, >= 2]`` with x, y in metres.

    Raises:
        ValueError: There are no paths.
    """
    return _guide([spaced(path, SPACING_M) for path in paths], RATIO, LEAD)


def published_guidance(plans: Sequence[Floats]) -> Guide:
    """Make the guide of the paper's open box (III-D): draws lie near the states of recalled plans.

    The probabilities are a geometric series of ratio ``PUBLISHED_RATIO``.

    Args:
        plans: best first, the states ``[T, >= 2]`` of each with x, y in metres.

    Raises:
        ValueError: There are no plans.
    """
    return _guide([plan[:, :2] for plan in plans], PUBLISHED_RATIO, 0)


def _guide(points: Sequence[Floats], ratio: float, lead: int) -> Guide:
    if not points:
        raise ValueError("there is no path to guide along: search without a guide")
    starts = list(itertools.accumulate((len(each) for each in points), initial=0))
    return Guide(
        np.ascontiguousarray(points[0]) if len(points) == 1 else np.concatenate(points),
        np.array(starts, np.int32),
        *_probabilities(len(points), ratio),
        lead,
    )


@functools.lru_cache(maxsize=32)
def _probabilities(paths: int, ratio: float) -> tuple[Floats, float]:
    weights: Floats = np.power(ratio, np.arange(paths + 2))
    weights /= weights.sum()
    return weights[:-2].copy(), float(weights[-2])
