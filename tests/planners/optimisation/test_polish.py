"""A polished plan is a plan, no slower than before, and as quick as what IPOPT finds."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from planners.optimisation.optimise import optimise
from planners.optimisation.polish import Polished, polish
from planners.search.registry import plan
from planners.world.authority.authority import faults
from planners.world.geometry.collision import blocked_states, count_free_prefix, scene_of
from planners.world.problem import Plan, Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, VEHICLES, Vehicle
from planners.world.workspace import Workspace
from tests.worlds import box, problem_of, strewn, walled_goal

WORKSPACE = Workspace()


def polished(problem: Problem, found: Plan, vehicle: Vehicle = CAR, iterations: int = 60) -> Polished:
    return polish(problem, found, vehicle, scene_of(problem), WORKSPACE, iterations)


def searched(problem: Problem, vehicle: Vehicle = CAR) -> Plan:
    found = plan("gust", problem, generator(3), vehicle=vehicle).plan
    assert found is not None
    return found


def assert_is_a_plan(problem: Problem, answer: Plan | None, vehicle: Vehicle = CAR) -> Plan:
    assert answer is not None
    assert faults(problem, answer, vehicle) == []
    assert count_free_prefix(answer.states, vehicle, scene_of(problem)) == len(answer.states)
    return answer


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
def test_a_polished_plan_is_a_plan_and_takes_less_time(vehicle: Vehicle) -> None:
    for seed in (2, 3, 4):
        problem = strewn(seed, 30)
        found = searched(problem, vehicle)
        better = assert_is_a_plan(problem, polished(problem, found, vehicle).plan, vehicle)
        assert better.duration_s < found.duration_s


def test_no_number_of_iterations_makes_a_plan_slower() -> None:
    problem = strewn(5, 40)
    found = searched(problem)
    spent = [polished(problem, found, iterations=most) for most in (0, 1, 4, 60)]
    durations = [assert_is_a_plan(problem, each.plan).duration_s for each in spent]
    assert durations == sorted(durations, reverse=True)
    assert durations[0] == found.duration_s
    assert all(each.iterations <= most for each, most in zip(spent, (0, 1, 4, 60), strict=True))


def test_the_same_plan_gives_the_same_result_in_any_workspace() -> None:
    problem = strewn(6, 40)
    found = searched(problem)
    first = assert_is_a_plan(problem, polished(problem, found).plan)
    again = polish(problem, found, CAR, scene_of(problem), Workspace()).plan
    assert again is not None
    np.testing.assert_array_equal(first.states, again.states)
    np.testing.assert_array_equal(first.controls, again.controls)


def test_a_polished_plan_stays_nearly_as_it_is() -> None:
    problem = strewn(7, 40)
    once = assert_is_a_plan(problem, polished(problem, searched(problem)).plan)
    twice = assert_is_a_plan(problem, polished(problem, once).plan)
    assert 0.0 <= once.duration_s - twice.duration_s <= 0.2 + 1e-9


def test_where_nothing_is_in_the_way_no_time_is_lost() -> None:
    problem = problem_of([])
    best = assert_is_a_plan(problem, polished(problem, searched(problem)).plan)
    way = math.hypot(*problem.goal) - problem.goal_radius  # 2 s of acceleration, the rest at 4 m/s
    assert best.duration_s == pytest.approx(2.0 + (way - 4.0) / 4.0, abs=0.11)


def test_a_plan_that_is_blocked_a_little_is_freed() -> None:
    problem = strewn(2, 25)
    found = assert_is_a_plan(problem, polished(problem, searched(problem)).plan)
    x, y = found.states[len(found.states) // 2, :2]
    blocked = problem_of([*problem.obstacles.pieces(), box(x, y, 0.3, 0.4, 0.4)])
    assert blocked_states(found.states, CAR, scene_of(blocked)).sum() > 0
    assert_is_a_plan(blocked, polished(blocked, found).plan)


def test_what_cannot_be_freed_gives_no_plan() -> None:
    found = searched(problem_of([]))
    walled = polished(walled_goal(), found, iterations=20)
    assert walled.plan is None
    assert walled.iterations <= 20


def test_a_start_in_the_goal_stays_as_it_is() -> None:
    problem = replace(problem_of([]), goal=(1.0, 0.0))
    rest = Plan(np.array([[*problem.start, 0.0, 0.0]]), np.empty((0, 2)))
    assert polished(problem, rest) == (rest, 0)


def test_a_margin_keeps_away_from_obstacles() -> None:
    problem = strewn(4, 30)
    found, scene = searched(problem), scene_of(problem)
    close, wide = (polish(problem, found, CAR, scene, WORKSPACE, margin_m=each).plan for each in (0.0, 0.5))
    assert assert_is_a_plan(problem, close).duration_s <= assert_is_a_plan(problem, wide).duration_s


def test_it_is_as_quick_as_what_ipopt_finds() -> None:
    ours, theirs = [], []
    for seed in (12, 13):
        problem = replace(strewn(seed, 20), goal=(22.0, 22.0))
        found = searched(problem)
        exact = optimise(problem, found).plan
        if exact is not None:
            theirs.append(exact.duration_s)
            ours.append(assert_is_a_plan(problem, polished(problem, found).plan).duration_s)
    assert len(theirs) > 0
    assert np.mean(ours) <= 1.01 * np.mean(theirs)
