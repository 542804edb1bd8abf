"""What attempt rows say: planning and driving times, shares solved and reductions, paired by problem.

Failures stay in every figure of planning. Means and quantiles count them with the time they took; where two
attempts are compared, a failure is slower than every success. Only solved problems have driving times, so two
configurations are compared on problems that both solved.
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
from planners.attempt import SOURCES
from planners.world.arrays import Flags, Floats
from storage.tables.configurations import Configuration, configured

COMBINED: Final = "combined"  # the memory of all classes, whose attempts form a panel of their own
PANELS: Final = ("curves", "random", "trap")
PLANNERS: Final = ("rrt", "gust", "follow", "lattice")


class Panel(NamedTuple):
    """All attempts at one class with its own memory, or at all classes with the combined one."""

    name: str
    rows: pd.DataFrame  # with a column ``cell``: the row's index in a flattened [problems, columns]
    problems: int
    columns: list[tuple[str, Configuration]]  # planner and configuration, in reading order

    def labels(self) -> pd.DataFrame:
        """A row a column of the panel: ``panel, planner, configuration``."""
        names = [(self.name, planner, configuration.label) for planner, configuration in self.columns]
        return pd.DataFrame(names, columns=["panel", "planner", "configuration"])

    def matrix(self, column: str) -> Floats:
        """A ``column`` of the rows as ``[problems, columns]``: NaN if not attempted, the mean if repeated."""
        size = self.problems * len(self.columns)
        cells = self.rows["cell"].to_numpy()
        sums = np.bincount(cells, self.rows[column].to_numpy(float), minlength=size).astype(np.float64)
        counts = np.bincount(cells, minlength=size).astype(np.float64)
        return ratio(sums, counts).reshape(self.problems, -1)

    def milliseconds(self) -> Floats:
        """Planning times ``[problems, columns]``, failures with the time they took."""
        return 1e3 * self.matrix("planning_seconds")

    def hits(self) -> Floats:
        """Whether a recalled plan fits the problem (``hits_of``), ``[problems, columns]``."""
        return self._replace(rows=self.rows.assign(hit=hits_of(self.rows))).matrix("hit")

    def censored(self) -> Floats:
        """Planning times in milliseconds ``[problems, columns]``, infinite where an attempt failed."""
        solved = self.matrix("solved")
        return np.where(solved < 1.0, np.inf, self.milliseconds())

    def driving_seconds(self) -> Floats:
        """Mean driving times ``[columns]`` of the plans that were found; NaN if there is none."""
        return _means(self.matrix("duration_s"))

    def total_seconds(self, longest: float) -> Floats:
        """Planning and driving ``[problems, columns]``; an attempt without a plan drives the ``longest``."""
        driving = np.where(self.matrix("solved") < 1.0, longest, self.matrix("duration_s"))
        return self.matrix("planning_seconds") + driving

    def column(self, planner: str, configuration: Configuration) -> int | None:
        """The index of a planner's configuration; None if it was not attempted."""
        wanted = (planner, configuration)
        return self.columns.index(wanted) if wanted in self.columns else None

    def baseline(self, values: Floats) -> Floats:
        """``values [problems, columns]`` of what each column is compared with; NaN if not attempted."""
        indices = [self.column(planner, each.baseline) for planner, each in self.columns]
        nothing = np.full(self.problems, np.nan)
        return np.column_stack([nothing if i is None else values[:, i] for i in indices])


def panels(attempts: pd.DataFrame) -> Iterator[Panel]:
    """Sort ``attempts`` into panels: each class with its own memory, then all with the combined one, if any.

    Attempts without memory belong to both.
    """
    rows, configurations = configured(attempts)
    combined = (rows["memory"] == COMBINED).to_numpy(bool)
    alone = rows["memory"].isna().to_numpy()
    planners, classes = rows["planner"].astype("category"), rows["problem_class"].astype("category")
    rows = rows.assign(planner=planners, problem_class=classes)
    own = rows[alone | ~combined]
    for name in ranked(classes.cat.categories, PANELS):
        of_class = own[own["problem_class"] == name]
        if len(of_class):
            yield _panel(name, of_class, configurations)
    if (combined & ~alone).any():
        yield _panel(COMBINED, rows[alone | combined], configurations)


