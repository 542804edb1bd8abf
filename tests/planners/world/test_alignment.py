from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.world.alignment import SAME_ANGLE, Alignment, from_canonical, mirrored, scaled, to_canonical
from planners.world.arrays import Floats
from planners.world.authority.authority import faults
from planners.world.classes.problem_classes import problem_class
from planners.world.geometry.collision import box_is_free, scene_of
from planners.world.problem import (
    Arrival,
    Plan,
    Problem,
    is_canonical,
    obstacles_of,
    start_state,
)
from planners.world.vehicles.vehicle import CAR
from tests.planners.world.authority.test_authority import good_plan
from tests.planners.world.strategies import angles, seeds

places = st.floats(-500.0, 500.0)


def moved(points: Floats, turn: float, x: float, y: float) -> Floats:
    cos, sin = math.cos(turn), math.sin(turn)
    return points @ np.array([[cos, sin], [-sin, cos]]) + (x, y)


def elsewhere(problem: Problem, turn: float, x: float, y: float) -> Problem:
    """The same problem in another frame, with bounds wide enough to contain all of its own."""
    corners = np.array([[-7.0, -7.0], [57.0, -7.0], [57.0, 57.0], [-7.0, 57.0]])
    corners = moved(corners, turn, x, y)
    return replace(
        problem,
        start=(x, y, problem.start[2] + turn),
        goal=tuple(moved(np.array([problem.goal]), turn, x, y)[0].tolist()),
        bounds=(*corners.min(axis=0).tolist(), *corners.max(axis=0).tolist()),
        obstacles=obstacles_of([[moved(piece, turn, x, y)] for piece in problem.obstacles.pieces()]),
    )


@given(angles, seeds)
def test_a_mirrored_problem_has_the_mirrored_answer_and_mirrored_twice_is_itself(
    turn: float, seed: int
) -> None:
    drawn = problem_class("random").draw(seed, 0)
    start = (*drawn.start[:2], drawn.start[2] + turn)
    problem = replace(drawn, start=start, bounds=(-7.0, -6.0, 57.0, 58.0))
    other, back = mirrored(problem), mirrored(mirrored(problem))
    assert (back.start, back.goal, back.bounds) == (
        pytest.approx(problem.start),
        problem.goal,
        problem.bounds,
    )
    for piece, same, across in zip(
        *(each.obstacles.pieces() for each in (problem, back, other)), strict=True
    ):
        assert set(map(tuple, same)) == set(map(tuple, piece))
        assert set(map(tuple, across[:, ::-1])) == set(map(tuple, piece))


@given(angles, places, places, seeds)
def test_a_plan_goes_there_and_back(turn: float, x: float, y: float, seed: int) -> None:
    states = np.random.default_rng(seed).normal(scale=50.0, size=(20, 5))
    plan = Plan(states, np.zeros((19, 2)))
    there = from_canonical(plan, Alignment((x, y), turn))
    back = from_canonical(there, Alignment((0.0, 0.0), -turn))
    shift = from_canonical(
        Plan(np.array([[x, y, 0.0, 0.0, 0.0]]), plan.controls), Alignment((0.0, 0.0), -turn)
    )
    back.states[:, :2] -= shift.states[0, :2]
    assert np.abs(back.states - states).max() < 1e-9


@given(angles, places, places)
def test_start_and_goal_come_to_their_canonical_places(turn: float, x: float, y: float) -> None:
    canonical, _ = to_canonical(elsewhere(problem_class("trap").draw(0, 0), turn, x, y))
    assert canonical.start[:2] == (0.0, 0.0)
    off = math.remainder(canonical.start[2] - math.pi / 4, 2 * math.pi)
    assert off == pytest.approx(0.0, abs=2 * SAME_ANGLE)  # smaller turns are left out
    assert canonical.goal == pytest.approx((50.0, 50.0), abs=100 * SAME_ANGLE)


@given(angles, places, places)
def test_a_plan_for_the_canonical_problem_is_one_for_the_problem(turn: float, x: float, y: float) -> None:
    problem = elsewhere(replace(problem_class("trap").draw(0, 0), obstacles=obstacles_of([])), turn, x, y)
    canonical, alignment = to_canonical(problem)
    plan = good_plan()
    assert faults(canonical, plan) == []
    assert faults(problem, from_canonical(plan, alignment)) == []


