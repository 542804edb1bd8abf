"""What is said of a run and the one before it: as the comparison judges, and the other way round swapped."""

from __future__ import annotations

import pandas as pd
import pytest

from dashboards.verdicts.comparison import ALARM, BETTER, MACHINE, SAME, WORSE, alarms, compare_runs
from dashboards.verdicts.comparison_words import (
    IS_BETTER,
    IS_BOTH,
    IS_WORSE,
    NOT_SHOWN,
    grounds,
    main_alarms,
    standing,
)
from tests.dashboards.synthetic import attempts

ROWS = attempts(classes=("trap",), planners=("gust",), problems=120)
CLOSED = ROWS["assist"] == "closed"


def _more_checks(which: pd.Series, factor: float) -> pd.DataFrame:
    checks = ROWS["collision_checks"].where(~which, (factor * ROWS["collision_checks"]).astype(int))
    return ROWS.assign(collision_checks=checks)


def test_a_run_is_not_shown_to_differ_from_itself() -> None:
    table = compare_runs(ROWS, ROWS.sample(frac=1.0, random_state=1), drawn=500)
    assert standing(table) == NOT_SHOWN
    judged = int((table["verdict"] == SAME).sum())
    assert f"{judged} show no difference" in grounds(table)
    assert "120 of trap" in grounds(table)


def test_more_work_is_worse_and_the_other_way_round_better() -> None:
    more = _more_checks(CLOSED, 3.0)
    assert standing(compare_runs(ROWS, more, drawn=500)) == IS_WORSE
    assert standing(compare_runs(more, ROWS, drawn=500)) == IS_BETTER


@pytest.mark.parametrize("both", [False, True])
def test_a_run_may_be_better_in_one_way_and_worse_in_another(both: bool) -> None:
    rows = pd.DataFrame({"verdict": [BETTER, SAME, *([WORSE] if both else [])]})
    assert standing(rows) == (IS_BOTH if both else IS_BETTER)


def test_what_changes_without_a_memory_is_told() -> None:
    without = ROWS["assist"] == "none"
    said = grounds(compare_runs(ROWS, _more_checks(without, 3.0), drawn=500))
    assert said != grounds(compare_runs(ROWS, ROWS, drawn=500))
    slower = ROWS.assign(planning_seconds=3.0 * ROWS["planning_seconds"])  # the machine is, not the planner
    assert grounds(compare_runs(ROWS, slower, drawn=500)) == grounds(compare_runs(ROWS, ROWS, drawn=500))


def test_alarms_of_nothing_but_times_become_one_and_no_other_is_lost() -> None:
    def rows(*told: tuple[str, str, float]) -> pd.DataFrame:
        columns = ["verdict", "why", "reduction", "planner", "configuration", "panel"]
        return pd.DataFrame([(*each, "GUST", "none", "curves") for each in told], columns=columns)

    slower, quicker = (ALARM, f"{MACHINE} 9% more time", -0.09), (ALARM, f"{MACHINE} 20% less time", 0.2)
    other, fine = (ALARM, "solves fewer", 0.0), ("control", "", 0.0)
    assert main_alarms(rows(fine)) == []
    for few in (rows(slower, fine), rows(other, slower)):
        assert main_alarms(few) == alarms(few)
    many = rows(slower, other, quicker, fine, slower)
    kept, summed = main_alarms(many)
    assert [kept] == alarms(rows(other))
    assert "3 ways" in summed
    assert "-20 to +9 %" in summed
