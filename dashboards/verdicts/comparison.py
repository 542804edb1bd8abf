"""Two runs side by side, paired by problem: what the second does faster or slower than the first."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np
import pandas as pd
from rich.console import Group

from dashboards.cells import (
    NOTHING,
    Rows,
    decimals_of,
    percent,
    titled_markdown,
    titled_tables,
    with_interval,
)
from dashboards.statistics.intervals import RESAMPLES, bootstrap, interval, ratio
from dashboards.statistics.panels import Panel, panels
from dashboards.statistics.sign_tests import holm, signs
from planners.world.arrays import Floats
from storage.tables.configurations import BASELINE, Configuration

FASTER: Final = "faster"
SLOWER: Final = "slower"
OPEN: Final = "open"  # the interval reaches over 0
HEADINGS: Final = (
    "planner", "configuration", "first ms", "ms", "less time %", "fewer checks %", "slower %", "solved %",
    "verdict",
)  # fmt: skip
COLUMNS: Final = (
    "panel", "planner", "configuration", "problems", "first_ms", "ms", "reduction", "reduction_low",
    "reduction_high", "checks_reduction", "checks_reduction_low", "checks_reduction_high", "first_solved",
    "solved", "slower", "p_value", "verdict",
)  # fmt: skip


def compare_runs(
    first: pd.DataFrame, other: pd.DataFrame, seed: int = 0, resamples: int = RESAMPLES
) -> pd.DataFrame:
    """Compare two runs by the problems that both attempted.

    A machine may be faster on another day, so a planner's times are taken relative to what it needed without
    memory in the same run. Attempts without memory, and those of a planner that has none of these, are
    compared as they are: the former show how much the machines differ.

    ``first``, ``other``: attempt rows of the runs. ``seed``, ``resamples``: of the bootstrap.

    Returns a row a panel, planner and configuration that both attempted, with the columns of ``COLUMNS``:
    ``reduction`` is 1 less the ratio of the relative means, ``slower`` the share of problems in which the
    other run took relatively longer, ``p_value`` that of a sign test, corrected (Holm), ``verdict`` FASTER or
    SLOWER if the 95 % interval of the reduction says so, else OPEN.
    """
    shared = np.intersect1d(first["problem_id"], other["problem_id"])
    before = {panel.name: panel for panel in panels(first[first["problem_id"].isin(shared)])}
    after = {panel.name: panel for panel in panels(other[other["problem_id"].isin(shared)])}
    tables = [
        _compare(before[name], after[name], seed, resamples)
        for name in after
        if name in before and before[name].problems == after[name].problems
    ]
    tables = [table for table in tables if len(table)]
    if not tables:
        return pd.DataFrame(columns=list(COLUMNS))
    rows = pd.concat(tables, ignore_index=True)
    return rows.assign(p_value=holm(rows["p_value"].to_numpy(float)))[list(COLUMNS)]


class _Side(NamedTuple):
    """What one run measured in the columns that both have; ``[problems, columns]`` each."""

    times: Floats  # ms
    alone: Floats  # ms of the same planner without memory; 1 for columns that are compared as they are
    censored: Floats  # times, infinite where an attempt failed
    checks: Floats
    solved: Floats


def _side(panel: Panel, columns: list[tuple[str, Configuration]]) -> _Side:
    indices = [panel.columns.index(column) for column in columns]
    times = panel.milliseconds()
    alone = panel.baseline(times)[:, indices]
    is_baseline = np.array([configuration == BASELINE for _, configuration in columns])
    as_it_is = np.isnan(alone).all(axis=0) | is_baseline
    matrices = (panel.censored(), panel.matrix("collision_checks"), panel.matrix("solved"))
    return _Side(times[:, indices], np.where(as_it_is, 1.0, alone), *(each[:, indices] for each in matrices))


def _compare(first: Panel, other: Panel, seed: int, resamples: int) -> pd.DataFrame:
    columns = [column for column in other.columns if column in first.columns]
    if not columns:
        return pd.DataFrame()
    sides = _side(first, columns), _side(other, columns)
    before, after = (np.nanmean(side.times, axis=0) for side in sides)
    drift = ratio(*(np.nanmean(side.alone, axis=0) for side in sides))  # of machines, from other to first
    resampled = [1.0 - bootstrap(side.times, side.alone, seed, resamples).reductions for side in sides]
    low, high = interval(1.0 - ratio(resampled[1], resampled[0]))  # the same problems are drawn for both
    checks = sides[1].checks, sides[0].checks
    checks_low, checks_high = interval(bootstrap(*checks, seed, resamples).reductions)
    compared = [
        signs(mine, base)
        for mine, base in zip((drift * sides[1].censored).T, sides[0].censored.T, strict=True)
    ]
    rows = pd.DataFrame(
        {
            "panel": first.name,
            "planner": [planner for planner, _ in columns],
            "configuration": [configuration.label for _, configuration in columns],
            "problems": [each.compared for each in compared],
            "first_ms": before,
            "ms": after,
            "reduction": 1.0 - ratio(drift * after, before),
            "reduction_low": low,
            "reduction_high": high,
            "checks_reduction": 1.0 - ratio(*(np.nanmean(each, axis=0) for each in checks)),
            "checks_reduction_low": checks_low,
            "checks_reduction_high": checks_high,
            "first_solved": np.nanmean(sides[0].solved, axis=0),
            "solved": np.nanmean(sides[1].solved, axis=0),
            "slower": [each.slower for each in compared],
            "p_value": [each.p_value for each in compared],
        }
    )
    verdicts = np.select([rows["reduction_low"] > 0.0, rows["reduction_high"] < 0.0], [FASTER, SLOWER], OPEN)
    without = [configuration == BASELINE for _, configuration in columns]
    return rows.assign(verdict=np.where(without, NOTHING, verdicts))


def comparison_table(rows: pd.DataFrame) -> Group:
    """The ``rows`` of ``compare_runs`` for a terminal: a table a panel."""
    return titled_tables(HEADINGS, comparison_cells(rows))


def comparison_markdown(rows: pd.DataFrame) -> str:
    """The ``rows`` of ``compare_runs`` as Markdown: a heading and a table a panel."""
    return titled_markdown(HEADINGS, comparison_cells(rows))


def verdict(rows: pd.DataFrame) -> str:
    """In words, how many configurations in the ``rows`` of ``compare_runs`` are faster, slower and open."""
    counts = Counter(rows["verdict"])
    named = [f"{counts[each]} {each}" for each in (FASTER, SLOWER, OPEN)]
    return f"{', '.join(named)} of {sum(counts[each] for each in (FASTER, SLOWER, OPEN))} configurations"


def comparison_cells(rows: pd.DataFrame) -> Iterator[tuple[str, list[Rows]]]:
    """Of each panel in the ``rows`` of ``compare_runs`` a title, and a group of cells for each planner."""
    for panel, of_panel in rows.groupby("panel", sort=False):
        decimals = decimals_of(of_panel[["first_ms", "ms"]].to_numpy(dtype=float))
        groups = [
            [_cells(row, decimals) for row in of_planner.to_dict("records")]
            for _, of_planner in of_panel.groupby("planner", sort=False)
        ]
        yield f"{panel}, {int(of_panel['problems'].max()):,} problems in both; [95 %]", groups


def _cells(row: dict[Any, Any], decimals: int) -> list[str]:
    return [
        row["planner"],
        row["configuration"],
        *[f"{row[name]:,.{decimals}f}" for name in ("first_ms", "ms")],
        *[
            with_interval(row[name], row[f"{name}_low"], row[f"{name}_high"])
            for name in ("reduction", "checks_reduction")
        ],
        percent(row["slower"]),
        percent(row["solved"]),
        row["verdict"],
    ]