def summarise(attempts: pd.DataFrame, seed: int = 0, resamples: int = RESAMPLES) -> pd.DataFrame:
    """Summarise ``attempts``: a row a panel, planner and configuration, in reading order.

    Args:
        attempts: rows of attempts, as ``storage.tables.attempts`` reads them.
        seed: seed of the bootstrap.
        resamples: how often the bootstrap draws the problems anew.

    Returns:
        the columns of ``COLUMNS``. Times are milliseconds, ``_low`` and ``_high`` the ends of bootstrap 95 %
        intervals, shares and reductions fractions. ``reduction`` is that of the mean planning time against
        the same planner without memory, on the problems that both attempted (NaN if there are none).
        ``slower``, ``slowdown`` and ``p_value`` are those of ``sign_tests.Signs``, the last corrected for all
        comparisons of the table (Holm). ``driving_s`` is the mean driving time of the plans. ``sooner_s``
        says how much sooner the robot is there than by the same planner without memory, planning and driving
        counted, on the problems that both solved.
    """
    tables = [_summarise(panel, seed, resamples) for panel in panels(attempts)]
    if not tables:
        return pd.DataFrame(columns=list(COLUMNS))
    summary = pd.concat(tables, ignore_index=True)
    return summary.assign(p_value=holm(summary["p_value"].to_numpy(float)))[list(COLUMNS)]


def summarise_continual(attempts: pd.DataFrame, seed: int = 0, resamples: int = RESAMPLES) -> pd.DataFrame:
    """``summarise`` for each number in the column ``experiences``, which comes first in the table."""
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
    """How much less of ``column``, a column of ``attempts``, the second configuration of each pair needs.

    Args:
        attempts: rows of attempts, as ``storage.tables.attempts`` reads them.
        pairs: configurations, the first of a pair is what the second is compared with.
        column: name of the column to compare.
        seed: seed of the bootstrap.
        resamples: how often the bootstrap draws the problems anew.

    Returns:
        a row a panel, planner and pair of which both were attempted: ``panel, planner, before, after``
        (labels), ``reduction`` of the mean on the same problems as a fraction, ``reduction_low,
        reduction_high``.
    """
    tables = []
    for panel in panels(attempts):
        columns = [
            (planner, before.label, after.label, i, j)
            for planner in dict.fromkeys(planner for planner, _ in panel.columns)
            for before, after in pairs
            if (i := panel.column(planner, before)) is not None
            and (j := panel.column(planner, after)) is not None
        ]
        if columns:
            values = panel.matrix(column)
            first, second = (values[:, np.array([each[side] for each in columns], int)] for side in (3, 4))
            low, high = interval(bootstrap(second, first, seed, resamples).reductions)
            table = pd.DataFrame([each[:3] for each in columns], columns=["planner", "before", "after"])
            reductions = {
                "reduction": _reduction(second, first),
                "reduction_low": low,
                "reduction_high": high,
            }
            tables.append(table.assign(panel=panel.name, **reductions))
    names = ["panel", "planner", "before", "after", "reduction", "reduction_low", "reduction_high"]
    return pd.concat(tables, ignore_index=True)[names] if tables else pd.DataFrame(columns=names)


def hits_of(attempts: pd.DataFrame) -> Flags:
    """Where a recalled plan answers the problem as it is, ``[n]``, whatever a search found beside it.

    Rows of earlier versions do not say so: there it is where a recalled plan is the answer.
    """
    answers = attempts["source"] == "recalled"
    return attempts["hit"].where(attempts["hit"].notna(), answers).to_numpy(bool)


def ranked(names: Iterable[Hashable], order: tuple[str, ...]) -> list[str]:
    """The distinct ``names``: those in ``order`` first, in that order, then the others alphabetically."""
    distinct = {str(name) for name in names}
    return [name for name in order if name in distinct] + sorted(distinct.difference(order))


