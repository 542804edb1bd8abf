"""The rule by which a challenger takes a champion's place, and how the judgement is written.

Both attempt the same held-back problems, next to each other, with every planner and every configuration that
uses a memory. A column is a planner and configuration on a class. What counts is when the robot is there:
planning and driving. The challenger is promoted if

1. it is sooner: the mean over all columns of the mean time that it saves has a 95 % interval (paired
   bootstrap over problems) above 0;
2. it is later nowhere: no column has an interval, widened for their number (Bonferroni), that lies beyond
   what is noticed (``NOTICED_S``, or what the caller says) on the wrong side;
3. it solves no fewer problems: not in all columns together, and in no column significantly fewer (exact sign
   test, corrected by Holm, 5 %).

An attempt without a plan counts with the planning time it took and the longest drive of its class, that of
either side. The challenger has to show that it is better: if an interval reaches 0, the champion stays.
Planning faster is shown, but decides nothing by itself.
"""

from __future__ import annotations

from collections import Counter
from typing import Any, Final, NamedTuple

import numpy as np
import pandas as pd

from dashboards.cells import Cell, CellTable, Rows, as_markdown, decimal, decimals_of, percent, titled_tables
from dashboards.statistics.intervals import CONFIDENCE, bootstrap
from dashboards.statistics.panels import Panel, panels
from dashboards.statistics.sign_tests import holm, signs
from planners.world.arrays import Floats

RESAMPLES: Final = 10_000  # the end of an interval widened for 20 columns stands on 12 of them
NOTICED_S: Final = 1e-3  # being later by less is no harm, however certain it is
FEWEST_SHOWN: Final = 6  # problems: the range of fewer holds even their median with less than 95 %
HEADINGS: Final = (
    "planner", "configuration", "champion ms", "challenger ms", "champion drives s", "drives s",
    "sooner s [95 %]", "champion solved %", "solved %", "champion hits %", "hits %", "verdict",
)  # fmt: skip
FIELDS: Final = (
    "planner", "configuration", "champion_planning_ms", "planning_ms", "champion_driving_s", "driving_s",
    "sooner_s", "champion_solved_percent", "solved_percent", "champion_hits_percent", "hits_percent",
    "verdict",
)  # fmt: skip
SOONER: Final = "sooner"
LATER: Final = "later"
FEWER: Final = "fewer solved"
OPEN: Final = "open"  # the interval reaches over 0


class Judgement(NamedTuple):
    """What became of a challenger, and by what figures."""

    passes: bool  # whether the rule lets it take the champion's place
    why: str  # in one line
    problems: int
    sooner_s: float  # planning and driving time that it saves, mean over columns, seconds
    low_s: float  # ends of its 95 % interval
    high_s: float
    columns: pd.DataFrame  # a row a class, planner and configuration: the verdict and its figures


