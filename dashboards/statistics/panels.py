"""What the attempt rows say: times, solved shares and reductions, paired by problem.

Failures stay in every figure: with the time they took in means and quantiles, as slower than every success
where two attempts are compared. A mean over survivors is never formed.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np
import pandas as pd

from dashboards.statistics.intervals import (
    RESAMPLES,
    bootstrap,
    interquartile_mean,
    interval,
    quantile_interval,
    ratio,
)
from dashboards.statistics.sign_tests import holm, signs
from planners.world.arrays import Floats
from storage.tables.configurations import BASELINE, Configuration, configured

COMBINED: Final = "combined"  # the memory of all classes; its attempts form a panel of their own
PANELS: Final = ("curves", "random", "trap")
PLANNERS: Final = ("rrt", "gust", "follow")


class Panel(NamedTuple):
    """All attempts of one class with its own memory, or of all classes with the combined one."""

    name: str
    rows: pd.DataFrame  # with a column ``cell``: the flat place in [problems, columns] that the row is for
    problems: int
    columns: list[tuple[str, Configuration]]  # planner and configuration, in reading order

    def matrix(self, column: str) -> Floats:
        """A number of each row, ``[problems, columns]``; NaN where not attempted, the mean where repeated."""
        size = self.problems * len(self.columns)
        cells = self.rows["cell"].to_numpy()
        sums = np.bincount(cells, self.rows[column].to_numpy(float), minlength=size).astype(np.float64)
        counts = np.bincount(cells, minlength=size).astype(np.float64)
        return ratio(sums, counts).reshape(self.problems, -1)

    def milliseconds(self) -> Floats:
        """Planning times, failures with the time they took."""
        return 1e3 * self.matrix("planning_seconds")

    def censored(self) -> Floats:
        """Planning times in milliseconds, infinite where an attempt failed: all that is known is "longer"."""
        solved = self.matrix("solved")
        return np.where(solved < 1.0, np.inf, self.milliseconds())

    def column(self, planner: str, wanted: Configuration) -> int | None:
        """The place of a planner's configuration, if it was attempted."""
        return self.columns.index((planner, wanted)) if (planner, wanted) in self.columns else None

    def baseline(self, values: Floats) -> Floats:
        """Each column's values ``[problems, columns]`` of its planner without memory; NaN if not there."""
        places = [self.column(planner, BASELINE) for planner, _ in self.columns]
        nothing = np.full(self.problems, np.nan)
        return np.column_stack([nothing if i is None else values[:, i] for i in places])


def panels(attempts: pd.DataFrame) -> Iterator[Panel]:
    """Attempt rows by panel: each class with its own memory, then all with the combined memory, if any.

    Attempts without memory belong to both.
    """
    rows, known = configured(attempts)
    combined = (rows["memory"] == COMBINED).to_numpy(bool)
    alone = rows["memory"].isna().to_numpy()
    planners, classes = rows["planner"].astype("category"), rows["problem_class"].astype("category")
    rows = rows.assign(planner=planners, problem_class=classes)
    own = rows[alone | ~combined]
    for name in ranked(classes.cat.categories, PANELS):
        of_class = own[own["problem_class"] == name]
        if len(of_class):
            yield _panel(name, of_class, known)
    if (combined & ~alone).any():
        yield _panel(COMBINED, rows[alone | combined], known)


def summarise(attempts: pd.DataFrame, seed: int = 0, resamples: int = RESAMPLES) -> pd.DataFrame:
    """One row per panel, planner and configuration, in reading order, with the columns of ``COLUMNS``.

    Times are milliseconds; ``_low`` and ``_high`` are the ends of bootstrap 95 % intervals; shares and
    reductions are fractions. ``reduction``: of mean planning time against the same planner without memory on
    the problems that both attempted (NaN where there are none). ``slower, slowdown, p_value``: of
    ``signs.Signs``, the last corrected by Holm for all comparisons of the table.
    """
    tables = [_summarise(panel, seed, resamples) for panel in panels(attempts)]
    if not tables:
        return pd.DataFrame(columns=list(COLUMNS))
    summary = pd.concat(tables, ignore_index=True)
    return summary.assign(p_value=holm(summary["p_value"].to_numpy(float)))[list(COLUMNS)]


def summarise_continual(attempts: pd.DataFrame, seed: int = 0, resamples: int = RESAMPLES) -> pd.DataFrame:
    """``summarise`` for each number of experiences in the column ``experiences``, and that column before."""
    tables = [
        summarise(rows, seed, resamples).assign(experiences=count)
        for count, rows in attempts.groupby("experiences")
    ]
    summary = pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=list(COLUMNS))
    return summary.reindex(columns=["experiences", *COLUMNS])


