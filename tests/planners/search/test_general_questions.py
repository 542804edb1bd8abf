"""Questions from any motion, to places and poses at any distance: what planners answer is what is asked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.maps.questions import question_in
from planners.memory.memory import Memory
from planners.search.query import Limits
from planners.search.registry import PLANNERS
from planners.solve import solve
from planners.world.alignment import from_canonical, to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.problem import Arrival, Problem, obstacles_of, start_state
from planners.world.vehicles.vehicle import CAR, VEHICLES, Vehicle
from tests.planners.memories import memory_of
from tests.planners.world.strategies import seeds

LIMITS = Limits(expansions=600)


def drawn(seed: int, vehicle: Vehicle = CAR, pose: bool = False) -> Problem | None:
    world = problem_class(CLASSES[seed % len(CLASSES)], vehicle=vehicle).draw(seed, 0)
    return question_in(world, 0, seed, vehicle, pose)


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize("name", VEHICLES)
@settings(max_examples=6)
@given(seed=seeds)
def test_what_is_found_is_what_was_asked(name: str, planner: str, seed: int) -> None:
    vehicle = VEHICLES[name]
    asked = drawn(seed, vehicle)
    if asked is None:
        return
    canonical, alignment = to_canonical(asked)
    attempt = solve(canonical, planner, seed=seed, limits=LIMITS, vehicle=vehicle)
    if attempt.plan is not None:
        assert faults(canonical, attempt.plan, vehicle) == []
        back = from_canonical(attempt.plan, alignment).states
        assert np.allclose(back[0], start_state(asked, vehicle), atol=1e-9)


@pytest.mark.parametrize("planner", PLANNERS)
@settings(max_examples=6)
@given(seed=seeds, heading=st.floats(-3.0, 3.0), most=st.floats(0.0, 4.0))
def test_an_arrival_is_kept_by_every_planner(planner: str, seed: int, heading: float, most: float) -> None:
    asked = drawn(seed)
    assert asked is not None
    arrival = Arrival(heading, 1.0, 0.0, most)
    canonical, _ = to_canonical(replace(asked, arrival=arrival))
    attempt = solve(canonical, planner, seed=seed, limits=LIMITS)
    assert attempt.plan is None or faults(canonical, attempt.plan) == []


def test_the_lattice_answers_nearly_all_of_them() -> None:
    questions = [asked for seed in range(30) if (asked := drawn(seed)) is not None]
    solved = [solve(to_canonical(asked)[0], "lattice").solved for asked in questions]
    assert np.mean(solved) >= 0.9  # some cannot be answered


def test_it_stops_where_it_is_to_stop() -> None:
    empty = replace(problem_class("random").draw(0, 0), obstacles=obstacles_of([]))
    for speed in (-1.0, 0.0, 4.0):
        for goal in ((3.0, 3.0), (0.0, 10.0), (30.0, 30.0)):
            asked = replace(
                empty, start_motion=(speed,), goal=goal, goal_radius=1.0, arrival=Arrival(most_speed=0.5)
            )
            attempt = solve(to_canonical(asked)[0], "lattice")
            assert attempt.plan is not None
            assert abs(attempt.plan.states[-1, 3]) <= 1.0


@pytest.fixture(scope="module")
def memory() -> Memory:
    return memory_of(problem_class("random").draw(5, index) for index in range(4))


@pytest.mark.parametrize("assist", ["closed", "open", "repair", "random-repair", "published-open"])
def test_a_memory_of_canonical_plans_is_no_harm_to_other_questions(memory: Memory, assist: str) -> None:
    for seed in range(3):
        asked = drawn(3 * seed + 1)
        assert asked is not None
        canonical, _ = to_canonical(asked)
        alone = solve(canonical, "lattice")
        helped = solve(canonical, "lattice", assist, 3, memory)
        assert helped.recalled == ()
        assert helped.solved >= alone.solved
        assert helped.plan is None or faults(canonical, helped.plan) == []
