"""Retrainings, one after another: how challengers were judged, and how useful champions are at work."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
import pandas as pd

from dashboards.cells import NOTHING, PLANNING_TIME, decimal
from dashboards.palette import BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILLION
from dashboards.verdicts.drift import FEWEST
from dashboards.web.charts import Chart, Dot, Drawing, Line, dots, lines
from dashboards.web.memory_versions import MemoryVersion

NEWEST: Final = 20  # rows of the table of what was seen at work
AS_IT_WAS: Final = "as it was"
TOO_FEW: Final = "too few to say"  # problems, whatever their hits
_COLOURS: Final = {
    "promoted": GREEN, "refused": VERMILLION, "awaiting approval": ORANGE, "rolled back": PURPLE,
    "first champion": BLUE,
}  # fmt: skip


def retraining_charts(versions: Sequence[MemoryVersion], runs: set[str]) -> Iterator[Chart]:
    """Every challenger in ``versions`` beside the champion of its time; ``runs``: names of those there."""
    judged = [version for version in versions if np.isfinite(version.sooner_s)]
    if not judged:
        return
    ends = [end for version in judged for end in (version.low_s, version.high_s)]
    room = 0.05 * max(max(0.0, *ends) - min(0.0, *ends), 0.01)
    across = (min(0.0, *ends) - room, max(0.0, *ends) + room)
    of_memories = [
        (memory, [_dot(version, runs) for version in judged if version.memory == memory])
        for memory in dict.fromkeys(version.memory for version in judged)
    ]
    verdicts = dict.fromkeys(version.verdict for version in judged)
    yield Chart(
        "retrainings",
        "Retrainings: each challenger beside the champion of its time",
        "How much sooner the robot is there, planning and driving counted, on held-back problems that both "
        "attempted, averaged over planners and configurations, with the 95 % interval that decided: right of "
        f"the line at 0 is sooner. {PLANNING_TIME}",
        dots(of_memories, "sooner there than the champion, s", across),
        pd.DataFrame(versions),
        [(_colour(verdict), verdict or "not judged yet") for verdict in verdicts],
    )


def retraining_rows(versions: Sequence[MemoryVersion], runs: set[str]) -> list[dict[str, Any]]:
    """The ``versions`` for the page's table, the newest first; ``runs``: names of those that are there."""
    newest_first = sorted(versions, key=lambda each: (-each.retraining, each.memory, -each.number))
    return [
        {
            "memory": version.memory, "number": version.number, "champion": version.is_champion,
            "verdict": version.verdict or "not judged yet", "colour": _colour(version.verdict),
            "against": f"version {version.against}" if version.against else "",
            "why": version.why, "run": version.run, "address": _address(version, runs),
        }
        for version in newest_first
    ]  # fmt: skip


def watched_charts(seen: pd.DataFrame) -> Iterator[Chart]:
    """Hits at work beside the benchmark's, one file of problems after another.

    Args:
        seen: rows of ``storage.tables.watched``.
    """
    if not len(seen):
        return
    drawings = [
        _watched(f"{memory}: {configuration}", of_both)
        for (memory, configuration), of_both in seen.groupby(["memory", "configuration"], sort=False)
    ]
    yield Chart(
        "drift",
        "Drift: do champions answer at work as in their benchmark?",
        "A hit is a problem that a recalled plan answers as it is; of a library, any that is answered from "
        "memory. Each dot is one file of problems that was solved with the memory, vermilion if hits are "
        "significantly fewer than in its benchmark (Fisher's exact test) or planning and driving take "
        f"significantly longer (Welch's test), 0.1 % together. Times are in the table. {PLANNING_TIME}",
        drawings,
        seen,
        [(BLUE, "at work"), (VERMILLION, "drifted"), (GREEN, "in its benchmark")],
    )


def watched_rows(seen: pd.DataFrame) -> list[dict[str, Any]]:
    """The newest of ``seen``, rows of ``storage.tables.watched``, for the page's table."""
    return [
        {
            "when": f"{row['at']:%Y-%m-%d %H:%M} UTC", "memory": row["memory"],
            "configuration": row["configuration"], "problems": f"{row['problems']:,}",
            "hits": _led(_hits_percent(row, "benchmark_"), _hits_percent(row), 1),
            "mean_ms": _led(row["benchmark_mean_ms"], row["mean_ms"], 2),
            "total_s": _led(row["benchmark_total_s"], row["total_s"], 1),
            "verdict": _verdict(row),
        }
        for row in seen[::-1][:NEWEST].to_dict("records")
    ]  # fmt: skip


def _dot(version: MemoryVersion, runs: set[str]) -> Dot:
    words = f"version {version.number} is {version.verdict}, against version {version.against}: {version.why}"
    estimate = version.sooner_s, version.low_s, version.high_s
    label, colour = f"version {version.number}", _colour(version.verdict)
    return Dot(label, estimate, colour, words, _address(version, runs) or None)


def _address(version: MemoryVersion, runs: set[str]) -> str:
    return f"/runs/{version.run}" if version.run in runs else ""


def _hits_percent(row: Mapping[Any, Any], of: str = "") -> float:
    return 100.0 * float(row[f"{of}hits"] / row[f"{of}problems"])


def _led(then: float | None, now: float | None, decimals: int) -> str:
    """What was measured ``then`` and ``now``; without an arrow where one was not, as total times may be."""
    before, after = (decimal(math.nan if each is None else each, decimals) for each in (then, now))
    return after if NOTHING in (before, after) else f"{before}→{after}"


def _verdict(row: Mapping[Any, Any]) -> str:
    """What has become worse in a row of ``storage.tables.watched``; earlier versions looked at hits alone."""
    words = {"has_fallen": "fewer hits", "is_later": "later"}
    worse = [word for column, word in words.items() if row[column] is not None and row[column]]
    return ", ".join(worse) or (TOO_FEW if row["problems"] < FEWEST else AS_IT_WAS)


def _colour(verdict: str) -> str:
    return _COLOURS.get(verdict, GREY)


def _watched(title: str, seen: pd.DataFrame) -> Drawing:
    number = np.arange(1.0, len(seen) + 1.0)
    hits, promised = (
        100.0 * (seen[f"{of}hits"] / seen[f"{of}problems"]).to_numpy(float) for of in ("", "benchmark_")
    )
    ends = 0.8, len(seen) + 0.2  # so that a line is seen of one file, too
    drawn = [
        Line("in its benchmark", np.array([ends[0], *number, ends[1]]), np.pad(promised, 1, "edge"), GREEN),
        Line("at work", number, hits, BLUE, dots=True),
    ]
    drifted = [_verdict(row) not in (AS_IT_WAS, TOO_FEW) for row in seen.to_dict("records")]
    for i in np.flatnonzero(drifted):
        drawn.append(Line("drifted", number[i : i + 1], hits[i : i + 1], VERMILLION, dots=True))
    return lines(
        title, drawn, "file of problems, the oldest first", "hits, %", y_ends=(0.0, 100.0),
        x_ends=ends, x_ticks=number[:: max(1, len(number) // 8)].tolist(),
    )  # fmt: skip