def compare(
    attempts: pd.DataFrame,
    pairs: Sequence[tuple[Configuration, Configuration]],
    column: str = "planning_seconds",
    seed: int = 0,
    resamples: int = RESAMPLES,
) -> pd.DataFrame:
    """How much less of ``column`` the second configuration of each pair needs than the first.

    One row per panel, planner and pair of which both were attempted: ``panel, planner, before, after``
    (labels), ``reduction`` of the mean on the same problems as a fraction, ``reduction_low, reduction_high``.
    """
    tables = []
    for panel in panels(attempts):
        found = [
            (planner, before, after, i, j)
            for planner in dict.fromkeys(planner for planner, _ in panel.columns)
            for before, after in pairs
            if (i := panel.column(planner, before)) is not None
            and (j := panel.column(planner, after)) is not None
        ]
        if found:
            values = panel.matrix(column)
            first = values[:, [i for *_, i, _ in found]]
            second = values[:, [j for *_, j in found]]
            low, high = interval(bootstrap(second, first, seed, resamples).reductions)
            tables.append(
                pd.DataFrame(
                    {
                        "panel": panel.name,
                        "planner": [each[0] for each in found],
                        "before": [each[1].label for each in found],
                        "after": [each[2].label for each in found],
                        "reduction": _reduction(second, first),
                        "reduction_low": low,
                        "reduction_high": high,
                    }
                )
            )
    names = ["panel", "planner", "before", "after", "reduction", "reduction_low", "reduction_high"]
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=names)


def ranked(names: Iterable[Hashable], known: tuple[str, ...]) -> list[str]:
    """The distinct names: known ones in their order, then the others alphabetically."""
    distinct = {str(name) for name in names}
    return [name for name in known if name in distinct] + sorted(distinct.difference(known))


COLUMNS: Final = (
    "panel", "planner", "configuration", "assist", "recall", "top_k", "problems", "solved",
    "mean_ms", "mean_low_ms", "mean_high_ms",
    "interquartile_mean_ms", "interquartile_mean_low_ms", "interquartile_mean_high_ms",
    "median_ms", "median_low_ms", "median_high_ms", "p90_ms", "p90_low_ms", "p90_high_ms",
    "reduction", "reduction_low", "reduction_high", "slower", "slowdown", "p_value",
    "recalled", "collision_checks",
)  # fmt: skip


def _panel(name: str, rows: pd.DataFrame, known: dict[str, Configuration]) -> Panel:
    """Find each row's place; problems are sorted, so that the order of the rows cannot change a result."""
    meant = list(known.values())
    planners = ranked(rows["planner"].unique(), PLANNERS)
    place = {planner: i for i, planner in enumerate(planners)}
    first = rows["planner"].cat.rename_categories(
        {each: place.get(each, -1) for each in rows["planner"].cat.categories}
    )
    wanted = first.astype(int).to_numpy() * len(meant) + rows["configuration"].cat.codes.to_numpy(int)
    there, column = np.unique(wanted, return_inverse=True)
    problem, problems = pd.factorize(rows["problem_id"], sort=True)
    cells = problem * len(there) + column
    columns = [(planners[i // len(meant)], meant[i % len(meant)]) for i in there.tolist()]
    return Panel(name, rows.assign(cell=cells), len(problems), columns)


def _summarise(panel: Panel, seed: int, resamples: int) -> pd.DataFrame:
    """The summary of one panel; its p-values are not corrected yet."""
    times = panel.milliseconds()
    baseline = panel.baseline(times)
    resampled = bootstrap(times, baseline, seed, resamples, interquartile=True)
    table = pd.DataFrame([each._asdict() for _, each in panel.columns])
    table["configuration"] = [each.label for _, each in panel.columns]
    table["planner"] = [planner for planner, _ in panel.columns]
    table["panel"] = panel.name
    table["problems"] = (~np.isnan(times)).sum(axis=0)
    table["solved"] = np.nanmean(panel.matrix("solved"), axis=0)
    recalled = panel.rows.assign(recalled=panel.rows["source"] == "recalled")
    table["recalled"] = np.nanmean(panel._replace(rows=recalled).matrix("recalled"), axis=0)
    table["collision_checks"] = np.nanmean(panel.matrix("collision_checks"), axis=0)
    table["mean_ms"] = np.nanmean(times, axis=0)
    table["mean_low_ms"], table["mean_high_ms"] = interval(resampled.means)
    table["interquartile_mean_ms"] = [interquartile_mean(column) for column in times.T]
    table["interquartile_mean_low_ms"], table["interquartile_mean_high_ms"] = interval(
        resampled.interquartile_means
    )
    for name, share in (("median", 0.5), ("p90", 0.9)):
        table[f"{name}_ms"] = np.nanquantile(times, share, axis=0)
        ends = np.array([quantile_interval(column, share) for column in times.T])
        table[f"{name}_low_ms"], table[f"{name}_high_ms"] = ends.T
    table["reduction"] = _reduction(times, baseline)
    table["reduction_low"], table["reduction_high"] = interval(resampled.reductions)
    censored = panel.censored()
    compared = [
        signs(mine, other) for mine, other in zip(censored.T, panel.baseline(censored).T, strict=True)
    ]
    of_baseline = [each == BASELINE for _, each in panel.columns]
    for name in ("slower", "slowdown", "p_value"):
        table[name] = [getattr(each, name) for each in compared]
        table.loc[of_baseline, name] = np.nan
    return table


def _reduction(values: Floats, baseline: Floats) -> Floats:
    """One less the ratio of the means ``[C]`` over the problems that both attempted."""
    both = ~np.isnan(values) & ~np.isnan(baseline)
    return 1.0 - ratio(np.where(both, values, 0.0).sum(axis=0), np.where(both, baseline, 0.0).sum(axis=0))
