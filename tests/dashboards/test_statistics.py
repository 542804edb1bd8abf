from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dashboards.statistics import COMBINED, bootstrap, panels, summarise
from tests.dashboards.synthetic import BASELINE, CLOSED, STANDARD, attempts


def only(summary: pd.DataFrame, **wanted: object) -> pd.Series:
    """The one row of a summary with these values."""
    for column, value in wanted.items():
        summary = summary[summary[column] == value]
    assert len(summary) == 1
    return summary.iloc[0]


@settings(max_examples=20)
@given(seed=st.integers(0, 1000), problems=st.integers(2, 60), speed_up=st.floats(0.2, 50.0))
def test_intervals_hold_their_own_figure(seed: int, problems: int, speed_up: float) -> None:
    rows = attempts(("curves",), ("rrt",), [BASELINE, CLOSED], problems, speed_up, seed)
    summary = summarise(rows, resamples=500)
    slack = 1e-9
    for _, row in summary.iterrows():
        assert row["mean_low_ms"] - slack <= row["mean_ms"] <= row["mean_high_ms"] + slack
        assert row["reduction_low"] - slack <= row["reduction"] <= row["reduction_high"] + slack
    assert only(summary, assist="none")["reduction"] == 0.0


def test_figures_are_those_of_a_plain_loop(attempt_rows: pd.DataFrame) -> None:
    summary = summarise(attempt_rows, resamples=10)
    for _, row in summary.iterrows():
        chosen = [
            attempt
            for attempt in attempt_rows.fillna({"recall": ""}).to_dict("records")
            if (attempt["problem_class"], attempt["planner"]) == (row["panel"], row["planner"])
        ]
        keys = ("assist", "recall", "top_k")
        mine = [a for a in chosen if all(a[key] == row[key] for key in keys)]
        baseline = {a["problem_id"]: a["planning_seconds"] for a in chosen if a["assist"] == "none"}
        times = [1e3 * a["planning_seconds"] for a in mine]
        assert row["mean_ms"] == pytest.approx(np.mean(times))
        assert row["median_ms"] == pytest.approx(np.median(times))
        assert row["p90_ms"] == pytest.approx(np.percentile(times, 90))
        assert row["solved"] == pytest.approx(np.mean([a["solved"] for a in mine]))
        assert row["recalled"] == pytest.approx(np.mean([a["source"] == "recalled" for a in mine]))
        without = 1e3 * sum(baseline[a["problem_id"]] for a in mine)
        assert row["reduction"] == pytest.approx(1.0 - sum(times) / without)


@given(seed=st.integers(0, 100))
@settings(max_examples=5)
def test_the_order_of_the_rows_changes_nothing(attempt_rows: pd.DataFrame, seed: int) -> None:
    shuffled = attempt_rows.sample(frac=1.0, random_state=seed)
    pd.testing.assert_frame_equal(
        summarise(attempt_rows, resamples=50), summarise(shuffled, resamples=50), rtol=1e-12
    )


def test_pairing_narrows_the_interval() -> None:
    rows = attempts(("curves",), ("rrt",), [BASELINE, CLOSED], problems=200)
    paired = only(summarise(rows), assist="closed")
    rng = np.random.default_rng(1)
    ids = rows["problem_id"].to_numpy().copy()
    of_memory = (rows["assist"] == "closed").to_numpy()
    ids[of_memory] = rng.permutation(ids[of_memory])
    broken = only(summarise(rows.assign(problem_id=ids)), assist="closed")
    assert paired["reduction"] == pytest.approx(broken["reduction"])
    paired_width = paired["reduction_high"] - paired["reduction_low"]
    assert paired_width < 0.6 * (broken["reduction_high"] - broken["reduction_low"])


def test_only_problems_that_both_attempted_are_compared() -> None:
    rows = attempts(("curves",), ("rrt",), [BASELINE, CLOSED], problems=10)
    hard = rows["problem_id"].isin(["curves-0", "curves-1"])
    without = rows[~((rows["assist"] == "none") & hard)]
    expected = only(summarise(rows[~hard], resamples=10), assist="closed")["reduction"]
    assert only(summarise(without, resamples=10), assist="closed")["reduction"] == pytest.approx(expected)


def test_failures_keep_their_time_and_count_as_failures() -> None:
    rows = attempts(("curves",), ("rrt",), [BASELINE], problems=10).assign(solved=True)
    before = only(summarise(rows, resamples=10))
    failure = rows.index == 3
    after = only(
        summarise(
            rows.assign(
                solved=~failure,
                planning_seconds=rows["planning_seconds"].where(~failure, 30.0),
                source=rows["source"].where(~failure, None),
            ),
            resamples=10,
        )
    )
    assert before["solved"] == 1.0
    assert after["solved"] == pytest.approx(0.9)
    assert after["problems"] == 10
    assert after["mean_ms"] > 3000.0


def test_without_a_baseline_there_is_no_reduction() -> None:
    row = only(summarise(attempts(("curves",), ("rrt",), [CLOSED]), resamples=10))
    assert np.isnan([row["reduction"], row["reduction_low"], row["reduction_high"]]).all()
    assert row["mean_low_ms"] <= row["mean_ms"] <= row["mean_high_ms"]


def test_the_same_seed_gives_the_same_intervals(attempt_rows: pd.DataFrame) -> None:
    pd.testing.assert_frame_equal(
        summarise(attempt_rows, seed=1, resamples=50), summarise(attempt_rows, seed=1, resamples=50)
    )


def test_the_bootstrap_interval_of_a_mean_is_the_textbook_one() -> None:
    times = np.random.default_rng(0).normal(10.0, 2.0, (400, 1))
    means, reductions = bootstrap(times, times, seed=0, resamples=4000)
    assert means.std() == pytest.approx(times.std() / 20.0, rel=0.05)
    assert (reductions == 0.0).all()


def test_the_combined_memory_has_a_panel_of_its_own_with_the_same_baseline() -> None:
    rows = pd.concat([attempts(), attempts(configurations=STANDARD[1:], memory=COMBINED)])
    found = panels(rows)
    assert list(found) == ["curves", "random", "trap", COMBINED]
    for name in ("curves", "random", "trap"):
        assert COMBINED not in set(found[name]["memory"])
    assert (found[COMBINED]["assist"] == "none").sum() == 3 * 3 * 40
    assert not summarise(rows, resamples=10)["reduction"].isna().any()


def test_no_attempts_give_an_empty_summary(attempt_rows: pd.DataFrame) -> None:
    summary = summarise(attempt_rows.iloc[:0])
    assert summary.empty
    assert list(summary.columns) == list(summarise(attempt_rows, resamples=2).columns)
