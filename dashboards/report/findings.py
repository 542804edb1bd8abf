"""What a run found, in words that a stranger understands: how soon a robot plans and arrives."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import pandas as pd

from dashboards.cells import duration, planner_title
from dashboards.statistics.headline import FEW, used_by_default
from dashboards.statistics.panels import COMBINED
from storage.tables.configurations import as_found, as_returned

Row = Mapping[Any, Any]  # of a summary


class Finding(NamedTuple):
    """What was found in one panel."""

    panel: str
    text: str  # of the strongest planner
    others: str  # of the other planners


def findings(summary: pd.DataFrame) -> list[Finding]:
    """Say for each panel what a memory is worth beside the strongest planner alone, then beside the others.

    The strongest planner is the one whose robot arrives first without a memory, planning and driving taken
    together. The memory is used as by default: recalled plans are repaired, if the run measured that. Plans
    are as they were found, but where the text says that they are polished.

    Args:
        summary: of ``panels.summarise``.
    """
    found = []
    for panel, every in summary.groupby("panel", sort=False):
        rows = as_found(every)
        alone = _by_planner(rows[rows["assist"] == "none"])
        helped = _by_planner(used_by_default(rows))
        compared = sorted(alone.keys() & helped.keys(), key=lambda each: (_arrives_s(alone[each]), each))
        if not compared:
            continue
        first, *others = compared
        memory = "the memory of all classes" if panel == COMBINED else "this memory"
        before, now = alone[first], helped[first]
        sentences = [
            f"With {memory}, {planner_title(first)}, the strongest planner here, has its plan in "
            f"{duration(now['mean_ms'])}, alone in {duration(before['mean_ms'])} ({_planning(now)}), "
            f"and its robot {_arrival(now)}."
        ]
        of_others = [
            f"{planner_title(planner)}: {_planning(helped[planner])}, and its robot "
            f"{_arrival(helped[planner])}."
            for planner in others
        ]
        if now["solved"] != before["solved"]:
            sentences.append(
                f"{100.0 * now['solved']:.1f} % are solved instead of {100.0 * before['solved']:.1f} %."
            )
        answered = now["recalled"] + now["repaired"]
        sentences.append(f"{100.0 * answered:.0f} % of the problems are answered from the memory.")
        returned = _by_planner(used_by_default(as_returned(every))).get(first)
        if returned is not None:
            on = "" if returned["problems"] == now["problems"] else f" (on {returned['problems']:,} of them)"
            sentences.append(
                f"Answers are polished before they are returned: then the robot {_arrival(returned)}{on}."
            )
        if rows["problems"].max() < FEW:
            sentences.append("So few problems say little.")
        title = f"{panel}, {int(rows['problems'].max()):,} new problems"
        found.append(Finding(title, " ".join(sentences), " ".join(of_others)))
    return found


def findings_markdown(summary: pd.DataFrame) -> str:
    """The findings of a ``summary`` as Markdown, a heading for each panel."""
    return "\n\n".join(f"## {each.panel}\n\n{each.text}\n\n{each.others}" for each in findings(summary))


def for_pages(found: Sequence[Finding]) -> list[Finding]:
    """What was ``found``, with no line that ends between a number and its unit."""
    unit = re.compile(r"(?<=\d) (?=(?:s|ms|µs|%)(?![a-z]))")
    return [Finding(*(unit.sub("\N{NO-BREAK SPACE}", words) for words in each)) for each in found]


def _by_planner(rows: pd.DataFrame) -> dict[str, Row]:
    return {row["planner"]: row for row in rows.to_dict("records")}


def _arrives_s(row: Row) -> float:
    """Seconds until the robot is there; a planner that solves nothing comes last."""
    total = row["mean_ms"] / 1e3 + row["driving_s"]
    return math.inf if math.isnan(total) else float(total)


def _planning(row: Row) -> str:
    """What planning takes, against the same planner alone on the same problems: the figures of the tables."""
    less, low, high = (100.0 * row[name] for name in ("reduction", "reduction_low", "reduction_high"))
    if math.isnan(less):
        return "planning times were not compared"
    if low > 0.0:
        return f"{less:.0f} % less planning time, 95 %: {low:.0f} to {high:.0f} %"
    if high < 0.0:
        return f"{-less:.0f} % more planning time, 95 %: {-high:.0f} to {-low:.0f} %"
    return f"no difference in planning time is shown, 95 %: {-low:.0f} % more to {high:.0f} % less"


def _arrival(row: Row) -> str:
    """When the robot arrives, against the same planner alone on the same problems."""
    low, high = row["sooner_low_s"], row["sooner_high_s"]
    if math.isnan(row["sooner_s"]):
        return "has no drive to compare"
    if low <= 0.0 <= high:
        ends = f"{_sooner(low)} to {_sooner(high)}"
        return f"arrives at the same time, as far as this shows (95 %: {ends})"
    least, most = sorted((abs(low), abs(high)))
    return f"arrives {_sooner(row['sooner_s'])} (95 %: {_amount(least)} to {_amount(most)})"


def _sooner(seconds: float) -> str:
    return f"{_amount(abs(seconds))} {'sooner' if seconds >= 0.0 else 'later'}"


def _amount(seconds: float) -> str:
    return f"{seconds:.2f} s" if seconds >= 0.01 else f"{1e3 * seconds:.1f} ms"
