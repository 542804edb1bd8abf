"""Runs side by side: laws of what must and must not show as a difference."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from dashboards.cells import NOTHING, as_markdown
from dashboards.verdicts.comparison import (
    ALARM,
    BETTER,
    COLUMNS,
    CONTROL,
    SAME,
    WORSE,
    alarms,
    compare_runs,
    verdict,
)
from dashboards.verdicts.comparison_tables import comparison_tables
from tests.dashboards.synthetic import attempts

DRAWN = 1000


def _compare(first: pd.DataFrame, other: pd.DataFrame, in_turn: bool = False) -> pd.DataFrame:
    return compare_runs(first, other, in_turn, drawn=DRAWN)


def _times(rows: pd.DataFrame, factor: float, which: pd.Series, column: str) -> pd.DataFrame:
    return rows.assign(**{column: np.where(which, factor * rows[column], rows[column])})


def _noisy(rows: pd.DataFrame, seed: int) -> pd.DataFrame:
    noise = np.random.default_rng(seed).lognormal(0.0, 0.3, len(rows))
    return rows.assign(planning_seconds=noise * rows["planning_seconds"])


def _of_gust(table: pd.DataFrame) -> pd.Series:
    return table["configuration"].str.startswith("closed") & (table["planner"] == "gust")


@pytest.fixture(scope="module")
def run() -> pd.DataFrame:
    return attempts()


@pytest.fixture(scope="module")
def closed_of_gust(run: pd.DataFrame) -> pd.Series:
    return (run["assist"] == "closed") & (run["planner"] == "gust")


@pytest.mark.parametrize("in_turn", [True, False])
def test_a_run_does_not_differ_from_itself(run: pd.DataFrame, in_turn: bool) -> None:
    rows = _compare(run, run.sample(frac=1.0, random_state=1), in_turn)
    assert list(rows.columns) == list(COLUMNS)
    keys = ["problem_class", "planner", "assist", "top_k", "recall"]
    assert len(rows) == len(run[keys].drop_duplicates())
    assert np.allclose(rows[["reduction", "checks_reduction", "sooner_s"]], 0.0)
    controls = rows["configuration"].isin(["none", "fresh"])
    assert set(rows.loc[controls, "verdict"]) == {CONTROL}
    assert set(rows.loc[~controls, "verdict"]) == {SAME}
    assert alarms(rows) == []


def test_a_slower_machine_is_an_alarm_and_no_difference(run: pd.DataFrame) -> None:
    rows = _compare(run, _noisy(run.assign(planning_seconds=3.0 * run["planning_seconds"]), 1))
    controls = rows["configuration"].isin(["none", "fresh"])
    assert set(rows.loc[controls, "verdict"]) == {ALARM}
    assert set(rows.loc[~controls, "verdict"]) == {SAME}
    assert rows.loc[~controls, ["reduction_low", "reduction_high"]].isna().all(axis=None)
    assert "more time" in alarms(rows)[0]


def test_a_search_that_betters_what_fits_is_no_miss(run: pd.DataFrame) -> None:
    with_hits = run.assign(hit=(run["source"] == "recalled").where(run["memory"].notna()))
    bettered = with_hits.assign(source=run["source"].replace("recalled", "searched"))
    rows = _compare(with_hits, bettered)
    assert (rows["first_hit"] > 0.5).any()
    assert rows["hit"].equals(rows["first_hit"])
    assert set(rows["verdict"]) == {SAME, CONTROL}


def test_runs_that_do_not_both_tell_hits_are_compared_by_recalled_answers(run: pd.DataFrame) -> None:
    fits_everywhere = run.assign(hit=run["memory"].notna())
    again = run["problem_class"] == "trap"  # measured again by a later version
    for older in (run, run.assign(hit=None), run.assign(hit=fits_everywhere["hit"].where(again))):
        rows = _compare(older, fits_everywhere)
        assert 0.0 < rows["hit"].max() < 1.0
        assert rows["hit"].equals(rows["first_hit"])


def test_load_on_attempts_without_memory_makes_no_memory_better(run: pd.DataFrame) -> None:
    loaded = _times(run, 2.0, run["assist"] == "none", "planning_seconds")
    assert set(_compare(run, loaded)["verdict"]) <= {SAME, CONTROL, ALARM}
    assert BETTER not in set(_compare(run, loaded, in_turn=True)["verdict"])


def test_noise_of_attempts_in_turn_is_no_difference(run: pd.DataFrame) -> None:
    found = [_compare(_noisy(run, i), _noisy(run, 100 + i), in_turn=True)["verdict"] for i in range(6)]
    assert sum(bool({BETTER, WORSE, ALARM} & set(each)) for each in found) <= 2


def test_what_became_faster_in_turn_is_found_and_nothing_else(
    run: pd.DataFrame, closed_of_gust: pd.Series
) -> None:
    one = run.assign(duration_s=20.0).where(run["solved"], run)
    faster = _times(one, 0.5, closed_of_gust, "planning_seconds")
    rows = _compare(one, faster, in_turn=True)
    changed = _of_gust(rows)
    assert np.allclose(rows.loc[changed, "reduction"], 0.5)
    assert (rows.loc[changed, "reduction_low"] > 0.0).all()
    assert set(rows.loc[changed, "verdict"]) == {BETTER}
    assert set(rows.loc[~changed, "verdict"]) == {SAME, CONTROL}
    assert (
        verdict(rows)
        == f"{changed.sum()} better, 0 worse, {9 * 7 - changed.sum()} no difference of 63 configurations"
    )
    back = _compare(faster, one, in_turn=True)
    assert set(back.loc[changed, "verdict"]) == {WORSE}


def test_less_work_is_found_without_a_clock(run: pd.DataFrame, closed_of_gust: pd.Series) -> None:
    less = _times(run, 0.5, closed_of_gust, "collision_checks")
    rows = _compare(run, less)
    assert set(rows.loc[_of_gust(rows), "why"]) == {"fewer checks"}
    assert set(rows.loc[_of_gust(rows), "verdict"]) == {BETTER}
    assert set(rows.loc[~_of_gust(rows), "verdict"]) == {SAME, CONTROL}


@pytest.mark.parametrize("in_turn", [True, False])
def test_quicker_to_plan_and_longer_to_drive_is_worse(
    run: pd.DataFrame, closed_of_gust: pd.Series, in_turn: bool
) -> None:
    quicker = _times(run, 0.1, closed_of_gust, "planning_seconds")
    quicker = _times(quicker, 0.1, closed_of_gust, "collision_checks")
    rows = _compare(run, _times(quicker, 1.1, closed_of_gust, "duration_s"), in_turn)
    assert set(rows.loc[_of_gust(rows), "verdict"]) == {WORSE}
    assert set(rows.loc[_of_gust(rows), "why"]) == {"there later" if in_turn else "drives longer"}


def test_whoever_may_drive_longer_by_more_than_the_margin_is_not_better(
    run: pd.DataFrame, closed_of_gust: pd.Series
) -> None:
    quicker = _times(run, 0.1, closed_of_gust, "planning_seconds")
    rng = np.random.default_rng(3)
    other = quicker.assign(duration_s=quicker["duration_s"] * rng.lognormal(0.0, 0.3, len(run)))
    rows = _compare(run, other, in_turn=True)
    unclear = _of_gust(rows) & (rows["sooner_low_s"] < -0.3) & (rows["sooner_high_s"] > 0.0)
    assert unclear.any()
    assert BETTER not in set(rows.loc[unclear, "verdict"])
    assert rows.loc[unclear, "why"].str.endswith("faster; may be there later").all()


@pytest.mark.parametrize("in_turn", [True, False])
@pytest.mark.parametrize("longer", [0.98, 1.0, 1.005, 1.02])
def test_the_other_way_round_better_is_worse(
    run: pd.DataFrame, closed_of_gust: pd.Series, in_turn: bool, longer: float
) -> None:
    """Whoever plans with less work but may be there later is as far from better as the other from worse."""
    less = _times(run, 0.7, closed_of_gust, "planning_seconds")
    less = _times(less, 0.7, closed_of_gust, "collision_checks")
    noise = np.random.default_rng(3).normal(longer, 0.1, len(run))
    less = _times(less, pd.Series(noise, run.index), closed_of_gust, "duration_s")
    there, back = _compare(run, less, in_turn), _compare(less, run, in_turn)
    keys = ["panel", "planner", "configuration"]
    both = there.merge(back, on=keys, suffixes=("", "_back"))
    mirrored = both["verdict"].replace({BETTER: WORSE, WORSE: BETTER})
    assert mirrored.tolist() == both["verdict_back"].tolist()


def test_solving_fewer_problems_is_worse_however_quickly(
    run: pd.DataFrame, closed_of_gust: pd.Series
) -> None:
    gives_up = run.assign(
        solved=run["solved"] & ~(closed_of_gust & run["problem_id"].str.endswith(tuple("13579")))
    )
    gives_up = _times(gives_up, 0.1, closed_of_gust, "planning_seconds")
    rows = _compare(run, gives_up, in_turn=True)
    assert set(rows.loc[_of_gust(rows), "why"]) == {"solves fewer"}


def test_only_problems_that_are_in_both_count(run: pd.DataFrame) -> None:
    few = run[run["problem_id"].str.endswith("7")]
    assert set(_compare(run, few)["problems"]) == {few["problem_id"].nunique() // 3}
    pd.testing.assert_frame_equal(_compare(run, few), _compare(few, few))
    none = run.assign(problem_id=run["problem_id"] + "x")
    assert _compare(run, none).empty


def test_both_forms_show_every_line(run: pd.DataFrame) -> None:
    rows = _compare(run, run)
    text = as_markdown(comparison_tables(rows))
    assert text.count("\n|") == len(rows) + 3 * 2
    assert len(comparison_tables(rows)) == 3
    for table in comparison_tables(rows):
        for cells in (cells for group in table.groups for cells in group):
            assert (cells[-2] == NOTHING) == cells[-1].startswith(CONTROL)  # hits are of memories
