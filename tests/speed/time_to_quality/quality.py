"""From what was found when to figures: driving over the best known, total times, time to a good plan.

The best known plan of a problem is the quickest to drive of all that anybody found in all the time there was.
A problem that nobody solved counts nowhere. A way that has no plan yet, or one that takes more than twice as
long as the best known, counts as if it took twice as long: so being late with a plan is never better than
having a bad one, and no single detour decides a mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import pandas as pd

from dashboards.statistics.intervals import RESAMPLES, bootstrap, interval
from planners.world.arrays import Flags, Floats
from tests.speed.time_to_quality.methods import WITH_MEMORY

BUDGETS: Final = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3)  # seconds
GOOD: Final = 0.05  # a plan is good if it takes at most so much longer than the best known
MOST: Final = 1.0  # share over the best known that counts for no plan
SEED: Final = 0  # of resamples


class Quality(NamedTuple):
    """What ``W`` ways found for ``P`` problems that somebody solved, in ``K`` steps at most."""

    kinds: tuple[str, ...]  # of the ways
    names: tuple[str, ...]
    seconds: Floats  # [P, W, K] of each better plan; infinite beyond the last
    durations: Floats  # [P, W, K] driving times, s; that of the last beyond it, NaN if there is none
    spent: Floats  # [P, W] seconds when the attempt ended
    best: Floats  # [P] driving time of the best known plan, s
    unsolved: int  # problems that nobody solved

    @property
    def with_memory(self) -> Flags:
        """Which ways use a memory, ``[W]``."""
        return np.array([kind in WITH_MEMORY for kind in self.kinds])


def quality_of(rows: pd.DataFrame) -> Quality:
    """The ``rows`` of ``measuring.measured``, of one class, as arrays."""
    problem, problems = pd.factorize(rows["problem"])
    way, names = pd.factorize(rows["method"])
    step = rows.groupby(["problem", "method"]).cumcount().to_numpy()
    shape = (len(problems), len(names), int(step.max()) + 1)
    seconds, durations = np.full(shape, np.inf), np.full(shape, np.nan)
    there = rows["duration_s"].notna().to_numpy()
    at = problem[there], way[there], step[there]
    seconds[at] = rows["seconds"].to_numpy(float)[there]
    durations[at] = rows["duration_s"].to_numpy(float)[there]
    durations = np.fmin.accumulate(durations, axis=2)
    spent = np.zeros(shape[:2])
    spent[problem, way] = rows["spent"].to_numpy(float)
    best = np.fmin.reduce(durations[:, :, -1], axis=1)
    solved = ~np.isnan(best)
    kinds = rows.drop_duplicates("method").set_index("method")["kind"]
    return Quality(
        kinds=tuple(kinds[name] for name in names),
        names=tuple(names),
        seconds=seconds[solved],
        durations=durations[solved],
        spent=spent[solved],
        best=best[solved],
        unsolved=int((~solved).sum()),
    )


def driving(quality: Quality, budgets: Sequence[float] | Floats) -> Floats:
    """Driving times ``[P, W, B]`` of the best plans after some ``budgets``, seconds; NaN without a plan."""
    found = np.empty((*quality.spent.shape, len(budgets)))
    for number, budget in enumerate(budgets):
        last = (quality.seconds <= budget).sum(axis=2) - 1
        at = np.take_along_axis(quality.durations, np.maximum(last, 0)[:, :, None], axis=2)[:, :, 0]
        found[:, :, number] = np.where(last < 0, np.nan, at)
    return found


def over_best(quality: Quality, budgets: Sequence[float] | Floats) -> Floats:
    """By how much plans drive longer than the best known, ``[P, W, B]``: a share, at most ``MOST``."""
    over = driving(quality, budgets) / quality.best[:, None, None] - 1.0
    return np.fmin(over, MOST)  # which is MOST for NaN, too


def total(quality: Quality, budgets: Sequence[float] | Floats) -> Floats:
    """Planning and driving, ``[P, W, B]``, in seconds: a way that goes on uses its whole budget."""
    waited = np.minimum(quality.spent[:, :, None], np.asarray(budgets))
    return waited + quality.best[:, None, None] * (1.0 + over_best(quality, budgets))


def time_to_good(quality: Quality, share: float = GOOD) -> Floats:
    """Seconds ``[P, W]`` until a plan takes at most ``share`` over the best known; infinite if never."""
    good = quality.durations <= (1.0 + share) * quality.best[:, None, None]
    return np.where(good, quality.seconds, np.inf).min(axis=2)


def means_of(values: Floats) -> tuple[Floats, Floats, Floats]:
    """Means of ``values [P, C]`` over problems, and the ends of their 95 % intervals, ``[C]`` each."""
    low, high = interval(bootstrap(values, values, SEED, RESAMPLES).means)
    return values.mean(axis=0), low, high


class Ratio(NamedTuple):
    """How many times as long one way takes as another, with the ends of its 95 % interval."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.3g} [{self.low:.3g}, {self.high:.3g}]"


def ratios(above: Floats, below: Floats) -> tuple[Ratio, Ratio]:
    """Ratios of the means and of the 90 % quantiles of ``above [P]`` and ``below [P]``, paired by problem."""
    drawn = np.random.default_rng(SEED).integers(len(above), size=(RESAMPLES, len(above)))
    told = []
    for figure in (np.mean, lambda values, axis: np.quantile(values, 0.9, axis=axis)):
        value = float(figure(above, axis=0) / figure(below, axis=0))
        low, high = np.quantile(figure(above[drawn], axis=1) / figure(below[drawn], axis=1), [0.025, 0.975])
        told.append(Ratio(value, float(low), float(high)))
    return told[0], told[1]
