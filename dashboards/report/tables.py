"""The tables of a run and of its stages, and rows as comma-separated values."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import pandas as pd

from dashboards.cells import (
    NOTHING,
    Cell,
    CellTable,
    Rows,
    as_markdown,
    count,
    decimal,
    decimals_of,
    p_value,
    percent,
    titled_tables,
    value_of,
    with_interval,
)
from dashboards.statistics.panels import PLANNERS, ranked
from dashboards.verdicts.claim_rules import Claim
from planners.attempt import SOURCES, WITHOUT_MEMORY
from storage.tables.configurations import configurations_in

Row = Mapping[Any, Any]  # of a summary

_HEADINGS: Final = (
    "planner", "configuration", "solved", "mean", "reduction % [95 %]", "slower", "hits", "drives",
    "sooner [95 %]",
)  # fmt: skip
_FIELDS: Final = (
    "planner", "configuration", "solved_percent", "planning_mean_ms", "reduction_percent", "slower_percent",
    "hits_percent", "driving_s", "sooner_s",
)  # fmt: skip
_UNITS: Final = (
    "plans as found, or polished as answers are; planning in ms, drives and sooner in s, the rest in %"
)
FULL_HEADINGS: Final = (  # what readers look for first comes first, since pages may be narrow
    "planner", "configuration", "solved %", "mean ms [95 %]", "reduction of the mean % [95 %]", "driving s",
    "sooner s [95 %]", "hits %", "slower %", "median slowdown", "p (sign test, Holm)", "median ms [95 %]",
    "90 % ms [95 %]", "interquartile mean ms [95 %]", "recalled %", "repaired %", "searched %",
    "collision checks",
)  # fmt: skip
_SWEEP_HEADINGS: Final = (
    "class", "rate", "channels", "hidden", "parameters", "hit@1", "hit@5", "seconds"
)  # fmt: skip
_SWEEP_FIELDS: Final = (
    "class", "learning_rate", "channels", "hidden", "parameters", "hit_1_percent", "hit_5_percent", "seconds"
)  # fmt: skip
STAGE_HEADINGS: Final = (
    "stage", "seconds", "chunks", "workers", "between chunks %", "worker's MB at first", "at last",
)  # fmt: skip
_STAGE_FIELDS: Final = (
    "stage",
    "seconds",
    "chunks",
    "workers",
    "between_chunks_percent",
    "worker_first_mb",
    "worker_last_mb",
)


def summary_tables(summary: pd.DataFrame) -> list[CellTable]:
    """What fits 110 columns of the ``summary`` of ``panels.summarise``: a table for each panel."""
    titled = titled_rows(summary, _cells)
    told = [(f"{title}; {_UNITS}", groups) for title, groups in titled]
    return titled_tables(_HEADINGS, told, "summary", _FIELDS, summary["panel"].unique())


def summary_markdown(summary: pd.DataFrame) -> str:
    """The whole ``summary`` of ``panels.summarise`` as Markdown: a heading and a table a panel."""
    return as_markdown(titled_tables(FULL_HEADINGS, titled_rows(summary, full_cells)))


def stages_table(rows: Sequence[Sequence[str]]) -> CellTable:
    """The stages of a run; ``rows`` of cells under ``STAGE_HEADINGS``."""
    return CellTable("Stages", STAGE_HEADINGS, [[list(row)] for row in rows], "stages", _STAGE_FIELDS)


def sweep_table(rows: pd.DataFrame) -> CellTable:
    """The variants of a sweep, ``rows`` of ``stages.sweep.sweep_rows``: the best first."""
    groups = [
        [
            [
                str(name), Cell(f"{row['learning_rate']:g}", row["learning_rate"]),
                row["channels"], row["hidden"] or "none",
                f"{row['parameters']:,}", percent(row["hit@1"]), percent(row["hit@5"]),
                decimal(row["seconds"], 0),
            ]
            for row in of_class.sort_values("hit@1", ascending=False, kind="stable").to_dict("records")
        ]
        for name, of_class in rows.groupby("class", sort=False)
    ]  # fmt: skip
    title = "Validation problems, % of what the stored plans solve"
    return CellTable(title, _SWEEP_HEADINGS, groups, "sweep", _SWEEP_FIELDS)


def experience_table(rows: pd.DataFrame) -> CellTable:
    """The ``rows`` of ``experience_rows``, with ``experiences``, the number asked for: a line for each."""
    panels = list(rows["panel"].unique())
    lines = []
    for experiences, of_count in rows.groupby("experiences"):
        cells = dict.fromkeys(panels, NOTHING)  # a class that was left out has none
        for row in of_count.to_dict("records"):
            hits = with_interval(row["hit"], row["low"], row["high"], 1)
            cells[row["panel"]] = _of_oracle(hits, percent(row["oracle"]))
        lines.append([str(experiences), *cells.values()])
    title = "Fresh hit@5 [95 %] and oracle, % of problems"
    return CellTable(title, ["experiences", *panels], [[line] for line in lines], "experience-curve")


def _of_oracle(hits: str, oracle: str) -> str:
    """The cell of a share with its interval, and of what the best recall would reach."""
    return Cell(f"{hits} of {oracle}", **{**(value_of(hits) or {"value": math.nan}), "of": value_of(oracle)})


def claims_markdown(claims: Sequence[Claim], others: Sequence[Claim] = ()) -> str:
    """The ``claims`` of the paper and their verdicts, as a Markdown list.

    Args:
        claims: claims, judged by the method of the run.
        others: the same claims, judged by the other method, if that was measured too.
    """
    lines = []
    for claim, *other in zip(claims, *([others] if others else []), strict=True):
        judged = "; ".join(f"by {each.method}: {each.ours}" for each in (claim, *other))
        verdicts = " / ".join(each.verdict for each in (claim, *other))
        lines.append(f"- **{verdicts}**: {claim.text} ({claim.where}) {judged}. *Rule: {claim.rule}*\n")
    return "".join(lines)


def as_csv(table: pd.DataFrame) -> str:
    """A ``table`` as comma-separated values, unrounded."""
    return str(table.to_csv(index=False, lineterminator="\n"))


def titled_rows(
    summary: pd.DataFrame, cells: Callable[[Row, int], list[str]]
) -> list[tuple[str, list[Rows]]]:
    """Of each panel in ``summary`` a title, and a group of rows of cells for each planner.

    Every planner appears in every panel with every configuration that any panel has for it, so that one sees
    what was not attempted.

    Args:
        summary: a table of ``panels.summarise``.
        cells: gives the cells after the names, from a row of ``summary`` and the number of decimals of times.
    """
    titled = []
    for panel in summary["panel"].unique():
        rows = summary[summary["panel"] == panel]
        decimals = decimals_of(rows[["mean_ms", "median_ms"]].to_numpy(dtype=float))
        by_key = {(row["planner"], row["configuration"]): row for row in rows.to_dict("records")}
        width = len(cells(rows.iloc[0].to_dict(), decimals))
        groups = []
        for planner in ranked(summary["planner"], PLANNERS):
            group = []
            for configuration in configurations_in(summary[summary["planner"] == planner]):
                row = by_key.get((planner, configuration.label))
                numbers = [NOTHING] * width if row is None else cells(row, decimals)
                group.append([planner, configuration.label, *numbers])
            groups.append(group)
        titled.append((f"{panel}, {int(rows['problems'].max()):,} problems", groups))
    return titled


def full_cells(row: Row, decimals: int) -> list[str]:
    """All figures of a ``row`` of a summary, as in ``FULL_HEADINGS`` after the two names.

    Args:
        row: a row of a summary.
        decimals: how many decimals times have.
    """

    def time(name: str) -> str:
        ends = {"value": row[f"{name}_ms"], "low": row[f"{name}_low_ms"], "high": row[f"{name}_high_ms"]}
        value, low, high = (f"{each:,.{decimals}f}" for each in ends.values())
        return Cell(f"{value} [{low}, {high}]", **ends)

    return [
        percent(row["solved"]),
        time("mean"),
        reduction_cell(row),
        *driving_cells(row, 2),
        _of_memory(row, "hit"),
        percent(row["slower"]),
        NOTHING if math.isnan(row["slowdown"]) else Cell(f"{row['slowdown']:.2f} ×", row["slowdown"]),
        p_value(row["p_value"]),
        *[time(name) for name in ("median", "p90", "interquartile_mean")],
        *[_of_memory(row, name) for name in SOURCES],
        count(row["collision_checks"]),
    ]


def _of_memory(row: Row, name: str) -> str:
    """A share in a ``row`` of a summary that only a memory can have; a dash without one."""
    return NOTHING if row["assist"] in WITHOUT_MEMORY else percent(row[name])


def reduction_cell(row: Row, decimals: int = 1) -> str:
    """The reduction in a ``row`` of a summary with its interval; a dash for the planner alone."""
    if row["assist"] == "none":
        return NOTHING
    return with_interval(row["reduction"], row["reduction_low"], row["reduction_high"], decimals)


def driving_cells(row: Row, decimals: int = 1) -> list[str]:
    """Mean driving time in a ``row`` of a summary, and how much sooner the robot is there with its interval.

    Args:
        row: a row of a summary.
        decimals: how many decimals the gain in seconds has.
    """
    if math.isnan(row["driving_s"]):
        return [NOTHING, NOTHING]
    driving = decimal(row["driving_s"], 1)
    if row["assist"] == "none" or math.isnan(row["sooner_s"]):
        return [driving, NOTHING]
    ends = {"value": row["sooner_s"], "low": row["sooner_low_s"], "high": row["sooner_high_s"]}
    sooner, low, high = (f"{each:+z.{decimals}f}" for each in ends.values())
    return [driving, Cell(f"{sooner} [{low}, {high}]", **ends)]


def _cells(row: Row, decimals: int) -> list[str]:
    """The figures of one configuration that fit a terminal."""
    return [
        percent(row["solved"]),
        decimal(row["mean_ms"], decimals),
        reduction_cell(row, 0),
        percent(row["slower"]),
        NOTHING if row["assist"] in WITHOUT_MEMORY else _hits(row),
        *driving_cells(row),
    ]


def _hits(row: Row) -> str:
    """The share of problems that a recalled plan answers, and after a plus those whose plan was repaired."""
    repairs = str(row["assist"]).endswith("repair")
    hit, repaired = 100.0 * row["hit"], 100.0 * row["repaired"]
    if not repairs:
        return percent(row["hit"])
    return Cell(f"{hit:.0f}+{repaired:.0f}", recalled=hit, repaired=repaired)
