from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dashboards.statistics.intervals import interquartile_mean
from dashboards.statistics.panels import COLUMNS, COMBINED, compare, panels, summarise, summarise_continual
from storage.tables.configurations import BASELINE, Configuration, configured
from tests.dashboards.synthetic import ABLATION, CLOSED_1, POLISHED, STANDARD, attempts, meant


def only(summary: pd.DataFrame, **wanted: object) -> pd.Series:
    """The one row of a summary with these values."""
    for column, value in wanted.items():
        summary = summary[summary[column] == value]
    assert len(summary) == 1
    return summary.iloc[0]


@settings(max_examples=20)
@given(seed=st.integers(0, 1000), problems=st.integers(2, 60), speed_up=st.floats(0.2, 50.0))
def test_intervals_hold_their_own_figure(seed: int, problems: int, speed_up: float) -> None:
    rows = attempts(("curves",), ("rrt",), [BASELINE, CLOSED_1], problems, speed_up, seed)
    summary = summarise(rows, resamples=500)
    slack = 1e-9
    for _, row in summary.iterrows():
        assert row["mean_low_ms"] - slack <= row["mean_ms"] <= row["mean_high_ms"] + slack
        assert row["sooner_low_s"] - slack <= row["sooner_s"] <= row["sooner_high_s"] + slack
        assert row["reduction_low"] - slack <= row["reduction"] <= row["reduction_high"] + slack
    assert only(summary, assist="none")["reduction"] == 0.0


def test_figures_are_those_of_a_plain_loop(attempt_rows: pd.DataFrame) -> None:
    summary, attempted = summarise(attempt_rows, resamples=10), attempt_rows.to_dict("records")
    for _, row in summary.iterrows():
        chosen = [
            attempt
            for attempt in attempted
            if (attempt["problem_class"], attempt["planner"]) == (row["panel"], row["planner"])
        ]
        mine = [a for a in chosen if meant(a) == meant(row)]
        baseline = {a["problem_id"]: a["planning_seconds"] for a in chosen if a["assist"] == "none"}
        times = [1e3 * a["planning_seconds"] for a in mine]
        assert row["mean_ms"] == pytest.approx(np.mean(times))
        assert row["median_ms"] == pytest.approx(np.median(times))
        assert row["p90_ms"] == pytest.approx(np.percentile(times, 90))
        assert row["interquartile_mean_ms"] == pytest.approx(interquartile_mean(np.array(times)))
        assert row["solved"] == pytest.approx(np.mean([a["solved"] for a in mine]))
        assert row["recalled"] == pytest.approx(np.mean([a["source"] == "recalled" for a in mine]))
        without = 1e3 * sum(baseline[a["problem_id"]] for a in mine)
        assert row["reduction"] == pytest.approx(1.0 - sum(times) / without)
        assert row["driving_s"] == pytest.approx(np.mean([a["duration_s"] for a in mine if a["solved"]]))
        alone = {
            a["problem_id"]: a["planning_seconds"] + a["duration_s"]
            for a in chosen
            if a["assist"] == "none" and a["solved"]
        }
        sooner = [
            alone[a["problem_id"]] - a["planning_seconds"] - a["duration_s"]
            for a in mine
            if a["solved"] and a["problem_id"] in alone
        ]
        assert row["sooner_s"] == pytest.approx(np.mean(sooner), abs=1e-9)
        if row["assist"] == "none":
            assert np.isnan([row["slower"], row["slowdown"], row["p_value"]]).all()
            continue
        succeeded = {a["problem_id"]: a["solved"] for a in chosen if a["assist"] == "none"}
        ratios = [
            np.inf if not a["solved"] else 1e3 * a["planning_seconds"] / (1e3 * baseline[a["problem_id"]])
            for a in mine
            if succeeded[a["problem_id"]]
        ]
        slow = [ratio for ratio in ratios if ratio > 1.0]
        assert row["slower"] == pytest.approx(len(slow) / len(mine))
        assert (np.isnan(row["slowdown"]) and not slow) or row["slowdown"] == pytest.approx(np.median(slow))


@given(seed=st.integers(0, 100))
@settings(max_examples=5)
def test_the_order_of_the_rows_changes_nothing(attempt_rows: pd.DataFrame, seed: int) -> None:
    shuffled = attempt_rows.sample(frac=1.0, random_state=seed)
    pd.testing.assert_frame_equal(
        summarise(attempt_rows, resamples=50), summarise(shuffled, resamples=50), rtol=1e-12
    )


