"""What the attempt rows say: times, solved shares and reductions, paired by problem.

Failures stay in every figure with the time they took; a mean over survivors is never formed.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from typing import Any, Final

import numpy as np
import pandas as pd

from planners.world.problem import Floats

RESAMPLES: Final = 2000  # the ends of a 95 % interval then stand on 50 resamples each
CONFIDENCE: Final = 0.95
COMBINED: Final = "combined"  # the memory of all classes; its attempts form a panel of their own

PANELS: Final = ("curves", "random", "trap")
PLANNERS: Final = ("rrt", "gust", "follow")
ASSISTS: Final = (
    "none", "closed", "open", "repair", "fresh", "random-closed", "random-open", "random-repair",
)  # fmt: skip
RECALLS: Final = ("exhaustive", "hybrid", "mask", "centroid", "random")

_CHUNK_VALUES: Final = 2_000_000  # resampled counts held at once: 16 MB


def panels(attempts: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Attempt rows by panel: each class with its own memory, then all with the combined memory, if any.

    Attempts without memory belong to both.
    """
    combined = attempts["memory"] == COMBINED
    alone = attempts["memory"].isna()
    own = attempts[alone | ~combined]
    found = {name: own[own["problem_class"] == name] for name in ranked(own["problem_class"], PANELS)}
    if (combined & ~alone).any():
        found[COMBINED] = attempts[alone | combined]
    return found


def summarise(attempts: pd.DataFrame, seed: int = 0, resamples: int = RESAMPLES) -> pd.DataFrame:
    """One row per panel, planner, assist, recall and top_k, in reading order.

    Columns ``panel, planner, assist, recall, top_k, problems, solved, mean_ms, mean_low_ms, mean_high_ms,
    median_ms, p90_ms, reduction, reduction_low, reduction_high, recalled, collision_checks``. Shares and
    reductions are fractions; ``reduction`` is that of mean planning time against the same planner's ``none``
    on the problems that both attempted (NaN where there are none), with a bootstrap interval that resamples
    problems.
    """
    tables = [
        _summarise_panel(name, rows, seed, resamples)
        for name, rows in panels(attempts.assign(**_asked(attempts))).items()
    ]
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=list(_COLUMNS))


