"""Questions for goal poses: every planner answers them, exactly."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planners.maps.questions import question_in
from planners.search.query import Limits
from planners.search.registry import PLANNERS, plan
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.problem_classes import problem_class
from planners.world.geometry.collision import count_free_prefix, scene_of
from planners.world.problem import Arrival, Problem, start_state
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR
from storage.vehicles.vehicle_files import read_vehicle
from tests.worlds import strewn


def question(number: int, metres: float = 30.0) -> Problem:
    """A pose among obstacles, asked of a moving vehicle."""
    rng = np.random.default_rng(number)
    bearing, heading, start = rng.uniform(-np.pi, np.pi, 3)
    goal = (25.0 + metres * np.cos(bearing) / 2.0, 25.0 + metres * np.sin(bearing) / 2.0)
    begin = (25.0 - metres * np.cos(bearing) / 2.0, 25.0 - metres * np.sin(bearing) / 2.0, start)
    motion = (1.0, 0.1)
    return replace(
        strewn(number, 25),
        start=begin,
        goal=goal,
        goal_radius=0.1,
        start_motion=motion,
        arrival=Arrival(heading, 0.05, 0.0, 0.0),
    )


def has_free_ends(problem: Problem) -> bool:
    assert problem.arrival is not None
    ends = np.array([[*problem.goal, problem.arrival.heading, 0.0, 0.0], start_state(problem)])
    return int(count_free_prefix(ends, CAR, scene_of(problem))) == 2


@pytest.mark.parametrize("planner", PLANNERS)
def test_planners_arrive_at_poses_exactly(planner: str) -> None:
    problems = [problem for problem in map(question, range(16)) if has_free_ends(problem)]
    assert len(problems) >= 8
    for problem in problems:
        found = plan(planner, problem, generator(0), limits=Limits(expansions=4000)).plan
        assert found is not None
        assert faults(problem, found) == []


def test_a_better_plan_than_a_given_one_still_arrives() -> None:
    problem = question(3)
    first = plan("lattice", problem, generator(0)).plan
    assert first is not None
    limits = Limits(bound_s=0.95 * first.duration_s)
    better = plan("lattice", problem, generator(1), limits=limits).plan
    assert better is None or (better.duration_s < limits.bound_s and faults(problem, better) == [])


def test_a_train_is_given_the_time_that_its_poses_take() -> None:
    """The lorry backs into this one after more expansions than a place is worth."""
    lorry = read_vehicle(Path("docs/vehicles/semitrailer.yaml"))
    world = problem_class("curves", vehicle=lorry).draw(8, 39)
    question = question_in(world, 39, 8, lorry, pose=True)
    assert question is not None
    asked, _ = to_canonical(question)
    assert solve(asked, "lattice", seed=1, limits=Limits(), vehicle=lorry, polished=False).plan is None
    found = solve(asked, "lattice", seed=1, vehicle=lorry, polished=False).plan
    assert found is not None
    assert faults(asked, found, lorry) == []