def judge(
    champion: pd.DataFrame, challenger: pd.DataFrame, seed: int = 0, noticed_s: float = NOTICED_S
) -> Judgement:
    """Apply the rule to attempt rows of ``champion`` and ``challenger``, each with one memory.

    Args:
        champion: attempt rows of the champion.
        challenger: attempt rows of the challenger.
        seed: seed of the bootstrap.
        noticed_s: seconds; being later by less in a column is no harm.

    Raises:
        ValueError: the rows are not of the same problems in the same configurations, or there are none.
    """
    sides = [list(panels(rows.assign(memory="own"))) for rows in (champion, challenger)]
    if not sides[0] or _attempted(champion) != _attempted(challenger):
        raise ValueError("champion and challenger have not attempted the same problems in the same ways")
    savings, tables = [], []
    for number, (before, after) in enumerate(zip(*sides, strict=True)):
        driven = np.concatenate([each.matrix("duration_s").ravel() for each in (before, after)])
        longest = float(np.nanmax(driven, initial=0.0))
        saved = before.total_seconds(longest) - after.total_seconds(longest)
        savings.append(bootstrap(saved, saved, seed + number, RESAMPLES).means)
        tables.append(_compared(before, after).assign(sooner_s=saved.mean(0)))
    columns = pd.concat(tables, ignore_index=True)
    drawn = np.concatenate(savings, axis=1)
    low, high = _ends(drawn, CONFIDENCE)
    _, widened = _ends(drawn, 1.0 - (1.0 - CONFIDENCE) / drawn.shape[1])
    columns = columns.assign(low_s=low, high_s=high, p_value=holm(columns["p_value"].to_numpy(float)))
    fewer = (columns["p_value"] < 1.0 - CONFIDENCE) & (columns["solved"] < columns["champion_solved"])
    verdicts = np.select([fewer, widened < -noticed_s, low > 0.0], [FEWER, LATER, SOONER], OPEN)
    columns = columns.assign(verdict=verdicts)
    whole = _ends(drawn.mean(1, keepdims=True), CONFIDENCE)
    ends = float(whole[0][0]), float(whole[1][0])
    against = _against(columns, ends)
    return Judgement(
        passes=not against,
        why="; ".join(against) or _interval_line("sooner there", columns, ends),
        problems=int(challenger["problem_id"].nunique()),
        sooner_s=float(columns["sooner_s"].mean()),
        low_s=ends[0],
        high_s=ends[1],
        columns=columns,
    )


def judgement_line(judged: Judgement, who: str = "the challenger") -> str:
    """The figures by which it was ``judged``, in one line about ``who``; of a few problems, that they are."""
    problems = f"{judged.problems:,} problem{'' if judged.problems == 1 else 's'}"
    if judged.problems < FEWEST_SHOWN:
        return f"{who} attempted {problems}: too few to say whether it is there sooner"
    less = 100 * _less_planning(judged.columns)
    time = f"{abs(less):.1f} % {'more' if less < 0.0 else 'less'} time"
    line = (
        f"{who} is there {_sooner(judged.sooner_s)} ({_interval(judged.low_s, judged.high_s)}) on "
        f"{problems}, and plans in {time} over all attempts"
    )
    if len(judged.columns) == 1:
        return line
    counts = Counter(judged.columns["verdict"])
    named = ", ".join(f"{counts[each]} {each}" for each in (SOONER, LATER, FEWER, OPEN) if counts[each])
    return f"{line}; of {len(judged.columns)} comparisons: {named}"


def _less_planning(columns: pd.DataFrame) -> float:
    """The share by which the mean planning time of all attempts is less; each attempt counts alike."""
    mine, theirs = ((columns[name] * columns["problems"]).sum() for name in ("ms", "champion_ms"))
    return float(1.0 - mine / theirs)


def judgement_tables(judged: Judgement) -> list[CellTable]:
    """The columns by which it was ``judged``: a table for each class."""
    panels = judged.columns["panel"].unique()
    return titled_tables(HEADINGS, _titled(judged), "judgement", FIELDS, panels)


def judgement_markdown(judged: Judgement, verdict: str) -> str:
    """What was ``judged`` as Markdown: what became of the challenger (``verdict``), figures and columns."""
    line = judgement_line(judged)
    head = f"**{verdict}**: {judged.why}.\n\n{line[0].upper()}{line[1:]}.\n\n"
    return head + as_markdown(judgement_tables(judged))


def _attempted(rows: pd.DataFrame) -> set[tuple[Any, ...]]:
    names = ["problem_id", "planner", "assist", "top_k", "recall", "polished"]
    keys = rows.reindex(columns=names).astype(object)  # rows of earlier versions lack the last
    return set(keys.where(keys.notna(), None).itertuples(index=False, name=None))