COLUMNS: Final = (
    "panel", "planner", "configuration", "assist", "recall", "top_k", "polished", "problems", "solved",
    "mean_ms", "mean_low_ms", "mean_high_ms",
    "interquartile_mean_ms", "interquartile_mean_low_ms", "interquartile_mean_high_ms",
    "median_ms", "median_low_ms", "median_high_ms", "p90_ms", "p90_low_ms", "p90_high_ms",
    "reduction", "reduction_low", "reduction_high", "slower", "slowdown", "p_value",
    "driving_s", "sooner_s", "sooner_low_s", "sooner_high_s", "hit", *SOURCES,
    "collision_checks",
)  # fmt: skip


def _panel(name: str, rows: pd.DataFrame, configurations: dict[str, Configuration]) -> Panel:
    """Give each row its cell; problems are sorted, so that the order of the rows cannot change a result."""
    in_order = list(configurations.values())
    planners = ranked(rows["planner"].unique(), PLANNERS)
    numbers = {
        each: planners.index(each) if each in planners else -1 for each in rows["planner"].cat.categories
    }
    planner = rows["planner"].cat.rename_categories(numbers).astype(int).to_numpy()
    pair = planner * len(in_order) + rows["configuration"].cat.codes.to_numpy(int)
    attempted, column = np.unique(pair, return_inverse=True)
    problem, problems = pd.factorize(rows["problem_id"], sort=True)
    cells = problem * len(attempted) + column
    columns = [(planners[i // len(in_order)], in_order[i % len(in_order)]) for i in attempted.tolist()]
    return Panel(name, rows.assign(cell=cells), len(problems), columns)


def _summarise(panel: Panel, seed: int, resamples: int) -> pd.DataFrame:
    """The summary of one panel; its p-values are not corrected yet."""
    times = panel.milliseconds()
    baseline = panel.baseline(times)
    resampled = bootstrap(times, baseline, seed, resamples, interquartile=True)
    table = panel.labels().join(pd.DataFrame([each._asdict() for _, each in panel.columns]))
    table["problems"] = (~np.isnan(times)).sum(axis=0)
    table["solved"] = np.nanmean(panel.matrix("solved"), axis=0)
    table["hit"] = np.nanmean(panel.hits(), axis=0)
    for source in SOURCES:  # what the plans of the problems are
        of_source = panel.rows.assign(is_so=panel.rows["source"] == source)
        table[source] = np.nanmean(panel._replace(rows=of_source).matrix("is_so"), axis=0)
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
    driving = panel.matrix("duration_s")
    total = driving + 1e-3 * times
    saved = panel.baseline(total) - total
    table["driving_s"], table["sooner_s"] = _means(driving), _means(saved)
    table["sooner_low_s"], table["sooner_high_s"] = interval(bootstrap(saved, saved, seed, resamples).means)
    censored = panel.censored()
    compared = [
        signs(mine, other) for mine, other in zip(censored.T, panel.baseline(censored).T, strict=True)
    ]
    of_baseline = [each == each.baseline for _, each in panel.columns]
    for name in ("slower", "slowdown", "p_value"):
        table[name] = [getattr(each, name) for each in compared]
        table.loc[of_baseline, name] = np.nan
    return table


def _means(values: Floats) -> Floats:
    """Average each column of ``values [problems, C]`` without its NaN; a column of nothing else gives NaN."""
    there = ~np.isnan(values)
    return ratio(np.where(there, values, 0.0).sum(axis=0), there.sum(axis=0).astype(np.float64))


def _reduction(values: Floats, baseline: Floats) -> Floats:
    """1 less the ratio of the means ``[C]`` of ``values`` and ``baseline`` where both have a number."""
    both = ~np.isnan(values) & ~np.isnan(baseline)
    return 1.0 - ratio(np.where(both, values, 0.0).sum(axis=0), np.where(both, baseline, 0.0).sum(axis=0))
