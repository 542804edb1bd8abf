"""Paired differences judged by swapping sides, corrected for all that is compared at once.

Under the hypothesis that two sides do not differ, each problem's two values might as well be swapped. So the
law of a sum of differences is that of the same differences with signs drawn at random, whatever their law:
rare long times, or a machine that becomes slower meanwhile, change nothing as long as it was drawn which side
came first. All that is compared at once is judged by the largest of its statistics (Westfall and Young 1993).
So however many things are compared, only in one such comparison of twenty is anything called different when
nothing differs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from planners.world.arrays import Floats

CONFIDENCE: Final = 0.95
DRAWN: Final = 4000  # swaps: the end of an interval then stands on 200 of them
_AT_ONCE: Final = 500


class Difference(NamedTuple):
    """Mean differences ``[C]`` of the values of two sides, with the ends of their common 95 % intervals."""

    mean: Floats
    low: Floats
    high: Floats


def differences(families: Sequence[Floats], seed: int = 0, drawn: int = DRAWN) -> list[Difference]:
    """The mean of each column of paired differences, with intervals that hold for all columns at once.

    An interval excludes 0 if, among all columns, sums as large relative to their spread come about by
    swapping sides in fewer than 5 % of the draws.

    Args:
        families: for each set of n problems the differences ``[n, C]`` of C things compared there; NaN where
            a side is missing. Columns of one family are swapped together, families apart.
        seed: of the drawing.
        drawn: how often sides are swapped.

    Returns:
        for each family its mean differences ``[C]`` and the ends of their intervals ``[C]``; NaN if no
        problem has both sides.
    """
    generator = np.random.default_rng(seed)
    there = [~np.isnan(family) for family in families]
    values = [np.where(each, family, 0.0) for each, family in zip(there, families, strict=True)]
    spreads = [np.sqrt(np.square(each).sum(axis=0)) for each in values]
    largest = np.zeros(drawn)
    for each, spread in zip(values, spreads, strict=True):
        scaled = np.divide(each, spread, out=np.zeros_like(each), where=spread > 0.0)
        for first in range(0, drawn, _AT_ONCE):
            rows = slice(first, min(first + _AT_ONCE, drawn))
            signs = generator.integers(0, 2, (rows.stop - rows.start, len(each))) * 2.0 - 1.0
            largest[rows] = np.maximum(largest[rows], np.abs(signs @ scaled).max(axis=1, initial=0.0))
    reach = float(np.quantile(largest, CONFIDENCE, method="higher"))
    found = []
    for each, spread, mask in zip(values, spreads, there, strict=True):
        count = mask.sum(axis=0).astype(np.float64)
        mean, half = (
            np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0.0)
            for total in (each.sum(axis=0), reach * spread)
        )
        found.append(Difference(mean, mean - half, mean + half))
    return found
