"""The rule of promotion: laws of who must be promoted and who must not."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dashboards.statistics.intervals import CONFIDENCE
from dashboards.verdicts import promotion
from dashboards.verdicts.promotion import (
    FEWER,
    LATER,
    OPEN,
    SOONER,
    judge,
    judgement_line,
    judgement_markdown,
    judgement_tables,
)
from storage.tables.configurations import Configuration
from tests.dashboards.synthetic import attempts

WITH_MEMORY = [Configuration("closed", "encoder", 5), Configuration("open", "exhaustive", 5)]
COLUMNS = 2 * 2 * 2


@pytest.fixture(autouse=True)
def _few_resamples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(promotion, "RESAMPLES", 1_000)


@pytest.fixture(scope="module")
def champion() -> pd.DataFrame:
    return attempts(("curves", "trap"), ("gust", "follow"), WITH_MEMORY, problems=60)


def _times(rows: pd.DataFrame, factor: float | np.ndarray, which: pd.Series | bool = True) -> pd.DataFrame:
    seconds = rows["planning_seconds"]
    return rows.assign(planning_seconds=np.where(which, seconds * factor, seconds))


def test_nobody_is_promoted_over_an_equal(champion: pd.DataFrame) -> None:
    found = judge(champion, champion.sample(frac=1.0, random_state=1))
    assert not found.passes
    assert found.why.startswith("not shown to be sooner")
    assert (found.sooner_s, found.low_s, found.high_s) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    assert set(found.columns["verdict"]) == {OPEN}
    assert len(found.columns) == COLUMNS
    assert found.problems == 120


def _drives(rows: pd.DataFrame, longer: float | np.ndarray, which: pd.Series | bool = True) -> pd.DataFrame:
    return rows.assign(duration_s=rows["duration_s"] + np.where(which, longer, 0.0))


def test_whoever_plans_faster_everywhere_and_drives_the_same_is_promoted(champion: pd.DataFrame) -> None:
    found = judge(champion, _times(champion, 0.5))
    assert found.passes
    assert found.sooner_s == pytest.approx(0.5 * champion["planning_seconds"].mean())
    assert set(found.columns["verdict"]) == {SOONER}


def test_whoever_plans_the_same_and_drives_shorter_is_promoted(champion: pd.DataFrame) -> None:
    found = judge(champion, _drives(champion, -0.5))
    assert found.passes
    assert found.sooner_s == pytest.approx(0.5 * champion["solved"].mean(), abs=0.02)


def test_whoever_plans_faster_and_drives_longer_is_refused(champion: pd.DataFrame) -> None:
    found = judge(champion, _drives(_times(champion, 0.1), 0.5))
    assert not found.passes
    assert found.high_s < 0.0
    assert set(found.columns["verdict"]) == {LATER}


def test_whoever_plans_slower_and_drives_shorter_by_more_is_promoted(champion: pd.DataFrame) -> None:
    assert judge(champion, _drives(_times(champion, 2.0), -0.5)).passes


def test_who_drives_longer_somewhere_is_refused_however_much_shorter_elsewhere(
    champion: pd.DataFrame,
) -> None:
    somewhere = (champion["planner"] == "gust") & (champion["assist"] == "open")
    worse = _drives(_drives(champion, -2.0), 3.0, somewhere & (champion["problem_class"] == "curves"))
    found = judge(champion, worse)
    assert found.low_s > 0.0
    assert not found.passes
    assert "later there with gust open 5 exhaustive on curves" in found.why


def test_microseconds_that_nobody_notices_refuse_nobody(champion: pd.DataFrame) -> None:
    somewhere = (champion["planner"] == "gust") & (champion["problem_class"] == "curves")
    seconds = champion["planning_seconds"] + np.where(somewhere, 5e-4, 0.0)
    assert judge(champion, _drives(champion.assign(planning_seconds=seconds), -0.5, ~somewhere)).passes


def test_not_solving_a_problem_is_never_sooner(champion: pd.DataFrame) -> None:
    rows = champion.assign(planning_seconds=1e-3)
    longest = rows["duration_s"] > rows.groupby("problem_class")["duration_s"].transform("quantile", 0.7)
    given_up = rows.assign(solved=rows["solved"] & ~longest)
    assert judge(rows, given_up).sooner_s < 0.0
    assert not judge(rows, given_up).passes


def test_of_two_never_both_are_promoted(champion: pd.DataFrame) -> None:
    rng = np.random.default_rng(3)
    for spread in (0.02, 0.2, 1.0):
        other = _times(champion, rng.lognormal(-0.1, spread, len(champion)))
        other = _drives(other, rng.normal(-0.01, spread, len(champion)))
        assert not (judge(champion, other).passes and judge(other, champion).passes)


def test_who_is_slower_somewhere_is_refused_however_much_faster_elsewhere(champion: pd.DataFrame) -> None:
    somewhere = (champion["planner"] == "follow") & (champion["assist"] == "closed")
    slow = _times(champion, 20.0)  # milliseconds, which a robot notices
    worse = _times(_times(slow, 0.3), 10.0, somewhere & (champion["problem_class"] == "trap"))
    found = judge(slow, worse)
    assert found.low_s > 0.0
    assert not found.passes
    assert "later there with follow closed 5 encoder on trap" in found.why
    assert (found.columns["verdict"] == LATER).sum() == 1


def test_who_solves_fewer_is_refused_however_fast(champion: pd.DataFrame) -> None:
    solved = champion["solved"].copy()
    solved[np.flatnonzero(solved)[0]] = False
    found = judge(champion, _times(champion, 0.1).assign(solved=solved))
    assert not found.passes
    assert "solves fewer in all" in found.why
    gone = champion["solved"] & ~((champion["planner"] == "gust") & (champion["assist"] == "open"))
    found = judge(champion, _times(champion, 0.1).assign(solved=gone))
    assert set(found.columns.loc[found.columns["verdict"] == FEWER, "planner"]) == {"gust"}


def test_chance_seldom_promotes(champion: pd.DataFrame) -> None:
    rng = np.random.default_rng(5)
    promoted = 0
    for _ in range(40):
        noise = [rng.lognormal(0.0, 0.3, len(champion)) for _ in range(2)]
        first, other = (_drives(_times(champion, each), np.log(each)) for each in noise)
        promoted += judge(first, other).passes
    assert promoted <= 4  # one in 40 is expected; five or more come of that rate in one case of 300


def test_what_is_not_paired_is_not_judged(champion: pd.DataFrame) -> None:
    for other in (champion[:-1], champion.assign(assist="repair"), champion[:0]):
        with pytest.raises(ValueError, match="have not attempted the same problems"):
            judge(champion, other)
    with pytest.raises(ValueError, match="have not attempted"):
        judge(champion[:0], champion[:0])


def test_both_forms_show_every_column_and_the_verdict(champion: pd.DataFrame) -> None:
    found = judge(champion, _times(champion, 0.5))
    text = judgement_markdown(found, "promoted")
    assert text.startswith("**promoted**: sooner there: ")
    assert "50.0 % less time" in text
    assert text.count("\n|") == COLUMNS + 2 * 2
    assert len(judgement_tables(found)) == 2


@given(st.integers(1, 25))
def test_an_interval_is_given_only_where_there_are_problems_enough_for_one(problems: int) -> None:
    rows = attempts(("curves",), ("gust",), WITH_MEMORY[:1], problems=problems)
    line = judgement_line(judge(rows, _times(rows, 0.5)))
    reach = 1.0 - 2.0 * 0.5**problems  # how often the values of all problems reach over the true median
    assert ("95 %" in line) == (reach >= CONFIDENCE)
    assert str(problems) in line


@pytest.mark.parametrize(("few", "many"), [(0.1, 3.0), (2.0, 0.5), (1.0, 1.0), (4.0, 4.0)])
def test_the_line_states_planning_time_as_it_follows_from_the_means_over_all_problems(
    few: float, many: float
) -> None:
    sizes = {"curves": 10, "trap": 40}
    parts = [attempts((name,), ("gust",), WITH_MEMORY[:1], size) for name, size in sizes.items()]
    before = pd.concat(parts, ignore_index=True)
    after = _times(before, np.where(before["problem_class"] == "curves", few, many))
    less = 100.0 * (1.0 - after["planning_seconds"].mean() / before["planning_seconds"].mean())
    told = f"plans in {abs(less):.1f} % {'more' if less < 0.0 else 'less'} time over all attempts"
    assert told in judgement_line(judge(before, after))
