"""Retrainings, one after another: what became of challengers, and how useful champions are at work."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
import pandas as pd

from dashboards.web.charts import Chart, Interval, Line, Panel, intervals, lines
from dashboards.web.pages.overview_page import PLANNING_TIME
from dashboards.web.retrained import Retrained

NEWEST: Final = 20  # rows of the table of what was seen at work
_COLOURS: Final = {
    "promoted": "2", "refused": "1", "awaiting approval": "3", "rolled back": "5", "first champion": "0",
}  # fmt: skip


def retrained_charts(found: Sequence[Retrained], runs: set[str]) -> Iterator[Chart]:
    """Every challenger beside the champion of its time."""
    judged = [each for each in found if np.isfinite(each.reduction)]
    if not judged:
        return
    ends = [100.0 * end for each in judged for end in (each.low, each.high)]
    across = (max(-100.0, min(0.0, *ends) - 2.0), min(100.0, max(0.0, *ends) + 2.0))
    panels = []
    for memory in dict.fromkeys(each.memory for each in judged):
        rows = [_interval(each, runs) for each in judged if each.memory == memory]
        panels.append(intervals(memory, rows, "less planning time than the champion, %", across))
    verdicts = dict.fromkeys(each.verdict for each in judged)
    yield Chart(
        "retrainings",
        "Retrainings: each challenger beside the champion of its time",
        "Mean over planners and configurations of the reduction of mean planning time on held-back problems, "
        f"which both attempted, with the 95 % interval by which it was decided. {PLANNING_TIME}",
        panels,
        pd.DataFrame(found),
        [(_colour(verdict), verdict or "not judged yet") for verdict in verdicts],
    )


def retrained_rows(found: Sequence[Retrained], runs: set[str]) -> list[dict[str, Any]]:
    """The versions for the page's table, the newest first."""
    return [
        {
            "memory": each.memory, "number": each.number, "champion": each.is_champion,
            "verdict": each.verdict or "not judged yet", "colour": _colour(each.verdict),
            "against": f"version {each.against}" if each.against else "",
            "why": each.why, "run": each.run,
            "address": f"/runs/{each.run}" if each.run in runs else "",
        }
        for each in sorted(found, key=lambda version: (-version.retraining, version.memory, -version.number))
    ]  # fmt: skip


def watched_charts(seen: pd.DataFrame) -> Iterator[Chart]:
    """Hits at work beside the benchmark's, file of problems by file of problems."""
    if not len(seen):
        return
    panels = [
        _watched(f"{memory}: {configuration}", of_both)
        for (memory, configuration), of_both in seen.groupby(["memory", "configuration"], sort=False)
    ]
    yield Chart(
        "drift",
        "Drift: do champions answer at work as in their benchmark?",
        "A hit is a problem answered by a recalled plan as it is. Each dot is one file of problems that was "
        "solved with the memory, vermilion where hits are significantly fewer than in its benchmark "
        f"(Fisher's exact test, 0.1 %). Planning times are in the table. {PLANNING_TIME}",
        panels,
        seen,
        [("0", "at work"), ("1", "fallen"), ("2", "in its benchmark")],
    )  # fmt: skip


def watched_rows(seen: pd.DataFrame) -> list[dict[str, Any]]:
    """What was seen, for the page's table, the newest first."""
    return [
        {
            "when": f"{row['at']:%Y-%m-%d %H:%M} UTC", "memory": row["memory"],
            "configuration": row["configuration"], "problems": f"{row['problems']:,}",
            "hits": f"{100 * row['hits'] / row['problems']:.1f}",
            "promised": f"{100 * row['benchmark_hits'] / row['benchmark_problems']:.1f}",
            "mean_ms": f"{row['mean_ms']:.2f}", "promised_ms": f"{row['benchmark_mean_ms']:.2f}",
            "fallen": row["has_fallen"],
        }
        for row in seen[::-1][:NEWEST].to_dict("records")
    ]  # fmt: skip


def _interval(each: Retrained, runs: set[str]) -> Interval:
    said = f"version {each.number} is {each.verdict}, against version {each.against}: {each.why}"
    address = f"/runs/{each.run}" if each.run in runs else None
    value, low, high = (100.0 * figure for figure in (each.reduction, each.low, each.high))
    return Interval(f"version {each.number}", value, low, high, _colour(each.verdict), said, address)


def _colour(verdict: str) -> str:
    return _COLOURS.get(verdict, "6")


def _watched(title: str, seen: pd.DataFrame) -> Panel:
    number = np.arange(1.0, len(seen) + 1.0)
    hits, promised = (
        100.0 * (seen[name + "hits"] / seen[name + "problems"]).to_numpy(float) for name in ("", "benchmark_")
    )
    fallen = seen["has_fallen"].to_numpy(bool)
    drawn = [Line("in its benchmark", number, promised, "2"), Line("at work", number, hits, "0", dots=True)]
    drawn += [
        Line("fallen", number[i : i + 1], hits[i : i + 1], "1", dots=True) for i in np.flatnonzero(fallen)
    ]
    ticks = number[:: max(1, len(number) // 8)].tolist()
    return lines(
        title, drawn, "file of problems, the oldest first", "hits, %", y_ends=(0.0, 100.0),
        x_ends=(0.8, len(seen) + 0.2), x_ticks=ticks,
    )  # fmt: skip
