"""The comparison of two runs as tables."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import pandas as pd

from dashboards.cells import (
    NOTHING,
    Cell,
    CellTable,
    Rows,
    decimals_of,
    percent,
    titled_tables,
    with_interval,
)
from dashboards.verdicts.comparison import ALARM, CONTROL

_SHARED: Final = ("planner", "configuration", "ms", "sooner s", "solved %")
HEADINGS: Final = (*_SHARED, "fewer checks %", "hits %", "verdict")
HEADINGS_IN_TURN: Final = (*_SHARED, "less time %", "mostly %", "verdict")
_SHARED_FIELDS: Final = ("planner", "configuration", "planning_ms", "sooner_s", "solved_percent")
FIELDS: Final = (*_SHARED_FIELDS, "fewer_checks_percent", "hits_percent", "verdict")
FIELDS_IN_TURN: Final = (*_SHARED_FIELDS, "less_time_percent", "mostly_percent", "verdict")
BY_COUNTS: Final = (
    "These runs were measured one after the other, so a difference in their times may come from how busy "
    "the machine was: times are shown, but not judged. What is judged is problems solved, then seconds of "
    "driving, then checks, expansions and hits. `compare --measure` measures the memories of both "
    "in turn."
)
IN_TURN: Final = (
    "The memories of both were measured in turn, in an order that was drawn. What is judged is problems "
    "solved, then the time until the robot is there, then planning."
)


def headings_of(rows: pd.DataFrame) -> tuple[str, ...]:
    """The headings over the ``rows`` of ``compare_runs``."""
    return HEADINGS_IN_TURN if rows["reduction_low"].notna().any() else HEADINGS


def comparison_tables(rows: pd.DataFrame) -> list[CellTable]:
    """The ``rows`` of ``compare_runs``: a table for each panel."""
    headings = headings_of(rows)
    fields = FIELDS_IN_TURN if headings == HEADINGS_IN_TURN else FIELDS
    return titled_tables(headings, comparison_cells(rows), "comparison", fields, rows["panel"].unique())


def comparison_cells(rows: pd.DataFrame) -> Iterator[tuple[str, list[Rows]]]:
    """Of each panel in the ``rows`` of ``compare_runs`` a title, and a group of cells for each planner."""
    in_turn = headings_of(rows) == HEADINGS_IN_TURN
    for panel, of_panel in rows.groupby("panel", sort=False):
        decimals = decimals_of(of_panel[["first_ms", "ms"]].to_numpy(dtype=float))
        groups = [
            [_cells(row, decimals, in_turn) for row in of_planner.to_dict("records")]
            for _, of_planner in of_panel.groupby("planner", sort=False)
        ]
        yield (
            f"{panel}, {int(of_panel['problems'].max()):,} problems in both; [95 %, all rows at once]",
            groups,
        )


def _cells(row: dict[Any, Any], decimals: int, in_turn: bool) -> list[str]:
    sooner, low, high = row["sooner_s"], row["sooner_low_s"], row["sooner_high_s"]
    first_ms, other_ms = row["first_ms"], row["ms"]
    uses_memory = row["verdict"] not in (CONTROL, ALARM)
    hits = _both(row["first_hit"], row["hit"]) if uses_memory else NOTHING
    counted = [_interval(row, "checks_reduction"), hits]
    return [
        row["planner"],
        row["configuration"],
        Cell(f"{first_ms:,.{decimals}f}→{other_ms:,.{decimals}f}", first=first_ms, other=other_ms),
        NOTHING
        if low != low
        else Cell(f"{sooner:+z.1f} [{low:+z.1f}, {high:+z.1f}]", value=sooner, low=low, high=high),
        _both(row["first_solved"], row["solved"]),
        *([_interval(row, "reduction"), _interval(row, "mostly")] if in_turn else counted),
        f"{row['verdict']}: {row['why']}" if row["why"] else row["verdict"],
    ]


def _interval(row: dict[Any, Any], name: str) -> str:
    return with_interval(*(row[f"{name}{end}"] for end in ("", "_low", "_high")))


def _both(first: float, other: float) -> str:
    if first == other:
        return percent(other)
    return Cell(f"{percent(first)}→{percent(other)}", first=100.0 * first, other=100.0 * other)
