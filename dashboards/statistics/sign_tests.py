"""Paired sign tests: in how many problems memory made planning slower, by how much, and is that chance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import binom

from planners.world.arrays import Floats


class Signs(NamedTuple):
    """Times against those of the baseline on the same problems; a failure is slower than every success."""

    compared: int  # problems that both attempted
    slower: float  # share of them in which the baseline was faster
    slowdown: float  # among those the median of time / baseline; infinite where most of them failed
    p_value: float  # two-sided sign test that slower and faster are equally likely, ties left out


def signs(times: Floats, baseline: Floats) -> Signs:
    """Compare ``times [n]`` with ``baseline [n]``: NaN where not attempted, infinite where not solved."""
    both = ~np.isnan(times) & ~np.isnan(baseline)
    mine, other = times[both], baseline[both]
    slower, faster = mine > other, mine < other
    decided = int(slower.sum() + faster.sum())
    fewer = min(int(slower.sum()), int(faster.sum()))
    return Signs(
        compared=len(mine),
        slower=float(slower.mean()) if len(mine) else np.nan,
        slowdown=float(np.median(mine[slower] / other[slower])) if slower.any() else np.nan,
        p_value=min(1.0, 2.0 * float(binom.cdf(fewer, decided, 0.5))) if len(mine) else np.nan,
    )


def holm(p_values: Floats) -> Floats:
    """P-values ``[m]`` corrected for there being m of them (Holm 1979); NaN is no test and stays NaN."""
    corrected = np.full(p_values.shape, np.nan)
    tested = np.flatnonzero(~np.isnan(p_values))
    order = tested[np.argsort(p_values[tested], kind="stable")]
    factors = np.arange(len(order), 0, -1)
    corrected[order] = np.minimum(1.0, np.maximum.accumulate(factors * p_values[order]))
    return corrected
