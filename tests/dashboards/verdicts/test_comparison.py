"""Runs side by side: laws of what must and must not show as a difference."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from dashboards.report.tables import NOTHING
from dashboards.verdicts.comparison import (
    COLUMNS,
    FASTER,
    OPEN,
    SLOWER,
    compare_runs,
    comparison_markdown,
    comparison_table,
    verdict,
)
from tests.dashboards.synthetic import attempts

RESAMPLES = 300


def _compare(first: pd.DataFrame, other: pd.DataFrame) -> pd.DataFrame:
    return compare_runs(first, other, resamples=RESAMPLES)


def _faster(rows: pd.DataFrame, factor: float, which: pd.Series) -> pd.DataFrame:
    return rows.assign(
        planning_seconds=np.where(which, rows["planning_seconds"] / factor, rows["planning_seconds"])
    )


@pytest.fixture(scope="module")
def run() -> pd.DataFrame:
    return attempts()


def test_a_run_is_no_faster_than_itself(run: pd.DataFrame) -> None:
    rows = _compare(run, run.sample(frac=1.0, random_state=1))
    assert list(rows.columns) == list(COLUMNS)
    keys = ["problem_class", "planner", "assist", "top_k", "recall"]
    assert len(rows) == len(run[keys].drop_duplicates())
    assert np.allclose(
        rows[["reduction", "reduction_low", "reduction_high", "checks_reduction", "slower"]], 0.0
    )
    assert set(rows.loc[rows["configuration"] != "none", "verdict"]) == {OPEN}
    assert set(rows.loc[rows["configuration"] == "none", "verdict"]) == {NOTHING}


def test_a_slower_machine_is_no_difference(run: pd.DataFrame) -> None:
    rows = _compare(run, _faster(run, 1 / 3, run["planning_seconds"] > 0.0))
    alone = rows["configuration"] == "none"
    assert np.allclose(rows.loc[alone, "reduction"], -2.0)  # which is shown
    assert np.allclose(rows.loc[~alone, ["reduction", "reduction_low", "reduction_high"]], 0.0)
    assert set(rows.loc[~alone, "verdict"]) == {OPEN}


def test_what_became_faster_is_found_and_nothing_else(run: pd.DataFrame) -> None:
    rows = _compare(run, _faster(run, 2.0, (run["assist"] == "closed") & (run["planner"] == "gust")))
    changed = rows["configuration"].str.startswith("closed") & (rows["planner"] == "gust")
    assert np.allclose(rows.loc[changed, ["reduction", "reduction_low", "reduction_high"]], 0.5)
    assert set(rows.loc[changed, "verdict"]) == {FASTER}
    assert FASTER not in set(rows.loc[~changed, "verdict"])
    back = _compare(_faster(run, 2.0, run["assist"] == "closed"), run)
    assert set(back.loc[back["configuration"].str.startswith("closed"), "verdict"]) == {SLOWER}
    assert verdict(rows).startswith(f"{changed.sum()} faster, 0 slower, ")


def test_only_problems_that_are_in_both_count(run: pd.DataFrame) -> None:
    few = run[run["problem_id"].str.endswith("7")]
    assert set(_compare(run, few)["problems"]) == {few["problem_id"].nunique() // 3}
    pd.testing.assert_frame_equal(_compare(run, few), _compare(few, few))
    none = run.assign(problem_id=run["problem_id"] + "x")
    assert _compare(run, none).empty


def test_both_forms_show_every_line(run: pd.DataFrame) -> None:
    rows = _compare(run, run)
    text = comparison_markdown(rows)
    assert text.count("\n|") == len(rows) + 3 * 2
    assert len(comparison_table(rows).renderables) == 3