def bootstrap(milliseconds: Floats, baseline: Floats, seed: int, resamples: int) -> tuple[Floats, Floats]:
    """Resampled means and reductions, each ``[resamples, C]``, of times against baseline, both ``[n, C]``.

    One row is one problem, NaN where it was not attempted. Every resample draws the same problems for all
    columns, so what a problem is hard for falls on all alike. NaN where a resample has nothing to compare.
    """
    generator = np.random.default_rng(seed)
    n, columns = milliseconds.shape
    there = ~np.isnan(milliseconds)
    both = there & ~np.isnan(baseline)
    summands = np.concatenate(
        [
            np.where(there, milliseconds, 0.0),
            there,
            np.where(both, milliseconds, 0.0),
            np.where(both, baseline, 0.0),
        ],
        axis=1,
    )
    sums = np.empty((resamples, 4 * columns))
    chunk = max(1, _CHUNK_VALUES // n)
    for first in range(0, resamples, chunk):
        size = min(chunk, resamples - first)
        drawn = generator.integers(n, size=(size, n)) + n * np.arange(size)[:, None]
        counts = np.bincount(drawn.ravel(), minlength=size * n).reshape(size, n)
        sums[first : first + size] = counts.astype(np.float64) @ summands
    total, attempted, with_memory, without = np.split(sums, 4, axis=1)
    return _ratio(total, attempted), 1.0 - _ratio(with_memory, without)


def ranked(names: Iterable[Hashable], known: tuple[str, ...]) -> list[str]:
    """The distinct names: known ones in their order, then the others alphabetically."""
    distinct = {str(name) for name in names}
    return [name for name in known if name in distinct] + sorted(distinct.difference(known))


_COLUMNS: Final = (
    "panel", "planner", "assist", "recall", "top_k", "problems", "solved", "mean_ms", "mean_low_ms",
    "mean_high_ms", "median_ms", "p90_ms", "reduction", "reduction_low", "reduction_high", "recalled",
    "collision_checks",
)  # fmt: skip


def _asked(attempts: pd.DataFrame) -> dict[str, pd.Series[Any]]:
    """What was recalled, and how: nothing and not at all without assistance, so one baseline a planner."""
    assisted = attempts["assist"] != "none"
    return {
        "top_k": attempts["top_k"].where(assisted, 0).astype(int),
        "recall": attempts["recall"].where(assisted).fillna(""),
    }


def _summarise_panel(panel: str, rows: pd.DataFrame, seed: int, resamples: int) -> pd.DataFrame:
    """The summary of one panel: one row per planner and configuration."""
    keys = ["planner", "assist", "recall", "top_k"]
    rows = rows.assign(
        milliseconds=1e3 * rows["planning_seconds"],
        solved=rows["solved"].astype(float),
        was_recalled=(rows["source"] == "recalled").astype(float),
    )
    grouped = rows.groupby(keys, sort=False)
    table = grouped.agg(
        problems=("problem_id", "nunique"),
        solved=("solved", "mean"),
        median_ms=("milliseconds", "median"),
        p90_ms=("milliseconds", lambda times: times.quantile(0.9)),
        recalled=("was_recalled", "mean"),
        collision_checks=("collision_checks", "mean"),
    )
    planner_rank = {name: i for i, name in enumerate(ranked(rows["planner"], PLANNERS))}
    assist_rank = {name: i for i, name in enumerate(ranked(rows["assist"], ASSISTS))}
    recall_rank = {name: i for i, name in enumerate(ranked(rows["recall"], RECALLS))}
    order = sorted(
        table.index,
        key=lambda key: (planner_rank[key[0]], assist_rank[key[1]], recall_rank[key[2]], key[3]),
    )
    table = table.loc[order]

    # Sorted by problem, so that the order of the rows cannot change the result.
    times = rows.pivot_table(
        index="problem_id", columns=keys, values="milliseconds", aggfunc="mean"
    ).sort_index()
    measured = times[order].to_numpy(dtype=float)
    nothing = np.full(len(times), np.nan)
    baseline = np.column_stack(
        [
            times[key].to_numpy(float) if (key := (planner, "none", "", 0)) in table.index else nothing
            for planner, *_ in order
        ]
    )
    means, reductions = bootstrap(measured, baseline, seed, resamples)
    both = ~np.isnan(measured) & ~np.isnan(baseline)
    spent = np.where(both, measured, 0.0).sum(axis=0)
    table["reduction"] = 1.0 - _ratio(spent, np.where(both, baseline, 0.0).sum(axis=0))
    table["reduction_low"], table["reduction_high"] = _interval(reductions)
    table["mean_ms"] = np.nanmean(measured, axis=0)
    table["mean_low_ms"], table["mean_high_ms"] = _interval(means)
    return table.reset_index().assign(panel=panel)[list(_COLUMNS)]


def _ratio(above: Floats, below: Floats) -> Floats:
    """``above / below``, NaN where there is nothing below."""
    quotient = np.full(above.shape, np.nan)
    np.divide(above, below, out=quotient, where=below > 0.0)
    return quotient


def _interval(resampled: Floats) -> tuple[Floats, Floats]:
    """Ends ``[C]`` of the percentile interval of ``[resamples, C]``; NaN for a column without data."""
    tail = 0.5 * (1.0 - CONFIDENCE)
    ends = np.full((2, resampled.shape[1]), np.nan)
    filled = ~np.isnan(resampled).all(axis=0)
    if filled.any():
        ends[:, filled] = np.nanquantile(resampled[:, filled], [tail, 1.0 - tail], axis=0)
    return ends[0], ends[1]
