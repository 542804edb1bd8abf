"""Two runs side by side, paired by problem: what the second does better or worse than the first.

A time says something of a run only if both were measured in turn on one machine; else the machine differs
too. So rows of two runs are judged by what no machine changes: problems solved, seconds of driving, checks,
expansions, hits. Where all attempts were made in turn, the whole time until the robot is there and
planning are judged. What uses no memory cannot differ: it raises an alarm instead of a verdict.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
import pandas as pd

from dashboards.statistics.intervals import ratio
from dashboards.statistics.panels import Panel, panels
from dashboards.statistics.swaps import DRAWN, Difference, differences
from planners.attempt import WITHOUT_MEMORY
from planners.world.arrays import Floats
from storage.tables.configurations import Configuration

BETTER: Final = "better"
WORSE: Final = "worse"
SAME: Final = "no difference"
CONTROL: Final = "control"  # it uses no memory, and does not differ
ALARM: Final = "alarm"  # it uses no memory, but differs
LATER_MARGIN: Final = 0.01  # of the time until the robot is there: so much later is no later
MACHINE_MARGIN: Final = 0.05  # by which times without memory may differ before the machine is said to differ
MACHINE: Final = "the machine took"  # with which the reason begins where nothing but times differs
COLUMNS: Final = (
    "panel", "planner", "configuration", "problems", "first_ms", "ms", "reduction", "reduction_low",
    "reduction_high", "mostly", "mostly_low", "mostly_high", "checks_reduction", "checks_reduction_low",
    "checks_reduction_high", "first_driving_s", "driving_s", "sooner_s", "sooner_low_s", "sooner_high_s",
    "first_solved", "solved", "first_hit", "hit", "verdict", "why",
)  # fmt: skip


class _Measure(NamedTuple):
    """What is measured of each attempt, such that less is better."""

    of: Callable[[Panel], Floats]  # [problems, columns]
    less: str  # in words, if the other run has less
    more: str
    may: tuple[str, str] = ("", "")  # the same where it is not shown, of what decides over less work


def _arrival(panel: Panel) -> Floats:
    return panel.matrix("duration_s") + panel.matrix("planning_seconds")


def _logarithm(values: Floats) -> Floats:
    return np.log(np.maximum(values, 1e-6))


_UNSOLVED: Final = _Measure(
    lambda panel: 1.0 - panel.matrix("solved"),
    "solves more",
    "solves fewer",
    ("may solve more", "may solve fewer"),
)
_ARRIVAL: Final = _Measure(
    _arrival, "there sooner", "there later", ("may be there sooner", "may be there later")
)
_DRIVING: Final = _Measure(
    lambda panel: panel.matrix("duration_s"),
    "drives shorter",
    "drives longer",
    ("may drive shorter", "may drive longer"),
)
_PLANNING: Final = _Measure(lambda panel: panel.milliseconds(), "plans faster", "plans slower")
_MOSTLY: Final = _Measure(lambda panel: _logarithm(panel.milliseconds()), "mostly faster", "mostly slower")
_CHECKS: Final = _Measure(lambda panel: panel.matrix("collision_checks"), "fewer checks", "more checks")
_EXPANSIONS: Final = _Measure(lambda panel: panel.matrix("expansions"), "expands less", "expands more")
_MISSED: Final = _Measure(lambda panel: 1.0 - panel.hits(), "more hits", "fewer hits")
_COUNTS: Final = (_CHECKS, _EXPANSIONS, _MISSED)


class _Sides(NamedTuple):
    """A panel of both runs, and the columns that both have."""

    first: Panel
    other: Panel
    columns: list[tuple[str, Configuration]]

    def values(self, measure: _Measure) -> tuple[Floats, Floats]:
        """What was measured of both, ``[problems, columns]`` each; NaN where one has none."""
        first, other = (
            measure.of(panel)[:, [panel.columns.index(column) for column in self.columns]]
            for panel in (self.first, self.other)
        )
        missing = np.isnan(first) | np.isnan(other)
        return np.where(missing, np.nan, first), np.where(missing, np.nan, other)

    def means(self, measure: _Measure) -> tuple[Floats, Floats]:
        """The means ``[columns]`` of both over the same problems; NaN if there are none."""
        first, other = self.values(measure)
        count = (~np.isnan(first)).sum(axis=0)
        means = (
            np.divide(np.nansum(each, axis=0), count, out=np.full(len(count), np.nan), where=count > 0)
            for each in (first, other)
        )
        return next(means), next(means)


def compare_runs(
    first: pd.DataFrame, other: pd.DataFrame, in_turn: bool = False, seed: int = 0, drawn: int = DRAWN
) -> pd.DataFrame:
    """Compare two runs by the problems that both attempted.

    Args:
        first: attempt rows of a run.
        other: attempt rows of the run that is compared with it.
        in_turn: whether the attempts of both were made in turn on one machine, in an order that was drawn.
        seed: of the swaps by which differences are judged.
        drawn: how many swaps.

    Returns:
        a row a panel, planner and configuration that both attempted, with the columns of ``COLUMNS``.
        ``reduction`` is 1 less the ratio of mean planning times, ``mostly`` 1 less the geometric mean of
        the problems' ratios. ``sooner_s`` says how much sooner the robot is there, where both solved the
        problem; unless ``in_turn`` only driving counts. ``_low`` and ``_high`` are the ends of intervals that
        hold for all rows at once; planning has them only ``in_turn``. ``verdict`` is BETTER, WORSE or SAME,
        without memory CONTROL or ALARM, and ``why`` says by what.
        ``first_hit`` and ``hit`` are shares of problems that a recalled plan fits; of recalled answers, if
        one of the runs has rows of an earlier version, which do not say what fits.
    """
    pairs = _paired(first, other)
    if not pairs:
        return pd.DataFrame(columns=list(COLUMNS))
    reach = _ARRIVAL if in_turn else _DRIVING
    measures = (_UNSOLVED, reach, *([_PLANNING, _MOSTLY] if in_turn else []), *_COUNTS)
    families = [np.hstack([np.subtract(*sides.values(each)) for each in measures]) for sides in pairs]
    tables = []
    for sides, found in zip(pairs, differences(families, seed, drawn), strict=True):
        split = zip(*(np.split(each, len(measures)) for each in found), strict=True)
        by_measure = {each: Difference(*ends) for each, ends in zip(measures, split, strict=True)}
        tables.append(_table(sides, by_measure, reach))
    return pd.concat(tables, ignore_index=True)[list(COLUMNS)]


def alarms(rows: pd.DataFrame) -> list[str]:
    """A line for each of the ``rows`` of ``compare_runs`` that uses no memory and differs all the same."""
    wrong = rows[rows["verdict"] == ALARM]
    return [
        f"ALARM: {row['planner']} {row['configuration']} on {row['panel']} uses no memory, yet {row['why']}."
        for row in wrong.to_dict("records")
    ]


def verdict(rows: pd.DataFrame) -> str:
    """How many configurations in the ``rows`` of ``compare_runs`` are better, worse or the same, in words."""
    counts = Counter(rows["verdict"])
    named = ", ".join(f"{counts[each]} {each}" for each in (BETTER, WORSE, SAME))
    return f"{named} of {sum(counts[each] for each in (BETTER, WORSE, SAME))} configurations"


def _paired(first: pd.DataFrame, other: pd.DataFrame) -> list[_Sides]:
    """The panels in which both attempted the same problems in the same ways."""
    shared = np.intersect1d(first["problem_id"], other["problem_id"])
    if not all((rows["hit"].notna() | rows["assist"].isin(WITHOUT_MEMORY)).all() for rows in (first, other)):
        first, other = (rows.assign(hit=None) for rows in (first, other))
    before, after = (
        {panel.name: panel for panel in panels(rows[rows["problem_id"].isin(shared)])}
        for rows in (first, other)
    )
    both = [
        _Sides(
            before[name], after[name], [each for each in after[name].columns if each in before[name].columns]
        )
        for name in after
        if name in before and before[name].problems == after[name].problems
    ]
    return [sides for sides in both if sides.columns]


def _table(sides: _Sides, found: dict[_Measure, Difference], reach: _Measure) -> pd.DataFrame:
    names = [(sides.other.name, planner, each.label) for planner, each in sides.columns]
    rows = pd.DataFrame(names, columns=["panel", "planner", "configuration"])
    rows["problems"] = (~np.isnan(sides.values(_UNSOLVED)[0])).sum(axis=0)
    rows["first_ms"], rows["ms"] = sides.means(_PLANNING)
    rows["first_driving_s"], rows["driving_s"] = sides.means(_DRIVING)
    for name, measure in (("solved", _UNSOLVED), ("hit", _MISSED)):
        rows[f"first_{name}"], rows[name] = (1.0 - each for each in sides.means(measure))
    rows["reduction"] = 1.0 - ratio(rows["ms"].to_numpy(), rows["first_ms"].to_numpy())
    rows[["reduction_low", "reduction_high", "mostly", "mostly_low", "mostly_high"]] = np.nan
    if _MOSTLY in found:
        for name, value in zip(("mostly", "mostly_low", "mostly_high"), found[_MOSTLY], strict=True):
            rows[name] = 1.0 - np.exp(-value)
    for name, measure in (("reduction", _PLANNING), ("checks_reduction", _CHECKS)):
        if measure in found:
            base = sides.means(measure)[0]
            ends = [np.where(base > 0.0, ratio(each, base), np.sign(each)) for each in found[measure]]
            rows[name], rows[f"{name}_low"], rows[f"{name}_high"] = ends
    rows["sooner_s"], rows["sooner_low_s"], rows["sooner_high_s"] = found[reach]
    later = LATER_MARGIN * np.minimum(*sides.means(reach))
    judged = [_judged(found, reach, i, later[i]) for i in range(len(rows))]
    for i, (_, configuration) in enumerate(sides.columns):
        if configuration.assist in WITHOUT_MEMORY:
            judged[i] = _of_control(judged[i], _PLANNING in found, float(rows["reduction"].iloc[i]))
    return rows.assign(verdict=[each[0] for each in judged], why=[each[1] for each in judged])


def _judged(found: dict[_Measure, Difference], reach: _Measure, i: int, margin: float) -> tuple[str, str]:
    """Verdict and reason for a column: what counts most decides. The other way round it is the opposite.

    Less work counts only of whoever is not there later by more than a margin in seconds, nor solves fewer.
    """
    efforts = [_PLANNING, _MOSTLY] if _PLANNING in found else list(_COUNTS)
    solved, there = found[_UNSOLVED], found[reach]
    for decisive in ([_UNSOLVED], [reach], efforts):
        good = [each.less for each in decisive if found[each].low[i] > 0.0]
        bad = [each.more for each in decisive if found[each].high[i] < 0.0]
        words = ", ".join(good + bad)
        if good and bad:
            return SAME, words
        if good or bad:
            towards, sooner = (1.0, there.low[i]) if good else (-1.0, -there.high[i])
            if towards * solved.mean[i] < 0.0:
                return SAME, f"{words}; {_UNSOLVED.may[bool(good)]}"
            if decisive is efforts and not sooner >= -margin:
                return SAME, f"{words}; {reach.may[bool(good)]}"
            return (BETTER if good else WORSE), words
    return SAME, ""


def _of_control(judged: tuple[str, str], in_turn: bool, reduction: float) -> tuple[str, str]:
    """What takes the place of a verdict where no memory is used."""
    if judged[1]:
        return ALARM, judged[1]
    if not in_turn and abs(reduction) > MACHINE_MARGIN:
        return ALARM, f"{MACHINE} {abs(reduction):.0%} {'less' if reduction > 0.0 else 'more'} time"
    return CONTROL, ""