def _compared(before: Panel, after: Panel) -> pd.DataFrame:
    """The figures of a class without intervals; p-values are of the problems solved, not corrected yet."""
    times = [panel.milliseconds().mean(0) for panel in (before, after)]
    driving = [panel.driving_seconds() for panel in (before, after)]
    solved = [panel.matrix("solved") for panel in (before, after)]
    hits = [panel.hits().mean(0) for panel in (before, after)]
    tests = [signs(2.0 - mine, 2.0 - other) for mine, other in zip(solved[1].T, solved[0].T, strict=True)]
    return after.labels().assign(
        problems=after.problems,
        champion_ms=times[0],
        ms=times[1],
        reduction=1.0 - times[1] / times[0],
        champion_driving_s=driving[0],
        driving_s=driving[1],
        champion_solved=solved[0].mean(0),
        solved=solved[1].mean(0),
        champion_hits=hits[0],
        hits=hits[1],
        p_value=[test.p_value for test in tests],
    )


def _ends(resampled: Floats, confidence: float) -> tuple[Floats, Floats]:
    tail = 0.5 * (1.0 - confidence)
    low, high = np.quantile(resampled, [tail, 1.0 - tail], axis=0)
    return low, high


def _against(columns: pd.DataFrame, ends: tuple[float, float]) -> list[str]:
    """What speaks against a promotion, by the rule."""
    reasons = []
    if ends[0] <= 0.0:
        reasons.append(_interval_line("not shown to be sooner there", columns, ends))
    for verdict, words in ((LATER, "later there"), (FEWER, "solves fewer")):
        worse = columns[columns["verdict"] == verdict]
        if len(worse):
            worst = worse.iloc[int(worse["sooner_s"].argmin())]
            more = f" and {len(worse) - 1} more" if len(worse) > 1 else ""
            reasons.append(
                f"{words} with {worst['planner']} {worst['configuration']} on {worst['panel']}{more}"
            )
    mine, theirs = (
        round((columns[name] * columns["problems"]).sum()) for name in ("solved", "champion_solved")
    )
    if mine < theirs:
        reasons.append(f"solves fewer in all: {mine:,} attempts against {theirs:,}")
    return reasons


def _interval_line(what: str, columns: pd.DataFrame, ends: tuple[float, float]) -> str:
    return f"{what}: {_sooner(columns['sooner_s'].mean())}, {_interval(*ends)}"


def _interval(low_s: float, high_s: float) -> str:
    return f"95 %: {_sooner(low_s)} to {_sooner(high_s)}"


def _sooner(seconds: float) -> str:
    return f"{_seconds(abs(seconds))} s {'later' if seconds < 0.0 else 'sooner'}"


def _seconds(value: float) -> str:
    """Two decimals, or more if that would be nothing."""
    return f"{value:.2f}" if abs(value) >= 0.01 else f"{value:.2g}"


def _titled(judged: Judgement) -> list[tuple[str, list[Rows]]]:
    titled = []
    for panel, of_panel in judged.columns.groupby("panel", sort=False):
        decimals = decimals_of(of_panel[["champion_ms", "ms"]].to_numpy(dtype=float))
        groups = [
            [_cells(row, decimals) for row in of_planner.to_dict("records")]
            for _, of_planner in of_panel.groupby("planner", sort=False)
        ]
        titled.append((f"{panel}, {int(of_panel['problems'].max()):,} held-back problems", groups))
    return titled


def _cells(row: dict[Any, Any], decimals: int) -> list[str]:
    return [
        row["planner"],
        row["configuration"],
        *[decimal(row[name], decimals) for name in ("champion_ms", "ms")],
        *[decimal(row[name], 1) for name in ("champion_driving_s", "driving_s")],
        Cell(
            f"{_seconds(row['sooner_s'])} [{_seconds(row['low_s'])}, {_seconds(row['high_s'])}]",
            value=row["sooner_s"],
            low=row["low_s"],
            high=row["high_s"],
        ),
        *[percent(row[name]) for name in ("champion_solved", "solved", "champion_hits", "hits")],
        row["verdict"],
    ]