@given(angles, places, places, seeds)
def test_alignment_changes_nothing_that_is_free(turn: float, x: float, y: float, seed: int) -> None:
    """A box in the own frame is as free as the same box in the canonical one, nearer than 1 mm aside."""
    problem = elsewhere(problem_class("random").draw(0, 1), turn, x, y)
    canonical, alignment = to_canonical(problem)
    own, aligned = scene_of(problem), scene_of(canonical)
    rng = np.random.default_rng(seed)
    x_min, y_min, x_max, y_max = problem.bounds
    states = np.zeros((200, 5))
    states[:, :3] = rng.uniform((x_min, y_min, -math.pi), (x_max, y_max, math.pi), (200, 3))
    cos, sin = math.cos(alignment.turn), math.sin(alignment.turn)
    for u, w, heading in states[:, :3]:
        du, dw = u - alignment.origin[0], w - alignment.origin[1]
        there = (cos * du - sin * dw, sin * du + cos * dw, heading + alignment.turn)
        for one, other, pose, image in (
            (own, aligned, (u, w, heading), there),
            (aligned, own, there, (u, w, heading)),
        ):
            roomy = box_is_free((*pose[:2], math.cos(pose[2]), math.sin(pose[2]), 1.001, 0.451), one)
            if roomy:
                assert box_is_free((*image[:2], math.cos(image[2]), math.sin(image[2]), 1.0, 0.45), other)


def test_a_canonical_problem_stays_as_it_is() -> None:
    problem = problem_class("curves").draw(0, 0)
    assert to_canonical(problem) == (problem, Alignment((0.0, 0.0), 0.0))


@given(seed=seeds, distance=st.floats(0.0, 200.0), towards=angles, heading=angles)
def test_a_question_of_any_distance_is_moved_and_asks_the_same(
    seed: int, distance: float, towards: float, heading: float
) -> None:
    goal = (distance * math.cos(towards), distance * math.sin(towards))
    arrival = Arrival(heading, 0.1, 0.0, 1.0)
    asked = replace(
        problem_class("random").draw(seed, 0),
        start=(0.0, 0.0, heading),
        goal=goal,
        start_motion=(1.5, 0.2),
        arrival=arrival,
    )
    moved, alignment = to_canonical(asked)
    assert moved.goal == pytest.approx((distance / math.sqrt(2.0),) * 2, abs=1e-9)
    assert moved.start_motion == asked.start_motion
    assert moved.arrival is not None
    turned = moved.arrival.heading - moved.start[2]  # type: ignore[operator]
    assert math.remainder(turned, math.tau) == pytest.approx(0.0, abs=1e-9)
    back = from_canonical(Plan(start_state(moved)[np.newaxis], np.empty((0, 2))), alignment)
    assert math.remainder(back.states[0, 2] - heading, math.tau) == pytest.approx(0.0, abs=1e-9)
    assert not is_canonical(moved)


def test_only_the_usual_question_is_canonical() -> None:
    problem = problem_class("curves").draw(0, 0)
    assert is_canonical(problem)
    assert is_canonical(replace(problem, start_motion=(0.0, 0.0), start=(0.0, 0.0, 1.0), goal=(51.0, 50.0)))
    for change in ({"start_motion": (1.0,)}, {"arrival": Arrival(0.1, 0.1)}, {"goal": (20.0, 20.0)}):
        assert not is_canonical(replace(problem, **change))


@given(scale=st.floats(0.05, 20.0))
def test_a_scaled_plan_is_driven_by_the_scaled_vehicle(scale: float) -> None:
    problem = replace(problem_class("trap").draw(0, 0), obstacles=obstacles_of([]))
    lengths = ("front", "rear", "width", "wheelbase", "min_speed", "max_speed", "max_acceleration")
    larger = CAR._replace(**{name: scale * getattr(CAR, name) for name in lengths})
    outside = replace(
        problem,
        goal=(scale * problem.goal[0], scale * problem.goal[1]),
        goal_radius=scale * problem.goal_radius,
        bounds=tuple(scale * bound for bound in problem.bounds),
    )
    plan = scaled(good_plan(), scale)
    assert faults(outside, plan, larger) == []
    assert plan.length_m == pytest.approx(scale * good_plan().length_m)
    assert plan.duration_s == good_plan().duration_s
    back = scaled(plan, 1.0 / scale)
    assert np.allclose(back.states, good_plan().states, rtol=1e-12)
    assert np.allclose(back.controls, good_plan().controls, rtol=1e-12)
