"""Drift: told when hits have fallen or robots are there later, and never of what chance does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from dashboards.verdicts.drift import (
    FEWEST,
    OTHERS,
    Usefulness,
    drifts,
    library_at_work,
    library_benchmark,
    usefulness,
    usefulness_of,
)
from storage.tables.configurations import Configuration
from tests.dashboards.synthetic import attempts

THEN = Usefulness(1_000, hits=800, mean_ms=1.0, median_ms=0.1, solved=990, total_s=21.0, total_sd_s=2.0)
NAME = "gust open 5 exhaustive"


def _fallen(problems: int, hits: int) -> bool:
    (found,) = drifts("trap/2", {NAME: replace(THEN, problems=problems, hits=hits)}, {NAME: THEN})
    return found.has_fallen


@pytest.mark.parametrize(
    ("problems", "hits", "fallen"),
    [
        (100, 80, False),
        (100, 100, False),
        (100, 75, False),
        (100, 60, True),
        (1_000, 700, True),
        (5, 0, False),
    ],
)
def test_hits_have_fallen_where_they_are_significantly_fewer(problems: int, hits: int, fallen: bool) -> None:
    assert _fallen(problems, hits) is fallen


def test_what_is_told_of_few_problems_is_that_they_are_too_few_to_say() -> None:
    few, many = (replace(THEN, problems=count, hits=0, solved=count) for count in (FEWEST - 1, FEWEST))
    of_few, of_many = (str(drifts("trap/2", {NAME: now}, {NAME: THEN})[0]) for now in (few, many))
    assert of_few.count("too few to say") == 2  # hits and total times
    assert "as it was" not in of_few
    assert "(fallen" in of_many
    assert "(as it was" in of_many


def test_chance_hardly_ever_is_a_drift() -> None:
    rng = np.random.default_rng(1)
    drawn = rng.binomial(200, 0.8, 2_000)
    assert sum(_fallen(200, int(hits)) for hits in drawn) <= 8  # 2 are expected at most


@pytest.mark.parametrize(
    ("solved", "total_s", "drifted"),
    [(200, 21.0, False), (200, 20.0, False), (200, 21.3, False), (200, 22.0, True), (10, 30.0, False)],
)
def test_a_memory_has_drifted_where_planning_and_driving_take_significantly_longer(
    solved: int, total_s: float, drifted: bool
) -> None:
    now = replace(THEN, problems=solved, hits=4 * solved // 5, mean_ms=0.1, solved=solved, total_s=total_s)
    (found,) = drifts("trap/2", {NAME: now}, {NAME: THEN})
    assert not found.has_fallen
    assert (found.is_later, found.has_drifted) == (drifted, drifted)


def test_a_benchmark_of_an_earlier_version_says_nothing_of_driving() -> None:
    then = Usefulness(problems=1_000, hits=800, mean_ms=1.0, median_ms=0.1)
    (found,) = drifts("trap/2", {NAME: replace(THEN, total_s=90.0)}, {NAME: then})
    assert not found.has_drifted
    assert "driving" not in str(found)
    assert found.to_row()["benchmark_total_s"] is None


def test_chance_hardly_ever_is_later() -> None:
    rng = np.random.default_rng(2)
    later = 0
    for _ in range(1_000):
        driving = 18.0 + rng.lognormal(1.0, 0.6, 100)  # skewed as driving times are
        now = usefulness_of(80, np.full(100, 1e-3), driving)
        then = usefulness_of(800, np.full(1_000, 1e-3), 18.0 + rng.lognormal(1.0, 0.6, 1_000))
        later += drifts("trap/2", {NAME: now}, {NAME: then})[0].has_drifted
    assert later <= 6  # one is expected


def test_only_configurations_that_both_know_are_compared() -> None:
    rows = attempts(("trap",), ("gust", "rrt"), [Configuration("open", "exhaustive", 5)], problems=30)
    known = usefulness(rows)
    assert set(known) == {"gust open 5 exhaustive", "rrt open 5 exhaustive"}
    assert drifts("trap/2", known, {"follow open 5": THEN}) == []
    (found,) = drifts("trap/2", {"gust open 5 exhaustive": known["gust open 5 exhaustive"]}, known)
    assert not found.has_fallen
    assert found.p_value > 0.4
    assert found.to_json()["hit_rate"] == found.to_json()["benchmark_hit_rate"]


def test_polished_answers_are_compared_with_polished_ones_where_the_benchmark_has_them() -> None:
    polished = f"{NAME} polished"
    later = replace(THEN, total_s=25.0)
    (found,) = drifts("trap/2", {polished: THEN}, {NAME: later, polished: THEN})
    assert (found.then, found.then_as_found) == (THEN, False)
    (found,) = drifts("trap/2", {polished: THEN}, {NAME: later})
    assert (found.then, found.then_as_found) == (later, True)
    assert not found.has_drifted


def test_usefulness_counts_recalled_plans() -> None:
    rows = attempts(("trap",), ("gust",), [Configuration("open", "exhaustive", 5)], problems=30)
    (found,) = usefulness(rows).values()
    assert (found.problems, found.hits) == (30, int((rows["source"] == "recalled").sum()))
    assert found.mean_ms == pytest.approx(1e3 * rows["planning_seconds"].mean())
    assert found.solved == rows["solved"].sum()
    assert found.total_s == pytest.approx((rows["planning_seconds"] + rows["duration_s"]).mean())


def _asked(name: str, count: int, from_memory: int, driving_s: float) -> pd.DataFrame:
    """Attempts at ``count`` questions of a class, of which a library answers some."""
    rng = np.random.default_rng(count)
    rows: dict[str, object] = {
        "problem_class": name, "planner": "lattice", "assist": "repair", "polished": True,
        "source": ["repaired" if number < from_memory else "searched" for number in range(count)],
        "planning_seconds": 0.1, "duration_s": driving_s + rng.normal(0.0, 1.0, count),
    }  # fmt: skip
    return pd.DataFrame(rows)


JUDGED = [_asked("dock", 80, 76, 10.0), _asked("yard", 80, 72, 18.0), _asked("lot", FEWEST - 1, 0, 8.0)]


@pytest.mark.parametrize(
    ("at_work", "told"),
    [
        ([_asked("dock", 40, 38, 10.0)], []),
        ([_asked("dock", 40, 38, 10.0), _asked("yard", 60, 54, 18.0)], []),
        ([_asked("yard", 60, 54, 18.0)], []),  # though all questions together were 14 s by mean
        ([_asked("dock", 40, 20, 10.0), _asked("yard", 60, 54, 18.0)], ["lattice repair, dock"]),
        ([_asked("dock", 40, 38, 10.0), _asked("yard", 60, 54, 22.0)], ["lattice repair, yard"]),
        ([_asked("angled", 40, 8, 60.0)], [f"lattice repair ({OTHERS})"]),  # whatever they take
        ([_asked("angled", 40, 35, 60.0)], []),
        ([_asked("lot", 40, 0, 8.0)], []),  # as when it was judged
        ([_asked("lot", 40, 0, 80.0)], []),  # too few were judged to say how long they take
        ([_asked("dock", 19, 18, 10.0), _asked("lot", 19, 0, 8.0)], []),  # another mix is no drift
        ([_asked(OTHERS, 40, 0, 8.0)], [f"lattice repair ({OTHERS})"]),  # whatever a class is called
        ([_asked("dock", 40, 0, 10.0).assign(polished=None)], []),  # rows of an earlier version
        ([_asked("dock", FEWEST - 1, 0, 10.0)], []),
        ([_asked("dock", 40, 0, 10.0).assign(planner="gust")], []),
        ([_asked("dock", 40, 0, 10.0).assign(polished=False)], []),
    ],
)
def test_a_library_is_watched_by_class_and_in_questions_of_no_known_class(
    at_work: list[pd.DataFrame], told: list[str]
) -> None:
    then = library_benchmark(pd.concat(JUDGED))
    found = drifts("motion-memory-yards/2", library_at_work(pd.concat(at_work), then), then)
    assert [each.configuration for each in found if each.has_drifted] == told


def test_what_judged_a_library_is_no_drift() -> None:
    judged = pd.concat(JUDGED)
    then = library_benchmark(judged)
    found = drifts("motion-memory-yards/2", library_at_work(judged, then), then)
    assert {each.configuration for each in found} == set(then) - {f"lattice repair ({OTHERS})"}
    assert sum(each.now.problems for each in found) == len(judged)
    assert not any(each.is_later for each in found)


def test_the_more_is_compared_the_clearer_a_drift_has_to_be() -> None:
    alone = drifts("trap/2", {NAME: replace(THEN, problems=100, hits=64)}, {NAME: THEN})
    assert [each.has_drifted for each in alone] == [True]
    many = {f"{NAME} {number}": THEN for number in range(20)}
    now = {name: replace(THEN, problems=100, hits=64) for name in many}
    assert not any(each.has_drifted for each in drifts("trap/2", now, many))
