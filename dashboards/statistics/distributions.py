"""From attempt rows to the curves behind the means: solved against time, performance profiles, time split."""

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
MOST_RATIO: Final = 1000.0  # a profile ends there: what is slower still counts as not solved


class Part(NamedTuple):
    """A part of planning time, and the columns whose seconds belong to it."""

    name: str
    columns: tuple[str, ...]


PARTS: Final = (
    Part("draw grid", ("occupancy_seconds",)),
    Part("encode", ("encode_seconds",)),
    Part("recall", ("recall_seconds",)),
    Part("obstacles", ("scene_seconds",)),
    Part("check", ("check_seconds",)),
    Part("guide, repair", ("guide_seconds", "repair_seconds")),
    Part("roadmap", ("roadmap_seconds",)),
    Part("search", ("search_seconds",)),
)
REST: Final = "rest"  # of the planning time, which is measured around everything


def solved_against_time(attempts: pd.DataFrame) -> pd.DataFrame:
    """Share of all problems solved within a time: ``panel, planner, assist, recall, top_k, ms, solved``.

    A failure is censored: it never counts as solved, however long the planner tried. Of each assist and
    recall only the configuration with most plans gets a curve, and none where plans are picked blindly.
    """
    return _curves(attempts, "ms", _reached_by_time)


def performance_profile(attempts: pd.DataFrame) -> pd.DataFrame:
    """Share of problems solved within a multiple of the fastest configuration's time (Dolan and Moré 2002).

    Columns ``panel, planner, assist, recall, top_k, ratio, solved``. The fastest is among those of the
    same planner that get a curve; problems that a configuration was not given are left out of its curve.
    """
    return _curves(attempts, "ratio", _reached_by_ratio)


def time_split(attempts: pd.DataFrame) -> pd.DataFrame:
    """Mean milliseconds of each part of planning time: ``panel, planner, configuration, part, ms``."""
    tables = []
    for panel in panels(attempts):
        parts = {
            part.name: np.sum([_mean_ms(panel, name) for name in part.columns], axis=0) for part in PARTS
        }
        measured = np.sum(list(parts.values()), axis=0)
        parts[REST] = np.maximum(_mean_ms(panel, "planning_seconds") - measured, 0.0)
        labels = [(planner, each.label) for planner, each in panel.columns]
        tables += [
            pd.DataFrame(labels, columns=["planner", "configuration"]).assign(
                panel=panel.name, part=part, ms=milliseconds
            )
            for part, milliseconds in parts.items()
        ]
    names = ["panel", "planner", "configuration", "part", "ms"]
    return pd.concat(tables, ignore_index=True)[names] if tables else pd.DataFrame(columns=names)


def endings(attempts: pd.DataFrame) -> pd.DataFrame:
    """How attempts ended: one row per panel, planner and configuration, a column of counts per status."""
    tables = []
    for panel in panels(attempts):
        columns = panel.rows["cell"] % len(panel.columns)
        counts = pd.crosstab(columns, panel.rows["status"])
        labels = pd.DataFrame(
            [(panel.name, planner, each.label) for planner, each in panel.columns],
            columns=["panel", "planner", "configuration"],
        )
        tables.append(labels.join(counts))
    if not tables:
        return pd.DataFrame(columns=["panel", "planner", "configuration"])
    found = pd.concat(tables, ignore_index=True)
    names = ranked(found.columns[3:], ("solved",))
    return found[["panel", "planner", "configuration"]].join(found[names].fillna(0).astype(int))


def _leading(panel: Panel) -> list[int]:
    """The columns worth a curve: of each assist and recall that with most plans, nothing picked blindly."""
    most = {(planner, each.assist, each.recall): i for i, (planner, each) in enumerate(panel.columns)}
    return [i for (_, _, recall), i in most.items() if recall != "random"]


def _mean_ms(panel: Panel, column: str) -> Floats:
    """Mean of some seconds as milliseconds ``[columns]``; 0 where the rows do not tell them."""
    if column not in panel.rows:
        return np.zeros(len(panel.columns))
    values = 1e3 * panel.matrix(column)
    means = ratio(np.nansum(values, axis=0), np.count_nonzero(~np.isnan(values), axis=0).astype(float))
    return np.nan_to_num(means)


def _reached_by_time(censored: Floats) -> tuple[Floats, Floats]:
    """Milliseconds ``[P]``, and the shares ``[P, C]`` of problems that are solved by then."""
    found = censored[np.isfinite(censored)]
    if not len(found):
        return np.empty(0), np.empty((0, censored.shape[1]))
    points = np.geomspace(found.min(), found.max(), POINTS)
    return points, _shares_within(censored, points)


def _reached_by_ratio(censored: Floats) -> tuple[Floats, Floats]:
    """Multiples ``[P]`` of the fastest time, and the shares ``[P, C]`` of problems solved within them."""
    fastest = np.fmin.reduce(censored, axis=1, keepdims=True)
    ratios = np.divide(censored, fastest, out=censored.copy(), where=np.isfinite(censored))
    found = ratios[np.isfinite(ratios)]
    points = np.geomspace(1.0, min(float(found.max(initial=1.0)), MOST_RATIO), POINTS)
    return points, _shares_within(ratios, points)


def _shares_within(values: Floats, points: Floats) -> Floats:
    """Share ``[P, C]`` of the numbers in each column ``[n, C]`` up to each point; NaN is no number."""
    columns = [np.sort(column[~np.isnan(column)]) for column in values.T]
    within = [np.searchsorted(column, points, side="right") / max(len(column), 1) for column in columns]
    return np.column_stack(within)


def _curves(
    attempts: pd.DataFrame, x: str, reached: Callable[[Floats], tuple[Floats, Floats]]
) -> pd.DataFrame:
    """Shares ``solved`` against ``x`` of every planner and configuration, a panel after the other."""
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
