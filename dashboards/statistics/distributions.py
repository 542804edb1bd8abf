"""What lies behind the mean planning times: their distributions, their parts, and how attempts ended."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
import pandas as pd

from dashboards.statistics.intervals import ratio
from dashboards.statistics.panels import Panel, panels, ranked
from planners.world.arrays import Floats
from storage.tables.configurations import Configuration

POINTS: Final = 160  # of a curve: finer than a figure shows
MOST_RATIO: Final = 1000.0  # where a profile ends: what is slower counts as not solved


class TimePart(NamedTuple):
    """A part of the planning time, and the columns of seconds that add up to it."""

    name: str
    columns: tuple[str, ...]


TIME_PARTS: Final = (
    TimePart("draw grid", ("occupancy_seconds",)),
    TimePart("encode", ("encode_seconds",)),
    TimePart("recall", ("recall_seconds",)),
    TimePart("obstacles", ("scene_seconds",)),
    TimePart("check", ("check_seconds",)),
    TimePart("guide, repair", ("guide_seconds", "repair_seconds")),
    TimePart("roadmap", ("roadmap_seconds",)),
    TimePart("search", ("search_seconds",)),
)
REST: Final = "rest"  # the planning time, which is measured around everything, less its parts
_SPLIT: Final = ("panel", "planner", "configuration", "part", "ms")


def solved_against_time(attempts: pd.DataFrame) -> pd.DataFrame:
    """Share of the problems of ``attempts`` that are solved within a time.

    A failure never counts as solved, however long the planner tried. Of the configurations that differ only
    in their number of plans, the one with most gets a curve; those that pick plans blindly get none.

    Returns rows of ``panel, planner, assist, recall, top_k, ms, solved``.
    """
    return _curves(attempts, "ms", _reached_by_time)


def performance_profile(attempts: pd.DataFrame) -> pd.DataFrame:
    """Share of problems solved within a multiple of the fastest configuration's time (Dolan and Moré 2002).

    Configurations of ``attempts`` get curves as in ``solved_against_time``; the fastest is among those of the
    same planner. A curve leaves out the problems that its configuration did not attempt.

    Returns rows of ``panel, planner, assist, recall, top_k, ratio, solved``.
    """
    return _curves(attempts, "ratio", _reached_by_ratio)


def time_split(attempts: pd.DataFrame) -> pd.DataFrame:
    """Mean time of each part of planning: rows of ``panel, planner, configuration, part, ms``."""
    tables = []
    for panel in panels(attempts):
        parts = {
            part.name: np.sum([_mean_ms(panel, name) for name in part.columns], axis=0) for part in TIME_PARTS
        }
        measured = np.sum(list(parts.values()), axis=0)
        parts[REST] = np.maximum(_mean_ms(panel, "planning_seconds") - measured, 0.0)
        tables += [panel.labels().assign(part=part, ms=means) for part, means in parts.items()]
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=list(_SPLIT))


def endings(attempts: pd.DataFrame) -> pd.DataFrame:
    """How ``attempts`` ended: a row a panel, planner and configuration, a column of counts a status."""
    tables = []
    for panel in panels(attempts):
        columns = panel.rows["cell"] % len(panel.columns)
        tables.append(panel.labels().join(pd.crosstab(columns, panel.rows["status"])))
    if not tables:
        return pd.DataFrame(columns=list(_SPLIT[:3]))
    counts = pd.concat(tables, ignore_index=True)
    statuses = ranked(counts.columns[3:], ("solved",))
    return counts[list(_SPLIT[:3])].join(counts[statuses].fillna(0).astype(int))


def _leading(panel: Panel) -> list[int]:
    """The columns that get a curve: of each assist and recall the one with most plans, none if blind."""
    most = {(planner, each.assist, each.recall): i for i, (planner, each) in enumerate(panel.columns)}
    return [i for (_, _, recall), i in most.items() if recall != "random"]


def _mean_ms(panel: Panel, column: str) -> Floats:
    """Means ``[columns]`` of a column of seconds, in milliseconds; 0 where no row says it."""
    values = 1e3 * panel.matrix(column)
    means = ratio(np.nansum(values, axis=0), np.count_nonzero(~np.isnan(values), axis=0).astype(float))
    return np.nan_to_num(means)


def _reached_by_time(censored: Floats) -> tuple[Floats, Floats]:
    """Times ``[P]`` in milliseconds, and the shares ``[P, C]`` of problems that are solved by then."""
    times = censored[np.isfinite(censored)]
    if not len(times):
        return np.empty(0), np.empty((0, censored.shape[1]))
    points = np.geomspace(times.min(), times.max(), POINTS)
    return points, _shares_within(censored, points)


def _reached_by_ratio(censored: Floats) -> tuple[Floats, Floats]:
    """Multiples ``[P]`` of the fastest time, and the shares ``[P, C]`` of problems solved within them."""
    fastest = np.fmin.reduce(censored, axis=1, keepdims=True)
    ratios = np.divide(censored, fastest, out=censored.copy(), where=np.isfinite(censored))
    most = float(ratios[np.isfinite(ratios)].max(initial=1.0))
    points = np.geomspace(1.0, min(most, MOST_RATIO), POINTS)
    return points, _shares_within(ratios, points)


def _shares_within(values: Floats, points: Floats) -> Floats:
    """Share ``[P, C]`` of the numbers in each column of ``values [n, C]`` up to each point, without NaN."""
    columns = [np.sort(column[~np.isnan(column)]) for column in values.T]
    within = [np.searchsorted(column, points, side="right") / max(len(column), 1) for column in columns]
    return np.column_stack(within)


def _curves(
    attempts: pd.DataFrame, x: str, reached: Callable[[Floats], tuple[Floats, Floats]]
) -> pd.DataFrame:
    """A curve of the shares ``solved`` against ``x`` for every planner and configuration, panel by panel."""
    tables = []
    for panel in panels(attempts):
        censored = panel.censored()
        leading = _leading(panel)
        for planner in dict.fromkeys(planner for planner, _ in panel.columns):
            of_planner = [i for i in leading if panel.columns[i][0] == planner]
            points, shares = reached(censored[:, of_planner])
            for i, share in zip(of_planner, shares.T, strict=True):
                names = {"panel": panel.name, "planner": planner, **panel.columns[i][1]._asdict()}
                tables.append(pd.DataFrame({**names, x: points, "solved": share}))
    columns = ["panel", "planner", *Configuration._fields, x, "solved"]
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=columns)
