"""The tables and the headline of one class, as Markdown."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from dashboards.cells import NOTHING, Rows, markdown_table
from planners.world.arrays import Floats
from tests.speed.time_to_quality.methods import MEMORY_ANYTIME
from tests.speed.time_to_quality.quality import (
    BUDGETS,
    GOOD,
    Quality,
    driving,
    means_of,
    over_best,
    ratios,
    time_to_good,
    total,
)

TOTAL_HEADINGS: Final = (
    "class", "memory", "budget", "total s", "best without", "its total s", "later by s [95 %]", "later",
)  # fmt: skip
GOES_ON_FOR: Final = (1e-3, 3e-3, 1e-2, 3e-2)  # seconds: the budgets of a memory that goes on


def milliseconds(seconds: float) -> str:
    """Like ``0.3 ms``."""
    return f"{1e3 * seconds:g} ms"


def over_table(quality: Quality) -> str:
    """Driving time over the best known, per cent, for each way and budget."""
    over, solved = over_best(quality, BUDGETS), ~np.isnan(driving(quality, BUDGETS))
    rows: Rows = []
    for way, name in enumerate(quality.names):
        mean, low, high = means_of(over[:, way])
        share = solved[:, way].mean(axis=0)
        rows.append([name, *(_over(*each) for each in zip(mean, low, high, share, strict=True))])
    return markdown_table(["planner", *map(milliseconds, BUDGETS)], rows)


def _over(mean: float, low: float, high: float, solved: float) -> str:
    if solved == 0.0:
        return NOTHING
    cell = f"{100 * mean:.1f} ±{50 * (high - low):.1f}"
    return cell if solved == 1.0 else f"{cell} ({100 * solved:.0f})"


def good_table(quality: Quality, horizon: float) -> str:
    """Time to a good plan; a problem in which a way found none counts with the ``horizon``, in seconds."""
    times = time_to_good(quality)
    reached, capped = np.isfinite(times), 1e3 * np.minimum(times, horizon)
    mean, low, high = means_of(capped)
    rows = [
        [
            name,
            f"{100 * reached[:, way].mean():.1f}",
            f"{np.median(capped[:, way]):.3g}",
            f"{mean[way]:.3g} [{low[way]:.3g}, {high[way]:.3g}]",
            f"{np.quantile(capped[:, way], 0.9):.3g}",
        ]
        for way, name in enumerate(quality.names)
    ]
    return markdown_table(["planner", "reached %", "median ms", "mean ms [95 %]", "90 % ms"], rows)


def headline(class_name: str, quality: Quality, horizon: float) -> str:
    """Time to a good plan without a memory and with one, each by the way that is quickest in the mean."""
    times = np.minimum(time_to_good(quality), horizon)
    alone = _quickest(times, ~quality.with_memory)
    if not quality.with_memory.any():
        return f"{class_name}: no memory."
    known = _quickest(times, quality.with_memory)
    means, tails = ratios(times[:, alone], times[:, known])
    ninety = 1e3 * np.quantile(times, 0.9, axis=0)
    return (
        f"{class_name}: to a plan within {100 * GOOD:g} % of the best {1e3 * times[:, alone].mean():.3g} ms "
        f"alone ({quality.names[alone]}), {1e3 * times[:, known].mean():.3g} ms with memory "
        f"({quality.names[known]}), ratio {means}; by 90 % {ninety[alone]:.3g} and {ninety[known]:.3g} ms, "
        f"ratio {tails}."
    )


def _quickest(times: Floats, among: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> int:
    return int(np.argmin(np.where(among, times.mean(axis=0), np.inf)))


def total_rows(class_name: str, quality: Quality) -> Iterator[list[str]]:
    """Planning and driving with a memory, beside every way without one at every budget: rows of cells.

    The last cell says how many of the ways and budgets without memory are later with their whole interval.
    """
    totals = total(quality, BUDGETS)
    without = totals[:, ~quality.with_memory].reshape(len(totals), -1)
    names = [
        f"{name}, {milliseconds(budget)}"
        for name, memory in zip(quality.names, quality.with_memory, strict=True)
        for budget in BUDGETS
        if not memory
    ]
    means = without.mean(axis=0)
    best = int(means.argmin())
    for way in np.flatnonzero(quality.with_memory):
        one_shot = quality.kinds[way] != MEMORY_ANYTIME
        for budget in BUDGETS[-1:] if one_shot else GOES_ON_FOR:
            mine = totals[:, way, BUDGETS.index(budget)]
            later, low, high = means_of(without - mine[:, None])
            yield [
                class_name,
                quality.names[way],
                NOTHING if one_shot else milliseconds(budget),
                f"{mine.mean():.3f}",
                names[best],
                f"{means[best]:.3f}",
                f"{later[best]:.3f} [{low[best]:.3f}, {high[best]:.3f}]",
                f"{int((low > 0.0).sum())} of {len(low)}",
            ]
