"""A search for a pose joins the ends of stored plans, and says so."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.attempt import Attempt
from planners.memory.library.plan_library import PlanLibrary, gathered_library
from planners.search.query import Limits
from planners.search.registry import PLANNERS
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.families import family
from planners.world.problem import Arrival, Problem, obstacles_of
from planners.world.vehicles.vehicle import CAR
from planners.world.workspace import Workspace
from tests.planners.world.strategies import problem_with
from tests.worlds import box

SLOTS = range(6)


@pytest.fixture(scope="module")
def workspace() -> Workspace:
    """Buffers for all searches here."""
    return Workspace()


def slot(number: int) -> Problem:
    """A tight slot beside an aisle."""
    return to_canonical(family("parallel", "standard", CAR).draw(10, number))[0]


def alone(number: int, workspace: Workspace) -> Attempt:
    """The search without memory."""
    return solve(slot(number), "lattice", workspace=workspace, polished=False)


def library_of(numbers: range, workspace: Workspace) -> PlanLibrary:
    """The plans of some slots as they were searched."""
    attempts = [alone(number, workspace) for number in numbers]
    return gathered_library("parallel", CAR, [(a.problem_id, a.plan) for a in attempts if a.plan is not None])


def test_ends_of_stored_plans_are_joined_and_the_drive_is_right(workspace: Workspace) -> None:
    library = library_of(SLOTS, workspace)
    joined = [
        solve(slot(number), "lattice", "join", memory=library, workspace=workspace, polished=False)
        for number in SLOTS
    ]
    assert all(attempt.solved for attempt in joined)
    assert any(attempt.source == "repaired" for attempt in joined)
    for number, attempt in zip(SLOTS, joined, strict=True):
        assert attempt.plan is not None
        assert not faults(slot(number), attempt.plan, CAR)
    searched = sum(alone(number, workspace).expansions for number in SLOTS)
    assert sum(attempt.expansions for attempt in joined) < searched


@pytest.mark.parametrize("number", range(3))
def test_ends_that_do_not_help_cost_about_as_much_as_all_else(number: int, workspace: Workspace) -> None:
    """Aiming at them takes more looks at obstacles an expansion, which counts; a little is in advance."""
    asked = slot(number)
    left, low, right, high = asked.bounds
    x, y = left - 10.0, 0.5 * (low + high)
    walls = [box(x, y + side * 4.0, 0.0, 5.0, 0.2) for side in (-1.0, 1.0)]
    walls += [box(x + side * 4.0, y, 0.0, 0.2, 4.0) for side in (-1.0, 1.0)]
    shut_in = replace(
        asked,
        start=(x, y, 0.0),
        bounds=(x - 8.0, min(low, y - 8.0), right, max(high, y + 8.0)),
        obstacles=obstacles_of([[piece] for piece in [*asked.obstacles.pieces(), *walls]]),
    )
    question, library = to_canonical(shut_in)[0], library_of(SLOTS, workspace)
    without = solve(question, "lattice", workspace=workspace, polished=False)
    joining = solve(question, "lattice", "join", memory=library, workspace=workspace, polished=False)
    assert without.plan is joining.plan is None
    assert joining.collision_checks <= 2.5 * without.collision_checks


def test_what_is_only_recalled_joins_nothing(workspace: Workspace) -> None:
    library = library_of(range(2), workspace)
    closed = [
        solve(slot(number), "lattice", "closed", memory=library, workspace=workspace) for number in SLOTS
    ]
    assert all(attempt.source != "repaired" for attempt in closed)


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize("arrival", [Arrival(), Arrival(heading=0.5, heading_tolerance=0.1)])
def test_who_stands_at_the_goal_stays_there(planner: str, arrival: Arrival, workspace: Workspace) -> None:
    there = replace(problem_with(obstacles_of([])), start=(1.0, 1.0, 0.5), goal=(1.03, 1.0), arrival=arrival)
    attempt = solve(to_canonical(there)[0], planner, workspace=workspace)
    assert attempt.duration_s == 0.0


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 2000))
def test_all_searches_for_a_pose_keep_its_limit_together(
    workspace: Workspace, number: int, expansions: int
) -> None:
    attempt = solve(slot(number), "lattice", limits=Limits(expansions=expansions), workspace=workspace)
    assert attempt.expansions <= expansions


@pytest.mark.parametrize("number", SLOTS)
def test_a_plan_to_a_pose_drives_no_longer_than_the_first_found_and_is_right(
    number: int, workspace: Workspace
) -> None:
    found = alone(number, workspace)
    polished = solve(slot(number), "lattice", workspace=workspace)
    assert found.plan is not None
    assert polished.plan is not None
    assert polished.plan.duration_s <= found.plan.duration_s
    assert polished.expansions >= found.expansions
    assert not faults(slot(number), polished.plan, CAR)