def test_pairing_narrows_the_interval() -> None:
    rows = attempts(("curves",), ("rrt",), [BASELINE, CLOSED_1], problems=200)
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
    rows = attempts(("curves",), ("rrt",), [BASELINE, CLOSED_1], problems=10)
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
    row = only(summarise(attempts(("curves",), ("rrt",), [CLOSED_1]), resamples=10))
    assert np.isnan([row["reduction"], row["reduction_low"], row["reduction_high"]]).all()
    assert row["mean_low_ms"] <= row["mean_ms"] <= row["mean_high_ms"]


def test_the_same_seed_gives_the_same_intervals(attempt_rows: pd.DataFrame) -> None:
    pd.testing.assert_frame_equal(
        summarise(attempt_rows, seed=1, resamples=50), summarise(attempt_rows, seed=1, resamples=50)
    )


def test_the_combined_memory_has_a_panel_of_its_own_with_the_same_baseline() -> None:
    rows = pd.concat([attempts(), attempts(configurations=STANDARD[1:], memory=COMBINED)])
    found = {panel.name: panel.rows for panel in panels(rows)}
    assert list(found) == ["curves", "random", "trap", COMBINED]
    for name in ("curves", "random", "trap"):
        assert COMBINED not in set(found[name]["memory"])
    assert (found[COMBINED]["assist"] == "none").sum() == 3 * 3 * 40
    assert not summarise(rows, resamples=10)["reduction"].isna().any()


def test_a_matrix_holds_each_row_at_its_problem_and_column(attempt_rows: pd.DataFrame) -> None:
    shuffled = attempt_rows.sample(frac=0.5, random_state=1)
    for panel in panels(shuffled):
        times, names = panel.milliseconds(), sorted(panel.rows["problem_id"].unique())
        assert np.count_nonzero(~np.isnan(times)) == len(panel.rows)
        for row in panel.rows.head(50).to_dict("records"):
            place = panel.columns.index((row["planner"], meant(row)))
            value = times[names.index(row["problem_id"]), place]
            assert value == pytest.approx(1e3 * row["planning_seconds"])


def test_a_comparison_with_the_baseline_is_the_summary_s_reduction(attempt_rows: pd.DataFrame) -> None:
    pairs = [(BASELINE, each) for each in STANDARD[1:]]
    compared = compare(attempt_rows, pairs, resamples=50)
    summary = summarise(attempt_rows, resamples=50).query("assist != 'none'")
    merged = compared.assign(configuration=compared["after"]).merge(
        summary, on=["panel", "planner", "configuration"]
    )
    assert len(merged) == len(summary) == 9 * (len(STANDARD) - 1)
    for name in ("reduction", "reduction_low", "reduction_high"):
        np.testing.assert_allclose(merged[f"{name}_x"], merged[f"{name}_y"], rtol=1e-9)


@settings(max_examples=20)
@given(gain=st.floats(0.1, 0.9), cost=st.floats(1.01, 5.0))
def test_a_comparison_of_exact_multiples_is_exact(gain: float, cost: float) -> None:
    rows = attempts(("trap",), ("gust",), [BASELINE, CLOSED_1], problems=20)
    seconds = rows["problem_id"].map(rows.groupby("problem_id")["planning_seconds"].mean())
    rows["planning_seconds"] = seconds * np.where(rows["assist"] == "none", 1.0, gain)
    both_ways = [(BASELINE, CLOSED_1), (CLOSED_1, BASELINE)]
    there, back = compare(rows, both_ways, resamples=20).to_dict("records")
    for row, wanted in ((there, 1.0 - gain), (back, 1.0 - 1.0 / gain)):
        assert [row[f"reduction{end}"] for end in ("", "_low", "_high")] == pytest.approx([wanted] * 3)
    rows["cost"] = np.where(rows["assist"] == "none", 1.0, cost)
    dearer = compare(rows, both_ways[:1], "cost", resamples=20)
    assert dearer["reduction"].item() == pytest.approx(1.0 - cost)


