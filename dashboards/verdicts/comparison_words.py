"""Whether a run is better than another, in words that a stranger understands."""

from __future__ import annotations

from collections import Counter
from typing import Final

import pandas as pd

from dashboards.statistics.headline import FEW
from dashboards.statistics.panels import COMBINED
from dashboards.verdicts.comparison import ALARM, BETTER, MACHINE, SAME, WORSE, alarms

IS_BETTER: Final = "better than"
IS_WORSE: Final = "worse than"
IS_BOTH: Final = "in part better, in part worse than"
NOT_SHOWN: Final = "not shown to differ from"


def standing(rows: pd.DataFrame) -> str:
    """How the second run of ``compare_runs`` stands to the first, from its ``rows``: one of the four above.

    The intervals of all rows hold at once, so a single row may decide.
    """
    verdicts = set(rows["verdict"])
    if BETTER in verdicts:
        return IS_BOTH if WORSE in verdicts else IS_BETTER
    return IS_WORSE if WORSE in verdicts else NOT_SHOWN


def grounds(rows: pd.DataFrame) -> str:
    """Why the second run of ``compare_runs`` stands so to the first, in sentences."""
    of_classes = rows[rows["panel"] != COMBINED].groupby("panel", sort=False)["problems"].max()
    asked = ", ".join(f"{count:,} of {panel}" for panel, count in of_classes.items())
    judged = rows[rows["verdict"].isin([BETTER, WORSE, SAME])]
    told = ", ".join(filter(None, (_told(judged, verdict) for verdict in (BETTER, WORSE, SAME))))
    sentences = [
        f"Problems that both attempted: {asked}.",
        f"Of {len(judged)} ways of planning with a memory, {told or 'none can be compared'}.",
    ]
    if (of_classes < FEW).all():
        sentences.append("So few problems say little.")
    controls = rows[(rows["verdict"] == ALARM) & ~rows["why"].str.startswith(MACHINE)]
    if len(controls):
        sentences.append("Planning without a memory differs too, so more than the memory has changed.")
    return " ".join(sentences)


def main_alarms(rows: pd.DataFrame) -> list[str]:
    """The ``alarms`` of ``rows``, with those in which nothing but times differs as one."""
    of_times = rows[(rows["verdict"] == ALARM) & rows["why"].str.startswith(MACHINE)]
    if len(of_times) < 2:
        return alarms(rows)
    least, most = of_times["reduction"].min(), of_times["reduction"].max()
    range_told = f"{-100.0 * most:+.0f} to {-100.0 * least:+.0f} %"
    summed = (
        f"ALARM: {len(of_times)} ways of planning without a memory took {range_told} time: another machine, "
        "or other load."
    )
    return [*alarms(rows.drop(of_times.index)), summed]


def _told(judged: pd.DataFrame, verdict: str) -> str:
    """How many rows got a ``verdict``, and by what; empty if none did."""
    rows = judged[judged["verdict"] == verdict]
    if verdict == SAME:
        return f"{len(rows)} {'shows' if len(rows) == 1 else 'show'} no difference" if len(rows) else ""
    reasons = Counter(reason for why in rows["why"] for reason in why.split(", "))
    why = ", ".join(f"{reason}: {count}" for reason, count in reasons.most_common())
    return f"{len(rows)} {'is' if len(rows) == 1 else 'are'} {verdict} ({why})" if len(rows) else ""
