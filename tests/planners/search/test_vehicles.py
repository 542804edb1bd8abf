"""Every planner for every vehicle; compiling takes time, so most of it is left to ``make test-slow``."""

from __future__ import annotations

import pytest

from planners.search.outcome import Status
from planners.search.registry import PLANNERS, plan
from planners.world.authority.authority import faults
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, VEHICLES, Vehicle, state_size
from tests.worlds import problem_of, walled_goal

BEST = "follow"
QUICK = [VEHICLES["differential-drive"], VEHICLES["car-1-trailer"]]
OTHERS = [vehicle for vehicle in VEHICLES.values() if vehicle != CAR]


def check(planner: str, vehicle: Vehicle, difficulty: str, count: int) -> None:
    for name in CLASSES:
        drawn = problem_class(name, difficulty, vehicle)
        for index in range(count):
            problem = drawn.draw(31, index)
            outcome = plan(planner, problem, generator(0, problem.id), vehicle=vehicle)
            assert outcome.status is Status.SOLVED
            assert outcome.plan is not None
            assert outcome.plan.states.shape[1] == state_size(vehicle)
            assert faults(problem, outcome.plan, vehicle) == []


@pytest.mark.parametrize("vehicle", QUICK, ids=["differential-drive", "car-1-trailer"])
def test_the_best_planner_solves_easy_problems_with_lawful_plans(vehicle: Vehicle) -> None:
    check(BEST, vehicle, "easy", 4)


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("vehicle", OTHERS, ids=list(VEHICLES)[1:])
@pytest.mark.parametrize("planner", ["gust", "follow"])
def test_guided_planners_solve_standard_problems_with_lawful_plans(planner: str, vehicle: Vehicle) -> None:
    check(planner, vehicle, "standard", 10)


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("vehicle", OTHERS, ids=list(VEHICLES)[1:])
@pytest.mark.parametrize("planner", PLANNERS)
def test_the_same_seed_gives_the_same_plan_and_what_cannot_be_solved_is_not(
    planner: str, vehicle: Vehicle
) -> None:
    problem = problem_class("random", "easy", vehicle).draw(31, 0)
    one, again = (plan(planner, problem, generator(0), vehicle=vehicle) for _ in range(2))
    assert one.plan is not None
    assert again.plan is not None
    assert one.plan.states.tobytes() == again.plan.states.tobytes()
    assert faults(problem, one.plan, vehicle) == []
    assert plan(planner, walled_goal(), generator(0), vehicle=vehicle).plan is None
    assert plan(planner, problem_of([]), generator(0), vehicle=vehicle).plan is not None