def test_an_attempt_made_again_counts_once_with_its_mean() -> None:
    rows = attempts(("trap",), ("rrt",), [BASELINE], problems=10)
    again = pd.concat([rows, rows.assign(planning_seconds=3.0 * rows["planning_seconds"])])
    once, twice = (only(summarise(each, resamples=10)) for each in (rows, again))
    assert twice["problems"] == 10
    assert twice["mean_ms"] == pytest.approx(2.0 * once["mean_ms"])


def test_rows_of_before_there_was_a_recall_mean_the_same() -> None:
    checked = Configuration("closed", "exhaustive", 0)
    now = attempts(("trap",), ("gust",), [*STANDARD[:5], checked, *ABLATION], problems=5)
    before = now.assign(recall=None)
    before.loc[now["recall"] == "exhaustive", "assist"] = "exhaustive"
    (rows, known), (old_rows, old_known) = configured(now), configured(before)
    assert list(rows["configuration"]) == list(old_rows["configuration"])
    assert known == old_known


def test_polished_answers_are_compared_with_polished_ones_and_change_no_other_row() -> None:
    rows = attempts(("trap",), ("lattice",), [*STANDARD, *POLISHED])
    summary = summarise(rows, resamples=10)
    found = summary[~summary["polished"]].reset_index(drop=True)
    pd.testing.assert_frame_equal(found, summarise(rows[~rows["polished"]], resamples=10), check_dtype=False)
    alone, helped = (
        rows[rows["polished"] & (rows["assist"] == assist)].set_index("problem_id")
        for assist in ("none", "repair")
    )
    total = [each["planning_seconds"] + each["duration_s"] for each in (alone, helped)]
    (row,) = summary[summary["configuration"] == "repair 5 exhaustive polished"].to_dict("records")
    assert row["sooner_s"] == pytest.approx((total[0] - total[1]).mean())
    assert row["reduction"] == pytest.approx(
        1.0 - helped["planning_seconds"].mean() / alone["planning_seconds"].mean()
    )


def test_a_hit_is_what_the_row_says_and_where_it_says_nothing_a_recalled_answer() -> None:
    rows = attempts(("trap",), ("lattice",), [BASELINE, CLOSED_1], problems=20)
    helped = rows["assist"] == "closed"
    recalled = rows["source"] == "recalled"
    summary = summarise(rows.assign(hit=helped.where(helped, None)), resamples=10)
    assert summary["hit"].tolist() == [0.0, 1.0]
    assert summary["recalled"].tolist() == [0.0, recalled[helped].mean()]
    assert summarise(rows, resamples=10)["hit"].tolist() == [0.0, recalled[helped].mean()]


def test_growing_experience_is_a_summary_for_each_number_of_experiences(attempt_rows: pd.DataFrame) -> None:
    both = pd.concat([attempt_rows.assign(experiences=20), attempt_rows.assign(experiences=40)])
    grown = summarise_continual(both, resamples=10)
    for count in (20, 40):
        mine = grown[grown["experiences"] == count].reset_index(drop=True)
        pd.testing.assert_frame_equal(mine[list(COLUMNS)], summarise(attempt_rows, resamples=10))


def test_no_attempts_give_an_empty_summary(attempt_rows: pd.DataFrame) -> None:
    summary = summarise(attempt_rows.iloc[:0])
    assert summary.empty
    assert list(summary.columns) == list(summarise(attempt_rows, resamples=2).columns)


def test_polished_answers_to_some_of_the_problems_are_compared_on_those_alone() -> None:
    rows = attempts(("curves",), ("lattice",), [*STANDARD, *POLISHED], 40)
    polished = rows[rows["polished"]]
    some = polished[polished["problem_id"].isin(sorted(rows["problem_id"].unique())[:13])]
    summary = summarise(pd.concat([rows[~rows["polished"]], some]), resamples=10)
    found = summary[~summary["polished"]].reset_index(drop=True)
    without = summarise(rows[~rows["polished"]], resamples=10)
    for table in (found, without):
        del table["p_value"]  # corrected for all comparisons of its own table
    pd.testing.assert_frame_equal(found, without, check_dtype=False)
    alone = summarise(some, resamples=10)
    assert set(alone["problems"]) == {13}
    figures = ["problems", "solved", "hit", "mean_ms", "median_ms", "reduction", "sooner_s", "slower"]
    pd.testing.assert_frame_equal(
        summary.loc[summary["polished"], figures].reset_index(drop=True), alone[figures], check_dtype=False
    )
