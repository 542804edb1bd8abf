"""What a run found, in words that a stranger understands: how soon a robot plans and arrives."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import pandas as pd

from dashboards.cells import planner_title
from dashboards.statistics.panels import COMBINED

_PREFERRED: Final = ("repair", "open", "closed", "published-open")  # the first that was measured counts
Row = Mapping[Any, Any]  # of a summary
_EQUAL: Final = 1.05  # times faster or slower: less is called the same


class Finding(NamedTuple):
    """What was found in one panel."""

    panel: str
    text: str


def findings(summary: pd.DataFrame) -> list[Finding]:
    """Say for each panel what a memory is worth beside the strongest planner alone, then beside the others.

    The strongest planner is the one whose robot arrives first without a memory, planning and driving taken
    together. The memory is used as by default: recalled plans are repaired, if the run measured that.

    Args:
        summary: of ``panels.summarise``.
    """
    found = []
    for panel, rows in summary.groupby("panel", sort=False):
        alone = _by_planner(rows[rows["assist"] == "none"])
        helped = _by_planner(_used_by_default(rows))
        compared = sorted(alone.keys() & helped.keys(), key=lambda each: (_arrives_s(alone[each]), each))
        if not compared:
            continue
        first, *others = compared
        memory = "the memory of all classes" if panel == COMBINED else "this memory"
        before, now = alone[first], helped[first]
        sentences = [
            f"With {memory}, {planner_title(first)}, the strongest planner here, has its plan in "
            f"{duration(now['mean_ms'])} instead of {duration(before['mean_ms'])} ({_times(before, now)}), "
            f"and its robot {_arrival(now)}."
        ]
        sentences += [
            f"{planner_title(planner)}: {_times(alone[planner], helped[planner])}, its robot "
            f"{_arrival(helped[planner])}."
            for planner in others
        ]
        if now["solved"] != before["solved"]:
            sentences.append(f"Solved are {now['solved']:.1%} instead of {before['solved']:.1%}.")
        answered = now["recalled"] + now["repaired"]
        sentences.append(f"{100.0 * answered:.0f} % of the plans come from the memory.")
        found.append(Finding(f"{panel}, {int(rows['problems'].max()):,} new problems", " ".join(sentences)))
    return found


def findings_markdown(summary: pd.DataFrame) -> str:
    """The findings of a ``summary`` as Markdown, a heading and a paragraph for each panel."""
    return "\n\n".join(f"## {each.panel}\n\n{each.text}" for each in findings(summary))


def duration(milliseconds: float) -> str:
    """A duration with two digits that count and a unit that suits it: 43 µs, 0.54 ms, 1.2 s."""
    if math.isnan(milliseconds):
        return "–"
    for unit, size in (("s", 1e3), ("ms", 0.1)):
        if milliseconds >= size:
            value = milliseconds / (1e3 if unit == "s" else 1.0)
            return f"{value:.{max(0, 1 - math.floor(math.log10(value)))}f} {unit}"
    return f"{1e3 * milliseconds:.0f} µs"


def _by_planner(rows: pd.DataFrame) -> dict[str, Row]:
    return {row["planner"]: row for row in rows.to_dict("records")}


def _used_by_default(rows: pd.DataFrame) -> pd.DataFrame:
    """Of each planner the row of a memory used as by default."""
    used = rows[rows["assist"].isin(_PREFERRED) & (rows["recall"] != "random")]
    order = used["assist"].map(_PREFERRED.index)
    ordered = used.assign(order=order).sort_values(["order", "top_k"], ascending=[True, False])
    return ordered.drop_duplicates("planner")


def _arrives_s(row: Row) -> float:
    """Seconds until the robot is there; a planner that solves nothing comes last."""
    total = row["mean_ms"] / 1e3 + row["driving_s"]
    return math.inf if math.isnan(total) else float(total)


def _times(alone: Row, helped: Row) -> str:
    ratio = alone["mean_ms"] / helped["mean_ms"]
    if 1.0 / _EQUAL < ratio < _EQUAL:
        return "as fast"
    return f"{ratio:.1f} times faster" if ratio > 1.0 else f"{1.0 / ratio:.1f} times slower"


def _arrival(row: Row) -> str:
    """When the robot arrives, against the same planner alone on the same problems."""
    low, high = row["sooner_low_s"], row["sooner_high_s"]
    if math.isnan(row["sooner_s"]):
        return "was not compared on the road"
    if low > 0.0:
        return f"arrives {row['sooner_s']:.1f} s sooner (95 %: {low:.2f} to {high:.2f} s)"
    if high < 0.0:
        return f"arrives {-row['sooner_s']:.1f} s later (95 %: {-high:.2f} to {-low:.2f} s)"
    return f"arrives at the same time, as far as this shows (95 %: {low:+.2f} to {high:+.2f} s sooner)"
