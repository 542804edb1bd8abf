"""Vehicles for which driving backwards or changing gear costs more: they do it less, and no plan is worse."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.maps.questions import question_in
from planners.optimisation.polish import polish_quickest
from planners.search.anytime import improve
from planners.search.manoeuvres.variants import slowed
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.families import family
from planners.world.classes.problem_classes import problem_class
from planners.world.driving_cost import cost_of, cusps_of, gears_of
from planners.world.geometry.collision import scene_of
from planners.world.problem import Arrival, Plan, Problem
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, DIFFERENTIAL_DRIVE, Costs, Vehicle
from planners.world.workspace import Workspace
from storage.vehicles.vehicle_files import read_vehicle
from tests.worlds import problem_of, strewn

HUNTER = read_vehicle(Path("docs/vehicles/hunter.yaml"))
DEAR_BACKWARDS = Costs(gear_change=0.0, forwards=1.0, backwards=3.0)


def costing(vehicle: Vehicle, gear_change: float, forwards: float, backwards: float) -> Vehicle:
    return vehicle._replace(costs=Costs(gear_change, forwards, backwards))


def driven(problem: Problem, vehicle: Vehicle) -> Plan:
    """The plan that is returned, judged."""
    plan = solve(problem, "lattice", seed=1, vehicle=vehicle).plan
    assert plan is not None
    assert faults(problem, plan, vehicle) == []
    return plan


def seconds_backwards(plan: Plan, vehicle: Vehicle) -> float:
    return float((gears_of(plan, vehicle) < 0).sum() * plan.dt)


@cache
def answer(vehicle: Vehicle, costs: Costs, number: int) -> Plan | None:
    """The plan for a question for a pose, from rest or in motion; None where there is no room for one."""
    world = problem_class("random", vehicle=vehicle).draw(44, number)
    asked = question_in(world, number, 44, vehicle, True)
    return None if asked is None else driven(to_canonical(asked)[0], vehicle._replace(costs=costs))


def answers(vehicle: Vehicle, costs: Costs, count: int) -> list[Plan]:
    return [plan for i in range(count) if (plan := answer(vehicle, costs, i)) is not None]


def test_who_pays_for_driving_backwards_drives_forwards_mostly() -> None:
    usual, forwards = (
        sum(seconds_backwards(plan, HUNTER) for plan in answers(HUNTER, costs, 8))
        for costs in (HUNTER.costs, DEAR_BACKWARDS)
    )
    assert 0.0 < forwards < 0.5 * usual


@pytest.mark.parametrize("vehicle", [HUNTER, DIFFERENTIAL_DRIVE, CAR_1_TRAILER])
def test_no_answer_costs_more_than_the_one_of_who_does_not_pay(vehicle: Vehicle) -> None:
    paying = vehicle._replace(costs=DEAR_BACKWARDS)
    pairs = zip(*(answers(vehicle, costs, 8) for costs in (vehicle.costs, DEAR_BACKWARDS)), strict=True)
    for pair in pairs:
        without, paid = (cost_of(plan, paying) for plan in pair)
        assert paid <= without


def test_a_robot_that_pays_for_driving_forwards_drives_backwards() -> None:
    problem = replace(
        problem_of([]), bounds=(-60.0, -60.0, 60.0, 60.0), start=(0.0, 0.0, 0.0), goal=(20.0, 20.0),
        goal_radius=0.3, arrival=Arrival(heading=0.0, heading_tolerance=0.1, least_speed=0.0, most_speed=0.0),
    )  # fmt: skip
    for sign, vehicle in ((1, costing(HUNTER, 0.0, 1.0, 5.0)), (-1, costing(HUNTER, 0.0, 5.0, 1.0))):
        gears = gears_of(driven(problem, vehicle), vehicle)
        assert (gears == sign).mean() > 0.5


def test_changes_of_gear_that_save_little_are_left_out() -> None:
    usual, fewer = (
        sum(len(cusps_of(plan, HUNTER)) for plan in answers(HUNTER, costs, 10))
        for costs in (HUNTER.costs, Costs(gear_change=5.0))
    )
    assert fewer < usual


def test_slots_are_solved_as_often_by_who_pays() -> None:
    """Where it is narrow the search goes its way by time, whatever a drive costs."""
    for name, vehicle in (("parallel", CAR), ("perpendicular", CAR)):
        for i in range(3):
            problem = to_canonical(family(name, "hard", vehicle).draw(45, i))[0]
            driven(problem, costing(vehicle, 3.0, 1.0, 3.0))


@given(forwards=st.floats(1.0, 10.0), backwards=st.floats(1.0, 10.0), speed=st.floats(-1.5, 1.5))
def test_who_is_slower_in_a_gear_takes_as_long_as_driving_in_it_costs(
    forwards: float, backwards: float, speed: float
) -> None:
    paying = costing(HUNTER, 0.5, forwards, backwards)
    slow = slowed(paying, speed)
    if slow == paying:
        return
    assert paying.min_speed <= slow.min_speed <= speed <= slow.max_speed <= paying.max_speed
    least = min(forwards, backwards)  # whoever is as dear in both gears need not be slower
    assert paying.max_speed / slow.max_speed == pytest.approx(forwards / least)
    assert paying.min_speed / slow.min_speed == pytest.approx(backwards / least)
    assert slow.costs == Costs(gear_change=pytest.approx(0.5 / least))
    problem = strewn(3, 5)
    plan = solve(problem, "lattice", vehicle=slow, polished=False).plan
    assert plan is not None
    assert faults(problem, plan, paying) == []


def test_who_cannot_stand_is_never_slower() -> None:
    plane = costing(HUNTER._replace(min_speed=0.5), 0.0, 3.0, 1.0)
    assert slowed(plane, 0.5) == plane


@given(seed=st.integers(0, 10**6))
@settings(max_examples=5, deadline=None)
def test_an_improvement_costs_less_and_less(seed: int) -> None:
    vehicle = costing(DIFFERENTIAL_DRIVE, 2.0, 1.0, 2.0)
    problem = strewn(seed, 20)
    result = improve("lattice", problem, expansions=2_000, seed=seed, vehicle=vehicle)
    costs = [each.cost_s for each in result.history]
    assert all(a > b for a, b in itertools.pairwise(costs))
    if result.plan is not None:
        assert costs[-1] == cost_of(result.plan, vehicle)
        assert result.history[-1].duration_s == result.plan.duration_s
        assert faults(problem, result.plan, vehicle) == []


def test_of_two_drives_the_one_that_costs_less_is_kept() -> None:
    """Backwards straight to a place or turned round: which is better is for costs to say."""
    problem = replace(
        problem_of([]), bounds=(-60.0, -60.0, 60.0, 60.0), start=(0.0, 0.0, 0.0), goal=(-8.0, 0.0),
        goal_radius=0.3, arrival=Arrival(least_speed=0.0, most_speed=0.0),
    )  # fmt: skip
    forwards, backwards = costing(HUNTER, 0.0, 1.0, 100.0), costing(HUNTER, 0.0, 100.0, 1.0)
    both = [driven(problem, each) for each in (forwards, backwards)]
    assert [seconds_backwards(plan, HUNTER) > 0.5 * plan.duration_s for plan in both] == [False, True]
    for number, vehicle in enumerate((forwards, backwards)):
        chosen, polished = polish_quickest(problem, both, vehicle, scene_of(problem), Workspace())
        assert chosen == number
        assert polished.plan is not None
        assert cost_of(polished.plan, vehicle) <= min(cost_of(plan, vehicle) for plan in both)
