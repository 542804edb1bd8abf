"""Time to quality: what counts as better, whatever was measured."""

from __future__ import annotations

import io
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest
from matplotlib.text import Text
from rich.console import Console

from planners.world.authority.authority import faults
from planners.world.classes.problem_classes import problem_class
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import CAR
from tests.planners.memories import memory_of
from tests.speed.time_to_quality.measuring import measured
from tests.speed.time_to_quality.methods import ALONE, ANYTIME, MEMORY, Found, Method, methods
from tests.speed.time_to_quality.quality import (
    BUDGETS,
    GOOD,
    MOST,
    Quality,
    driving,
    over_best,
    quality_of,
    ratios,
    time_to_good,
    total,
)
from tests.speed.time_to_quality.quality_curves import quality_curves
from tests.speed.time_to_quality.tables import headline, total_rows

HORIZON = 1.0
Steps = Sequence[tuple[float, float]]  # seconds and driving times


def rows_of(found: dict[tuple[str, str, str], tuple[Steps, float]]) -> pd.DataFrame:
    """Rows by problem, kind and name of the way: its better plans, and the seconds that it spent."""
    rows = []
    for (problem, kind, name), (steps, spent) in found.items():
        same = {"class": "a", "problem": problem, "kind": kind, "method": name, "spent": spent}
        rows += [
            {**same, "seconds": seconds, "duration_s": duration}
            for seconds, duration in steps or [(spent, float("nan"))]
        ]
    return pd.DataFrame(rows)


@pytest.fixture(scope="module")
def drawn() -> Quality:
    """Some problems, in which two ways go on and one answers once or never."""
    rng = np.random.default_rng(4)
    found: dict[tuple[str, str, str], tuple[Steps, float]] = {}
    for problem in (f"p{i}" for i in range(40)):
        for name in ("x", "y"):
            count = int(rng.integers(1, 6))
            seconds = np.sort(rng.uniform(1e-4, HORIZON, count))
            durations = np.sort(rng.uniform(18.0, 60.0, count))[::-1]
            found[problem, ANYTIME, name] = (list(zip(seconds, durations, strict=True)), HORIZON)
        answered = [(5e-5, float(rng.uniform(18.0, 30.0)))] if rng.random() < 0.8 else []
        found[problem, MEMORY, "m"] = (answered, 5e-5 if answered else 0.02)
    return quality_of(rows_of(found))


def test_with_more_time_no_plan_gets_worse_and_none_is_better_than_the_best_known(drawn: Quality) -> None:
    over = over_best(drawn, np.geomspace(1e-5, HORIZON, 30))
    assert (np.diff(over, axis=2) <= 0.0).all()
    assert over.min() >= 0.0
    assert over[:, :, -1].min(axis=1) == pytest.approx(0.0)


def test_no_plan_is_never_better_than_a_plan(drawn: Quality) -> None:
    over, there = over_best(drawn, BUDGETS), ~np.isnan(driving(drawn, BUDGETS))
    assert (over[~there] == MOST).all()
    assert over[there].max() <= MOST


def test_a_plan_is_good_from_the_moment_that_it_is_within_five_per_cent(drawn: Quality) -> None:
    over, times = over_best(drawn, BUDGETS), time_to_good(drawn)
    assert np.array_equal(over <= GOOD, times[:, :, None] <= BUDGETS)


def test_who_goes_on_spends_its_budget_and_who_answers_once_only_its_time(drawn: Quality) -> None:
    totals = total(drawn, BUDGETS)
    assert np.allclose(totals - drawn.best[:, None, None] * (1.0 + over_best(drawn, BUDGETS)),
                       np.minimum(drawn.spent[:, :, None], BUDGETS))  # fmt: skip
    answered = ~np.isnan(drawn.durations[:, drawn.names.index("m"), 0])
    assert np.ptp(totals[answered, drawn.names.index("m")], axis=1).max() == 0.0


