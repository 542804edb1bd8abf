"""What is said to have no drive has none."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.maps.questions import question_in
from planners.search.outcome import Status
from planners.search.query import Limits
from planners.search.registry import PLANNERS, plan
from planners.search.structures.unreachable import is_unreachable
from planners.world.alignment import to_canonical
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.geometry.collision import scene_of
from planners.world.problem import Arrival, Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, VEHICLES, Vehicle
from planners.world.workspace import Workspace
from tests.planners.world.strategies import seeds
from tests.worlds import box, problem_of, walled_goal

WORKSPACE = Workspace()


def unreachable(problem: Problem, vehicle: Vehicle = CAR) -> bool:
    return is_unreachable(problem, scene_of(problem), vehicle, WORKSPACE)


def with_gap(gap: float, thickness: float = 0.5) -> Problem:
    """A wall across the whole window, with one gap."""
    side = 60.0 - 0.5 * gap
    walls = [
        box(25.0, 25.0 + sign * 0.5 * (side + gap), 0.0, 0.5 * thickness, 0.5 * side) for sign in (-1, 1)
    ]
    return problem_of(walls, f"gap-{gap}")


@pytest.mark.parametrize("planner", PLANNERS)
def test_a_planner_ends_early_where_no_drive_can_be(planner: str) -> None:
    outcome = plan(planner, walled_goal(), generator(1), limits=Limits(expansions=20_000))
    assert outcome.status is Status.INFEASIBLE
    assert outcome.expansions <= 2_500


@pytest.mark.parametrize("name", VEHICLES)
@given(gap=st.floats(0.0, 4.0), thickness=st.floats(0.1, 3.0))
def test_a_gap_is_closed_only_if_the_vehicle_is_wider(name: str, gap: float, thickness: float) -> None:
    if unreachable(with_gap(gap, thickness), VEHICLES[name]):
        assert gap < 0.9
    else:
        assert gap > 0.2


@pytest.mark.parametrize("name", VEHICLES)
def test_who_has_to_turn_at_the_start_is_not_said_to_have_no_drive(name: str) -> None:
    x, y, _ = problem_of([]).start
    bounds = (x - 8.0, y - 8.0, x + 8.0, y + 8.0)
    for heading in (0.5, 3.1):
        there = replace(problem_of([]), goal=(x, y), goal_radius=0.02, bounds=bounds)
        turned = replace(there, arrival=Arrival(there.start[2] + heading, 0.02, 0.0, 0.0))
        assert not unreachable(turned, VEHICLES[name])


@settings(max_examples=15)
@given(seed=seeds)
def test_what_is_solved_is_not_said_to_have_no_drive(seed: int) -> None:
    world = problem_class(CLASSES[seed % 3], "hard").draw(seed, 0)
    asked = question_in(world, 0, seed)
    assert asked is not None
    for problem in (world, to_canonical(asked)[0]):
        outcome = plan("lattice", problem, generator(seed), limits=Limits(expansions=2_000))
        assert not (outcome.plan is not None and unreachable(problem))


def test_what_lies_beyond_the_window_is_open() -> None:
    closed = with_gap(0.0)
    assert unreachable(closed)
    around = replace(closed, bounds=(-100.0, -100.0, 100.0, 100.0))
    assert not unreachable(around)
