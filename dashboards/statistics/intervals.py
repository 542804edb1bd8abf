"""Bootstrap 95 % intervals (Efron 1979). Problems are resampled, the same ones for all that is compared."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from scipy.special import betaincinv

from planners.world.arrays import Floats, Integers

RESAMPLES: Final = 2000  # the ends of a 95 % interval then stand on 50 resamples each
CONFIDENCE: Final = 0.95
_TAIL: Final = 0.5 * (1.0 - CONFIDENCE)
_COUNTS_AT_ONCE: Final = 400_000  # a few MB: they stay in the processor's cache


class Resampled(NamedTuple):
    """What each resample of the problems gives; NaN where it holds no attempt to go by."""

    means: Floats  # [resamples, C]
    reductions: Floats  # [resamples, C] 1 - mean / mean of the baseline, over problems that both attempted
    interquartile_means: Floats  # [resamples, C], or empty [0, C]


def bootstrap(
    values: Floats, baseline: Floats, seed: int, resamples: int, interquartile: bool = False
) -> Resampled:
    """Resample problems. A resample draws the same problems for all columns, so hard ones fall on all alike.

    Args:
        values: ``[n, C]``, of n problems, NaN where not attempted.
        baseline: ``[n, C]``, what each column is compared with, in the same unit.
        seed: seed of the drawing.
        resamples: how often the problems are drawn.
        interquartile: whether interquartile means are wanted, which take longest.
    """
    there = ~np.isnan(values)
    both = there & ~np.isnan(baseline)
    summands = np.concatenate(
        [np.where(there, values, 0.0), there, np.where(both, values, 0.0), np.where(both, baseline, 0.0)],
        axis=1,
    ).T
    sums = np.empty((summands.shape[0], resamples))
    middle = np.empty((values.shape[1], resamples if interquartile else 0))
    first = 0
    orders = [_order(column) for column in values.T] if interquartile else []
    for counts in _resamples(len(values), seed, resamples):
        here = slice(first, first + counts.shape[1])
        sums[:, here] = summands @ counts
        for k, order in enumerate(orders):
            middle[k, here] = resampled_interquartile_mean(values[order, k], counts[order])
        first = here.stop
    total, attempted, mine, without = np.split(sums.T, 4, axis=1)
    return Resampled(ratio(total, attempted), 1.0 - ratio(mine, without), middle.T)


def _order(values: Floats) -> Integers:
    """The order of ``values [n]``, the smallest first, without those that are NaN."""
    order = np.argsort(values)[: int(np.count_nonzero(~np.isnan(values)))]
    return order.astype(np.int32)


def resampled_interquartile_mean(ranked: Floats, counts: Floats) -> Floats:
    """Means ``[R]`` of the middle half of n numbers, each there ``counts [n, R]`` times in a resample.

    They are ``ranked``, the smallest first. One at the cut of a quarter counts in part.
    """
    if not len(ranked):
        return np.full(counts.shape[1], np.nan)
    below = np.cumsum(counts, axis=0)
    total = below[-1].copy()
    np.minimum(np.maximum(below, 0.25 * total, out=below), 0.75 * total, out=below)
    # Each value times its weight, the step of ``below`` at it; summed by parts, one pass does.
    inside = below[-1] * ranked[-1] - 0.25 * total * ranked[0] - np.diff(ranked) @ below[:-1]
    return ratio(inside, 0.5 * total)


def interquartile_mean(values: Floats) -> float:
    """Mean of the middle half of ``values [n]``: neither the fastest nor the slowest quarter moves it."""
    order = _order(values)
    return float(resampled_interquartile_mean(values[order], np.ones((len(order), 1)))[0])


def interval(resampled: Floats) -> tuple[Floats, Floats]:
    """Ends ``[C]`` of the percentile intervals of ``resampled [resamples, C]``; NaN for an empty column."""
    ends = np.full((2, resampled.shape[1]), np.nan)
    filled = ~np.isnan(resampled).all(axis=0)
    if filled.any():
        ends[:, filled] = np.nanquantile(resampled[:, filled], [_TAIL, 1.0 - _TAIL], axis=0)
    return ends[0], ends[1]


def quantile_interval(values: Floats, share: float) -> tuple[float, float]:
    """Ends of the bootstrap interval of a quantile of ``values [n]``, as infinitely many resamples give it.

    The k-th smallest of n draws is at most the j-th smallest value if at least k draws are among the first j.
    That is a binomial law, so nothing need be drawn.

    Args:
        values: ``[n]``; NaN values are left out.
        share: which quantile, 0 to 1.
    """
    ranked = np.sort(values[~np.isnan(values)])
    n = len(ranked)
    if n == 0:
        return np.nan, np.nan
    k = max(1, int(np.ceil(share * n)))
    low, high = (int(np.ceil(n * betaincinv(k, n - k + 1, tail))) for tail in (_TAIL, 1.0 - _TAIL))
    return float(ranked[max(low, 1) - 1]), float(ranked[min(high, n) - 1])


def ratio(above: Floats, below: Floats) -> Floats:
    """``above / below``, both of one shape; NaN where ``below`` is not above 0."""
    quotient = np.full(above.shape, np.nan)
    np.divide(above, below, out=quotient, where=below > 0.0)
    return quotient


def _resamples(n: int, seed: int, resamples: int) -> Iterator[Floats]:
    """How often each of n problems is drawn in each resample, ``[n, some resamples]`` at a time."""
    generator = np.random.default_rng(seed)
    size = max(1, _COUNTS_AT_ONCE // max(n, 1))
    for first in range(0, resamples, size):
        count = min(size, resamples - first)
        drawn = generator.integers(n, size=(n, count)) * count + np.arange(count)
        yield np.bincount(drawn.ravel(), minlength=n * count).reshape(n, count).astype(np.float64)
