"""Routes: one plan that holds in every way, made of legs that a memory may know."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest

from planners.maps.cutting import cut_problems
from planners.maps.global_path import GlobalPaths
from planners.maps.occupancy_map import OccupancyMap
from planners.maps.surroundings import surroundings_of
from planners.memory.memory import Memory
from planners.routes.path_ahead import PathAhead
from planners.routes.route import Route, Router, Stuck
from planners.solve import Attempt, solve
from planners.world.authority.authority import faults
from planners.world.problem import GOAL_RADIUS, Problem
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, DIFFERENTIAL_DRIVE, Vehicle
from tests.planners.maps.samples import town
from tests.planners.memories import memory_of

START = (12.0, 150.0, 2.0)
GOALS = [(250.0, 262.0), (285.0, 40.0)]


def searched(problem: Problem, vehicle: Vehicle = CAR) -> Attempt:
    return solve(problem, "gust", "fresh", vehicle=vehicle)


@pytest.fixture(scope="module")
def memory() -> Memory:
    world = town()
    return memory_of([cut.problem for cut in cut_problems(world, surroundings_of(world), "train", 40, 1)])


def check(found: Route | Stuck, vehicle: Vehicle = CAR) -> Route:
    assert isinstance(found, Route)
    plan = found.plan(vehicle)
    assert faults(found.problem, plan, vehicle) == []
    for one, other in pairwise(found.legs):
        np.testing.assert_allclose(one.end, other.begin)
    at = 0
    for leg in found.legs:
        np.testing.assert_allclose(leg.states(vehicle), plan.states[at : at + len(leg.controls) + 1])
        at += len(leg.controls)
        assert np.abs(plan.states[at, 3:5]).max() < 1e-9  # it rests where the next leg begins
    assert at == len(plan.controls)
    return found


def test_a_route_is_one_feasible_plan_through_all_goals(memory: Memory) -> None:
    router = Router(town(), lambda problem: solve(problem, "gust", "repair", 5, memory), searched)
    found = check(router.route(START, GOALS))
    ends = np.array([leg.end[:2] for leg in found.legs])
    for goal in GOALS:
        assert np.hypot(*(ends - goal).T).min() <= GOAL_RADIUS
    assert math.dist(ends[-1], GOALS[-1]) <= GOAL_RADIUS
    length = found.plan(CAR).length_m
    shortest = sum(float(np.hypot(*np.diff(path, axis=0).T).sum()) for path in found.paths)
    assert shortest > 450.0
    assert length < 2.0 * shortest
    known = [leg for leg in found.legs if leg.source in ("recalled", "repaired")]
    assert len(known) >= len(found.legs) / 2
    for leg in known:  # what was driven is a stored plan, as it is stored
        if leg.source == "recalled":
            driven = leg.controls[leg.turning : leg.turning + leg.driving]
            assert any(np.array_equal(driven, plan.controls[: leg.driving]) for plan in memory.plans)


def test_the_same_question_has_the_same_answer(memory: Memory) -> None:
    router = Router(town(), lambda problem: solve(problem, "rrt", "open", 5, memory), searched)
    one, other = (check(router.route(START, GOALS[:1])).plan(CAR) for _ in range(2))
    np.testing.assert_array_equal(one.states, other.states)


@pytest.mark.parametrize("vehicle", [DIFFERENTIAL_DRIVE, CAR_1_TRAILER])
def test_other_vehicles_find_routes_too(vehicle: Vehicle) -> None:
    solver = partial(searched, vehicle=vehicle)
    router = Router(town(), solver, solver, vehicle)
    check(router.route(START, GOALS[:1]), vehicle)


def test_a_goal_that_is_near_needs_no_memory() -> None:
    def never(problem: Problem) -> Attempt:
        raise AssertionError(f"{problem.id} is no canonical problem")

    found = check(Router(town(), never, searched).route(START, [(30.0, 160.0)]))
    assert [leg.source for leg in found.legs] == ["searched"]


def test_who_is_there_already_drives_nowhere() -> None:
    found = check(Router(town(), searched, searched).route(START, [(START[0] + 1.0, START[1])]))
    assert found.legs == []


def test_occupied_and_unreachable_places_are_said() -> None:
    world = town()
    walled = replace(world, occupied=world.occupied.copy())
    walled.occupied[:, 150] = True
    row, column = np.argwhere(world.occupied)[0].tolist()
    inside = (column + 0.5, row + 0.5)
    for asked, start, goal, why in (
        (world, (*inside, 0.0), GOALS[0], "the vehicle stands in an obstacle"),
        (world, START, inside, "the goal is occupied"),
        (world, (-5.0, 3.0, 0.0), GOALS[0], "out of the map"),
        (world, START, (400.0, 3.0), "out of the map"),
        (walled, START, GOALS[0], "no path over the map"),
    ):
        found = Router(asked, searched, searched).route(start, [goal])
        assert isinstance(found, Stuck)
        assert why in found.why
        assert found.attempts == 0


def test_where_no_local_problem_is_solved_the_route_ends_with_a_place() -> None:
    def fails(problem: Problem) -> Attempt:
        return replace(searched(problem), plan=None, solved=False)

    found = Router(town(), fails, fails).route(START, GOALS[:1])
    assert isinstance(found, Stuck)
    assert found.place == START[:2]
    assert found.attempts > 0


def test_the_way_to_go_is_that_of_the_shortest_path() -> None:
    world = OccupancyMap("wall", np.zeros((100, 100), bool), 1.0)
    world.occupied[:90, 50] = True
    ahead = PathAhead(GlobalPaths(world, 1.0), (80.5, 10.5))
    poses = np.array([[20.5, 10.5, 0.0], [80.5, 40.5, 0.0], [80.0, 11.0, 0.0]])
    path = ahead.path(poses[0])
    assert path is not None
    assert ahead.to_go(poses)[0] == pytest.approx(np.hypot(*np.diff(path, axis=0).T).sum(), abs=2.0)
    assert ahead.to_go(poses)[1] == pytest.approx(30.0, abs=2.0)
    assert ahead.arrived(poses).tolist() == [False, False, True]
