from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ecdf

from dashboards.statistics.distributions import (
    REST,
    TIME_PARTS,
    endings,
    performance_profile,
    solved_against_time,
    time_split,
)
from storage.tables.configurations import BASELINE
from tests.dashboards.synthetic import ABLATION, CLOSED_1, STANDARD, attempts

seeds = st.integers(0, 1000)


def curve_of(table: pd.DataFrame, assist: str) -> pd.DataFrame:
    return table[table["assist"] == assist].reset_index(drop=True)


@settings(max_examples=10)
@given(seed=seeds)
def test_solved_against_time_is_scipy_s_distribution_of_times_with_failures_at_infinity(seed: int) -> None:
    rows = attempts(("trap",), ("rrt",), [BASELINE, CLOSED_1], seed=seed)
    table = solved_against_time(rows)
    for assist, mine in rows.groupby("assist"):
        censored = np.where(mine["solved"], 1e3 * mine["planning_seconds"], 1e300)
        curve = curve_of(table, str(assist))
        np.testing.assert_allclose(curve["solved"], ecdf(censored).cdf.evaluate(curve["ms"]))
        assert curve["solved"].is_monotonic_increasing
        assert curve["solved"].iloc[-1] == pytest.approx(mine["solved"].mean())


@settings(max_examples=10)
@given(seed=seeds, factor=st.floats(0.1, 10.0))
def test_a_profile_asks_how_often_within_a_multiple_of_the_fastest(seed: int, factor: float) -> None:
    rows = attempts(("trap",), ("rrt",), [BASELINE, CLOSED_1], seed=seed, speed_up=1.0)
    table = performance_profile(rows)
    times = {
        name: {
            row["problem_id"]: row["planning_seconds"] if row["solved"] else np.inf
            for row in mine.to_dict("records")
        }
        for name, mine in rows.groupby("assist")
    }
    for name in times:
        for ratio, solved in curve_of(table, str(name))[["ratio", "solved"]].to_numpy()[::20]:
            fastest = {problem: min(other[problem] for other in times.values()) for problem in times[name]}
            within = [
                np.isfinite(mine) and mine <= ratio * fastest[problem] * (1 + 1e-12)
                for problem, mine in times[name].items()
            ]
            assert solved == pytest.approx(np.mean(within), abs=1e-9)
    slower = rows.assign(planning_seconds=factor * rows["planning_seconds"])  # units do not matter
    pd.testing.assert_frame_equal(performance_profile(slower), table, rtol=1e-6)


def test_who_is_fastest_on_every_problem_starts_at_its_solved_share() -> None:
    rows = attempts(("trap",), ("rrt",), [BASELINE, CLOSED_1], speed_up=100.0).assign(solved=True)
    table = performance_profile(rows)
    assert (curve_of(table, "closed")["solved"] == 1.0).all()
    assert curve_of(table, "none")["solved"].iloc[0] == 0.0


def test_the_parts_of_planning_time_add_up_to_it(attempt_rows: pd.DataFrame) -> None:
    split = time_split(attempt_rows)
    assert set(split["part"]) == {*(part.name for part in TIME_PARTS), REST}
    whole = split.groupby(["panel", "planner", "configuration"])["ms"].sum()
    for panel, planner, name in whole.index:
        mine = attempt_rows[(attempt_rows["problem_class"] == panel) & (attempt_rows["planner"] == planner)]
        if name == "none":
            mean = 1e3 * mine.loc[mine["assist"] == "none", "planning_seconds"].mean()
            assert whole[panel, planner, name] == pytest.approx(mean)
    assert (split["ms"] >= 0.0).all()


def test_rows_that_lack_a_part_count_it_to_the_rest(attempt_rows: pd.DataFrame) -> None:
    whole = time_split(attempt_rows).groupby("configuration")["ms"].sum()
    fewer = time_split(attempt_rows.assign(guide_seconds=np.nan, repair_seconds=np.nan))
    assert (fewer.loc[fewer["part"] == "guide, repair", "ms"] == 0.0).all()
    pd.testing.assert_series_equal(fewer.groupby("configuration")["ms"].sum(), whole)


def test_every_attempt_ends_once(attempt_rows: pd.DataFrame) -> None:
    counted = endings(attempt_rows)
    assert list(counted.columns) == ["panel", "planner", "configuration", "solved", "budget-spent"]
    assert counted[["solved", "budget-spent"]].to_numpy().sum() == len(attempt_rows)
    assert counted["solved"].sum() == attempt_rows["solved"].sum()


def test_only_the_most_plans_of_each_assist_get_a_curve_and_no_blind_picks() -> None:
    table = solved_against_time(attempts(("trap",), ("gust",), [*STANDARD, *ABLATION]))
    shown = set(table[["assist", "recall", "top_k"]].itertuples(index=False, name=None))
    assert shown == {
        ("none", "", 0), ("closed", "encoder", 5), ("closed", "exhaustive", 5), ("open", "encoder", 5),
        ("open", "exhaustive", 5), ("repair", "exhaustive", 5), ("fresh", "", 0),
    }  # fmt: skip


def test_failures_alone_give_no_curve_and_no_trouble() -> None:
    rows = attempts(("trap",), ("rrt",), [BASELINE]).assign(solved=False, status="time-spent")
    assert solved_against_time(rows).empty
    assert (performance_profile(rows)["solved"] == 0.0).all()


@pytest.mark.parametrize("table", [solved_against_time, performance_profile, time_split, endings])
def test_no_attempts_give_an_empty_table(table: object, attempt_rows: pd.DataFrame) -> None:
    assert callable(table)
    assert table(attempt_rows.iloc[:0]).empty
