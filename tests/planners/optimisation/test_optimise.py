"""What an optimisation returns is a plan, and a better one than it began with."""

from __future__ import annotations

import functools
import math
from dataclasses import replace

import numpy as np
import pytest

from planners.optimisation.clearance_field import least_clearance
from planners.optimisation.guesses import resampled, straight_line
from planners.optimisation.optimise import DEFAULT_SETTINGS, Ending, Optimised, optimise, refined
from planners.optimisation.transcription import CostWeights
from planners.search.registry import plan
from planners.world.authority.authority import faults
from planners.world.geometry.collision import blocked_states, count_free_prefix, scene_of
from planners.world.problem import Arrival, Plan, Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, DIFFERENTIAL_DRIVE, VEHICLES, Vehicle
from tests.worlds import box, problem_of

NEAR = (12.0, 12.0)  # a goal so near that an optimisation takes a fraction of a second


def near(problem: Problem) -> Problem:
    return replace(problem, goal=NEAR)


@functools.cache
def world() -> Problem:
    return near(problem_of([box(7.0, 5.0, 0.3, 1.0, 0.6), box(2.0, 9.0, 1.0, 1.0, 1.5)], "near"))


@functools.cache
def searched() -> Plan:
    found = plan("rrt", world(), generator(3)).plan
    assert found is not None
    return found


@functools.cache
def from_search() -> Optimised:
    return optimise(world(), searched())


def assert_is_a_plan(problem: Problem, answer: Plan) -> None:
    assert faults(problem, answer) == []
    assert count_free_prefix(answer.states, CAR, scene_of(problem)) == len(answer.states)


def test_an_optimised_plan_is_a_plan_and_takes_less_time() -> None:
    found = from_search()
    assert found.status is Ending.CONVERGED
    assert found.plan is not None
    assert_is_a_plan(world(), found.plan)
    assert found.plan.duration_s < searched().duration_s
    assert 0.0 < found.field_seconds < found.seconds


def test_the_same_guess_gives_the_same_plan() -> None:
    again = optimise(world(), searched()).plan
    first = from_search().plan
    assert again is not None
    assert first is not None
    np.testing.assert_array_equal(again.states, first.states)
    np.testing.assert_array_equal(again.controls, first.controls)


