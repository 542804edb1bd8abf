"""Paired sign tests: in how many problems planning became slower, by how much, and whether by chance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import bdtr  # scipy.stats takes half a second to import, and each worker would

from planners.world.arrays import Floats


class Signs(NamedTuple):
    """Times beside those of a baseline on the same problems; a failure is slower than every success."""

    compared: int  # problems that both attempted
    slower: float  # share of them in which the baseline was faster
    slowdown: float  # in those, the median of time / baseline; infinite if most of them failed
    p_value: float  # of a two-sided sign test that slower and faster are equally likely, without ties


def signs(times: Floats, baseline: Floats) -> Signs:
    """Compare ``times [n]`` with ``baseline [n]``: NaN is not attempted, infinite not solved."""
    both = ~np.isnan(times) & ~np.isnan(baseline)
    mine, other = times[both], baseline[both]
    slower, faster = mine > other, mine < other
    decided = int(slower.sum() + faster.sum())
    fewer = min(int(slower.sum()), int(faster.sum()))
    return Signs(
        compared=len(mine),
        slower=float(slower.mean()) if len(mine) else np.nan,
        slowdown=float(np.median(mine[slower] / other[slower])) if slower.any() else np.nan,
        p_value=min(1.0, 2.0 * float(bdtr(fewer, decided, 0.5))) if len(mine) else np.nan,
    )


def holm(p_values: Floats) -> Floats:
    """``p_values [m]`` corrected for their number (Holm 1979); NaN, where nothing was tested, stays NaN."""
    corrected = np.full(p_values.shape, np.nan)
    tested = np.flatnonzero(~np.isnan(p_values))
    order = tested[np.argsort(p_values[tested], kind="stable")]
    factors = np.arange(len(order), 0, -1)
    corrected[order] = np.minimum(1.0, np.maximum.accumulate(factors * p_values[order]))
    return corrected
