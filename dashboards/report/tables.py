"""The summaries of a run as tables: for a terminal, for a Markdown page, for a spreadsheet."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final

import pandas as pd
from rich.console import Group
from rich.table import Table

from dashboards.cells import (
    NOTHING,
    Rows,
    count,
    decimals_of,
    markdown_table,
    p_value,
    percent,
    reduction,
    rich_table,
    share,
    titled_markdown,
    titled_tables,
)
from dashboards.statistics.panels import PLANNERS, ranked
from dashboards.verdicts.claim_rules import Claim
from storage.tables.configurations import Configuration

_HEADINGS: Final = (
    "planner", "configuration", "solved", "mean", "median", "90 %", "reduction % [95 %]", "slower",
    "hits", "checks",
)  # fmt: skip
FULL_HEADINGS: Final = (
    "planner", "configuration", "solved %", "mean ms [95 %]", "reduction of the mean % [95 %]", "slower %",
    "median slowdown", "p (sign test, Holm)", "median ms [95 %]", "90 % ms [95 %]",
    "interquartile mean ms [95 %]", "recalled %", "collision checks",
)  # fmt: skip
RETRIEVAL_HEADINGS: Final = (
    "class", "memory", "protocol", "recall", "origin@1", "origin@5", "hit@1", "hit@5", "oracle", "none",
    "count",
)  # fmt: skip
STAGE_HEADINGS: Final = (
    "stage", "seconds", "chunks", "workers", "between chunks %", "worker's MB at first", "at last",
)  # fmt: skip


def summary_table(summary: pd.DataFrame) -> Group:
    """The summary (``statistics.summarise``) for a terminal at least 110 columns wide: a table a class."""
    titled = titled_rows(summary, _cells)
    return titled_tables(
        _HEADINGS, [(f"{title}; times in ms; solved, slower, hits in %", groups) for title, groups in titled]
    )


def summary_markdown(summary: pd.DataFrame) -> str:
    """The whole summary as Markdown: a heading and a table a class."""
    return titled_markdown(FULL_HEADINGS, titled_rows(summary, full_cells))


def retrieval_table(retrieval: pd.DataFrame) -> Table:
    """Retrieval (``retrieval.summarise_retrieval``) for a terminal, in per cent of the problems."""
    return rich_table("Retrieval, % of problems", RETRIEVAL_HEADINGS, retrieval_groups(retrieval))


def retrieval_markdown(retrieval: pd.DataFrame) -> str:
    """Retrieval as a Markdown table, in per cent of the problems."""
    lines = [cells for group in retrieval_groups(retrieval) for cells in group]
    return markdown_table(RETRIEVAL_HEADINGS, lines)


def stages_table(rows: Sequence[Sequence[str]]) -> Table:
    """Stages of a run for a terminal: rows of ``STAGE_HEADINGS``."""
    return rich_table("Stages", STAGE_HEADINGS, [[list(row)] for row in rows])


def claims_markdown(claims: Sequence[Claim]) -> str:
    """What became of each claim of the paper, as a Markdown list."""
    return "".join(
        f"- **{claim.verdict}**: {claim.text} ({claim.where}) Here: {claim.ours}. *Rule: {claim.rule}*\n"
        for claim in claims
    )


def as_csv(table: pd.DataFrame) -> str:
    """Either summary as comma-separated values, unrounded."""
    return str(table.to_csv(index=False, lineterminator="\n"))


def titled_rows(
    summary: pd.DataFrame, cells: Callable[[pd.Series[Any], int], list[str]]
) -> list[tuple[str, list[Rows]]]:
    """Per panel its title and its rows of cells, grouped by planner; ``cells`` gives those after the names.

    Every planner appears in every panel with every configuration that any panel has for it, so that what was
    not attempted is seen to be missing.
    """
    titled = []
    for panel in summary["panel"].unique():
        rows = summary[summary["panel"] == panel]
        decimals = decimals_of(rows[["mean_ms", "median_ms"]].to_numpy(dtype=float))
        by_key = {(row["planner"], row["configuration"]): row for _, row in rows.iterrows()}
        width = len(cells(rows.iloc[0], decimals))
        groups = []
        for planner in ranked(summary["planner"], PLANNERS):
            wanted = summary.loc[summary["planner"] == planner, list(Configuration._fields)].drop_duplicates()
            asked = [Configuration(*each) for each in wanted.itertuples(index=False, name=None)]
            groups.append(
                [
                    [planner, each.label]
                    + ([NOTHING] * width if (row := by_key.get((planner, each.label))) is None
                       else cells(row, decimals))
                    for each in sorted(asked, key=lambda each: each.rank)
                ]
            )  # fmt: skip
        titled.append((f"{panel}, {int(rows['problems'].max()):,} problems", groups))
    return titled


def full_cells(row: pd.Series[Any], decimals: int) -> list[str]:
    """All figures of one configuration, as ``FULL_HEADINGS`` without the two names."""
    baseline = row["assist"] == "none"

    def with_interval(name: str) -> str:
        value, low, high = (
            f"{row[column]:,.{decimals}f}" for column in (f"{name}_ms", f"{name}_low_ms", f"{name}_high_ms")
        )
        return f"{value} [{low}, {high}]"

    return [
        percent(row["solved"]),
        with_interval("mean"),
        NOTHING if baseline else reduction(row["reduction"], row["reduction_low"], row["reduction_high"]),
        share(row["slower"]),
        NOTHING if math.isnan(row["slowdown"]) else f"{row['slowdown']:.2f} ×",
        p_value(row["p_value"]),
        *[with_interval(name) for name in ("median", "p90", "interquartile_mean")],
        NOTHING if baseline else percent(row["recalled"]),
        count(row["collision_checks"]),
    ]


def _cells(row: pd.Series[Any], decimals: int) -> list[str]:
    """The figures of one configuration that fit a terminal."""
    baseline = row["assist"] == "none"
    return [
        percent(row["solved"]),
        *[f"{row[column]:,.{decimals}f}" for column in ("mean_ms", "median_ms", "p90_ms")],
        NOTHING if baseline else reduction(row["reduction"], row["reduction_low"], row["reduction_high"]),
        share(row["slower"]),
        NOTHING if baseline else percent(row["recalled"]),
        count(row["collision_checks"]),
    ]


def retrieval_groups(retrieval: pd.DataFrame) -> list[Rows]:
    """Lines of a class and memory; under the ways to recall, what plans picked blindly reach."""
    groups = []
    for _, of_memory in retrieval.groupby(["panel", "memory"], sort=False):
        lines = []
        for _, rows in of_memory.groupby("protocol", sort=False):
            blind = rows.iloc[0].copy()
            origin = [math.nan if math.isnan(blind["origin@1"]) else k / blind["plans"] for k in (1, 5)]
            blind[["origin@1", "origin@5"]] = origin
            blind[["hit@1", "hit@5"]] = blind[["random@1", "random@5"]].to_numpy()
            blind[[f"{name}_sd@{k}" for name in ("origin", "hit") for k in (1, 5)]] = math.nan
            blind[["recall", "nothing_recalled"]] = "random", 0.0
            lines += [_retrieval_cells(row) for _, row in rows.iterrows()] + [_retrieval_cells(blind)]
        groups.append(lines)
    return groups


def _retrieval_cells(row: pd.Series[Any]) -> list[str]:
    names = [str(row[column]) for column in ("panel", "memory", "protocol", "recall")]
    names[1] = "own" if names[0] == names[1] else names[1]
    shares = [
        _with_deviation(row[f"{name}@{k}"], row[f"{name}_sd@{k}"])
        for name in ("origin", "hit")
        for k in (1, 5)
    ]
    rest = [percent(row["oracle"]), percent(row["nothing_recalled"]), f"{row['problems']:,}"]
    return [*names, *shares, *rest]


def _with_deviation(share: float, deviation: float) -> str:
    """A share in per cent, and its standard deviation over training seeds where there are several."""
    if math.isnan(share):
        return NOTHING
    digits = 1 if deviation < 0.0995 else 0
    return percent(share) + ("" if math.isnan(deviation) else f"±{100.0 * deviation:.{digits}f}")