def test_a_blocked_plan_comes_out_free() -> None:
    best = from_search().plan
    assert best is not None
    x, y = best.states[len(best.states) // 2, :2]
    blocked = near(problem_of([*world().obstacles.pieces(), box(x, y, 0.0, 0.4, 0.4)]))
    assert blocked_states(best.states, CAR, scene_of(blocked)).sum() > 0
    found = optimise(blocked, best)
    assert found.plan is not None
    assert_is_a_plan(blocked, found.plan)


def test_a_straight_line_through_nothing_is_driven_in_the_least_time() -> None:
    problem = near(problem_of([]))
    found = optimise(problem, straight_line(problem))
    assert found.plan is not None
    assert_is_a_plan(problem, found.plan)
    way = np.hypot(*NEAR) - problem.goal_radius  # 2 s of acceleration, the rest at 4 m/s
    assert found.plan.duration_s == pytest.approx(2.0 + (way - 4.0) / 4.0, abs=0.15)


@pytest.mark.parametrize("vehicle", [vehicle for vehicle in VEHICLES.values() if vehicle != CAR])
def test_every_vehicle_is_driven_around_an_obstacle(vehicle: Vehicle) -> None:
    problem = replace(problem_of([box(6.3, 5.7, 0.8, 0.6, 0.6)]), goal=NEAR)
    found = optimise(problem, straight_line(problem, vehicle), vehicle=vehicle)
    assert found.plan is not None
    assert faults(problem, found.plan, vehicle) == []


def test_improving_never_makes_a_plan_worse() -> None:
    best = from_search().plan
    assert best is not None
    improved = refined(world(), searched())
    assert improved.duration_s == best.duration_s
    assert refined(world(), improved).duration_s <= improved.duration_s
    few = DEFAULT_SETTINGS._replace(iterations=1)
    assert refined(world(), searched(), few) is searched()


def test_a_weight_on_clearance_keeps_away_from_obstacles() -> None:
    shy = DEFAULT_SETTINGS._replace(weights=CostWeights(clearance_weight=1.0, wanted_clearance_m=1.0))
    fast, clear = from_search().plan, optimise(world(), searched(), shy).plan
    assert fast is not None
    assert clear is not None
    assert_is_a_plan(world(), clear)
    assert least_clearance(world(), clear.states, CAR) > least_clearance(world(), fast.states, CAR)


def test_what_cannot_be_reached_does_not_converge() -> None:
    problem = near(problem_of([box(*NEAR, 0.0, 3.0, 3.0)]))  # over the goal disc and some more
    found = optimise(problem, straight_line(problem), DEFAULT_SETTINGS._replace(iterations=30))
    assert found.plan is None
    assert not found.converged
    assert found.status in (Ending.INFEASIBLE, Ending.ITERATIONS_SPENT)
    assert found.iterations <= 30


def test_a_blocked_start_and_a_start_in_the_goal_need_no_iterations() -> None:
    onto = problem_of([box(0.5, 0.5, 0.0, 0.3, 0.3)])
    assert optimise(onto, searched()).status is Ending.START_BLOCKED
    there = replace(problem_of([]), goal=(1.0, 0.0))
    found = optimise(there, searched())
    assert found.plan is not None
    assert (found.iterations, len(found.plan.states)) == (0, 1)
    assert faults(there, found.plan) == []


@pytest.mark.parametrize(
    ("guess", "says"),
    [
        (Plan(np.zeros((3, 4)), np.zeros((2, 2))), r"expected \[T, 5\] \(x, y, heading"),
        (Plan(np.zeros((3, 5)), np.zeros((3, 2))), r"controls \[3, 2\]"),
        (Plan(np.zeros((1, 5)), np.zeros((0, 2))), "at least one step"),
        (Plan(np.full((2, 5), np.nan), np.zeros((1, 2))), "finite numbers"),
        (Plan(np.zeros((2, 5)), np.zeros((1, 2)), 0.0), "step of 0.0 s"),
    ],
)
def test_a_guess_that_is_none_is_refused_in_one_line(guess: Plan, says: str) -> None:
    with pytest.raises(ValueError, match=says) as error:
        optimise(world(), guess)
    assert "\n" not in str(error.value)


def test_a_differential_drives_guess_is_taken_for_its_own() -> None:
    with pytest.raises(ValueError, match="6"):
        optimise(world(), Plan(np.zeros((3, 6)), np.zeros((2, 2))), vehicle=DIFFERENTIAL_DRIVE)


def test_settings_without_sense_are_refused() -> None:
    with pytest.raises(ValueError, match="0 iterations"):
        optimise(world(), searched(), DEFAULT_SETTINGS._replace(iterations=0))


def test_resampling_keeps_ends_and_duration() -> None:
    again = resampled(searched(), 17)
    assert again.states.shape == (18, 5)
    assert again.duration_s == pytest.approx(searched().duration_s)
    np.testing.assert_allclose(again.states[[0, -1]], searched().states[[0, -1]])


@pytest.mark.parametrize("tolerance", [0.1, 6.3, math.inf])
def test_any_tolerance_of_the_heading_is_optimised_for(tolerance: float) -> None:
    problem = replace(near(problem_of([])), arrival=Arrival(0.8, tolerance))
    found = optimise(problem, straight_line(problem))
    assert found.plan is not None
    assert_is_a_plan(problem, found.plan)


def test_the_straight_line_to_where_the_vehicle_is_has_a_step() -> None:
    problem = replace(problem_of([]), goal=(0.0, 0.0), goal_radius=0.1, arrival=Arrival(2.0, 0.05))
    assert len(straight_line(problem).controls) == 1
    optimise(problem, straight_line(problem), DEFAULT_SETTINGS._replace(iterations=5))
