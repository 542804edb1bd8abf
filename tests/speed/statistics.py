"""Medians and means with their intervals, as text."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from planners.world.arrays import Floats

RESAMPLES = 2000
SEED = 0


def interval(values: Floats, statistic: Callable[..., Floats] = np.median) -> tuple[float, float]:
    """Bootstrap 95 % interval of a statistic of ``values [n]``."""
    drawn = np.random.default_rng(SEED).integers(len(values), size=(RESAMPLES, len(values)))
    low, high = np.quantile(statistic(values[drawn], axis=1), (0.025, 0.975))
    return float(low), float(high)


def with_interval(values: Floats, how: str, statistic: Callable[..., Floats] = np.median) -> str:
    """Like ``1.23 [1.20, 1.31]``: a statistic of ``values [n]`` and its interval, formatted by ``how``."""
    low, high = interval(values, statistic)
    return f"{float(statistic(values)):{how}} [{low:{how}}, {high:{how}}]"