def test_a_problem_that_nobody_solved_counts_nowhere() -> None:
    solved = {("p", ALONE, "x"): ([(1e-3, 20.0)], 1e-3), ("p", MEMORY, "m"): ([(1e-4, 22.0)], 1e-4)}
    nobody = {("q", ALONE, "x"): ([], 0.05), ("q", MEMORY, "m"): ([], 0.05)}
    with_it, without = quality_of(rows_of(solved | nobody)), quality_of(rows_of(solved))
    assert with_it.unsolved == 1
    assert np.array_equal(over_best(with_it, BUDGETS), over_best(without, BUDGETS))


def test_a_memory_that_is_best_at_once_is_sooner_than_every_way_at_every_budget() -> None:
    found: dict[tuple[str, str, str], tuple[Steps, float]] = {}
    for i in range(30):
        found[f"p{i}", MEMORY, "m"] = ([(1e-4, 20.0 + 0.1 * i)], 1e-4)
        found[f"p{i}", ANYTIME, "x"] = ([(1e-3, 25.0), (3e-2, 20.2 + 0.1 * i)], HORIZON)
    quality = quality_of(rows_of(found))
    (cells,) = total_rows("a", quality)
    assert cells[-1] == f"{len(BUDGETS)} of {len(BUDGETS)}"
    assert "30 ms alone (x), 0.1 ms with memory (m), ratio 300 [300, 300]" in headline("a", quality, HORIZON)


def test_a_ratio_is_paired_by_problem() -> None:
    below = np.random.default_rng(0).lognormal(0.0, 2.0, 200)
    for each in ratios(3.0 * below, below):
        assert (each.value, each.low, each.high) == pytest.approx((3.0, 3.0, 3.0))


def test_whoever_goes_on_begins_with_what_it_had_and_finds_plans_that_are_judged() -> None:
    source = problem_class("random")
    memory = memory_of(source.draw(91, index) for index in range(8))
    ways = list(methods(memory, CAR, 1))
    assert len({way.name for way in ways}) == len(ways)
    problem = source.draw(92, 0)
    for way in ways:
        found = way.attempt(problem, 0.02)
        assert list(found.seconds) == sorted(found.seconds)
        assert list(found.durations) == sorted(found.durations, reverse=True)
        if found.plan is not None:
            assert found.durations[-1] == pytest.approx(found.plan.duration_s)
            assert found.seconds[-1] <= found.spent
            assert faults(problem, found.plan) == []


def test_what_was_attempted_is_kept_and_not_attempted_again(tmp_path: Path) -> None:
    problems = [problem_class("random", "easy").draw(93, index) for index in range(3)]
    asked: list[str] = []

    def attempt(problem: Problem, seconds: float) -> Found:
        asked.append(problem.id)
        return Found((), (), seconds, None)

    def again(seconds: float) -> pd.DataFrame:
        return measured(
            *("random", problems, [Method(ALONE, "rrt", attempt)], CAR),
            seconds=seconds,
            seed=1,
            kept=tmp_path,
            inputs=[],
            console=Console(file=io.StringIO()),
        )

    first = again(0.1)
    attempts = len(asked)
    pd.testing.assert_frame_equal(again(0.1), first)
    assert len(asked) == attempts
    again(0.2)
    assert len(asked) == 2 * attempts


def test_each_way_to_plan_is_named_beside_its_line_and_no_name_lies_over_another() -> None:
    ways = [("GUST, alone", "alone", False), ("RRT, alone", "alone", False), ("GUST, memory", "memory", True)]
    moments = [0.1, 1.0, 10.0]
    rows = [
        {"method": name, "kind": kind, "memory": memory, "ms": ms, "over": 0.2 / ms}
        for name, kind, memory in ways
        for ms in moments
    ]
    figure = quality_curves(pd.DataFrame(rows), "A class", {"alone": "#888888", "memory": "#0072B2"})
    (axes,) = figure.axes
    assert len(axes.lines) == len(ways)
    assert {name for name, _, _ in ways} <= {text.get_text() for text in figure.findobj(Text)}
    heights = sorted(cast(Any, label).xyann[1] for label in axes.texts)
    assert min(after - before for before, after in pairwise(heights)) > 0.04
