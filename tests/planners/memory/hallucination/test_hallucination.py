from __future__ import annotations

import dataclasses
from functools import cache
from itertools import islice

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.memory.hallucination.learned_obstacles_training import LearnedTraining, train_learned
from planners.memory.hallucination.mixture import METHODS, hallucinate
from planners.memory.hallucination.no_plan import no_plan
from planners.memory.hallucination.placing import corridor_of, largest_stride, obstacle_meets
from planners.memory.hallucination.rearrange import Rearrange, _rearranged
from planners.memory.plans.experience import Experience
from planners.memory.plans.free import free_plans
from planners.memory.plans.sweeps import sweep_plans
from planners.world.geometry.collision import count_free_prefix, scene_of
from planners.world.problem import Plan, obstacles_of
from planners.world.randomness import generator
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR, CAR_2_TRAILERS
from tests.planners.memory.conftest import make_experiences

SEEDS = st.integers(0, 2**32 - 1)


@cache
def learned():
    return train_learned(make_experiences(8), 1, LearnedTraining(steps=20))


def first_problems(method, experience, draw, seed, count):
    made = hallucinate(experience, {method: 1.0}, draw, generator(seed), learned())
    return [problem for problem, _ in islice(made, count)]


@pytest.mark.parametrize("method", METHODS)
@given(seed=SEEDS, which=st.integers(0, 7))
@settings(max_examples=10)
def test_a_hallucinated_problem_is_solved_by_its_own_plan(experiences, draw, method, seed, which):
    experience = experiences[which]
    states = experience.plan.states
    for index, problem in enumerate(first_problems(method, experience, draw, seed, 2), start=1):
        assert count_free_prefix(states, CAR, scene_of(problem)) == len(states)
        assert problem.id == f"{experience.problem.id}~{method}-{index}"
        vertices = problem.obstacles.vertices
        assert (vertices == vertices.astype(np.float32)).all()


@pytest.mark.parametrize("method", METHODS)
@given(seed=SEEDS)
@settings(max_examples=10)
def test_the_same_generator_hallucinates_the_same_problems(experiences, draw, method, seed):
    first, second = (first_problems(method, experiences[0], draw, seed, 2) for _ in range(2))
    for one, other in zip(first, second, strict=True):
        for a, b in zip(one.obstacles, other.obstacles, strict=True):
            assert (a == b).all()


@given(seed=SEEDS, which=st.integers(0, 7))
@settings(max_examples=30)
def test_rearranging_keeps_the_near_obstacles_and_draws_the_far_ones_anew(experiences, draw, seed, which):
    experience = experiences[which]
    fresh = draw(generator(seed, "fresh"))
    obstacles = Rearrange(near_m=3.0).around(experience, generator(seed))(lambda _: fresh, generator(seed))
    origin = experience.problem.obstacles
    stride = largest_stride(experience.boxes)
    obstacle_count = len(origin.obstacle_starts) - 1
    near = [obstacle_meets(origin, o, experience.boxes, 3.0, stride) for o in range(obstacle_count)]
    kept, corners = sum(near), obstacles.obstacle_starts
    assert [int(n) for n in np.diff(corners)[:kept]] == [
        int(n) for n, is_near in zip(np.diff(origin.obstacle_starts), near, strict=True) if is_near
    ]
    fresh_vertices = {tuple(vertex) for vertex in fresh.vertices}
    far = obstacles.vertices[obstacles.piece_starts[corners[kept]] :]
    assert all(tuple(vertex) in fresh_vertices for vertex in far)


@given(seed=SEEDS, widened=st.floats(0.0, 4.0))
@settings(max_examples=30)
def test_skipping_boxes_changes_no_verdict(experiences, draw, seed, widened):
    obstacles = draw(generator(seed))
    boxes = experiences[seed % 8].boxes
    stride = largest_stride(boxes)
    for o in range(len(obstacles.obstacle_starts) - 1):
        every = obstacle_meets(obstacles, o, boxes, widened, np.inf)
        assert obstacle_meets(obstacles, o, boxes, widened, stride) == every


@given(seed=SEEDS, widened=st.floats(0.0, 2.0))
@settings(max_examples=30)
def test_neither_does_it_with_trailers_and_they_meet_more_than_the_car(experiences, draw, seed, widened):
    alone = experiences[seed % 8]
    start = np.append(alone.plan.states[0], [0.0, 0.0])
    pulled = Plan(simulate(start, alone.plan.controls, CAR_2_TRAILERS), alone.plan.controls)
    boxes = Experience(alone.problem, pulled, CAR_2_TRAILERS).boxes
    assert boxes.shape == (len(pulled.states), 3, 6)
    obstacles = draw(generator(seed))
    stride = largest_stride(boxes)
    for o in range(len(obstacles.obstacle_starts) - 1):
        every = obstacle_meets(obstacles, o, boxes, widened, np.inf)
        assert obstacle_meets(obstacles, o, boxes, widened, stride) == every
        assert every or not obstacle_meets(obstacles, o, alone.boxes, widened, np.inf)


def test_jitted_rearranging_equals_interpreted(experiences, draw):
    experience = experiences[0]
    fresh = draw(generator(5), 4)
    corridor = corridor_of(experience)
    corridor = corridor._replace(boxes=corridor.boxes[::8], stride_m=8.0 * corridor.stride_m)
    arguments = (experience.problem.obstacles, fresh, corridor, 3.0, 0.3, 0.05, 5)
    jitted = _rearranged(*arguments, generator(9))
    interpreted = _rearranged.py_func(*arguments, generator(9))
    for a, b in zip(jitted, interpreted, strict=True):
        np.testing.assert_array_equal(a, b)


@given(seed=SEEDS)
@settings(max_examples=30)
def test_a_no_plan_problem_is_solved_by_no_plan(experiences, draw, seed):
    plans = [e.plan for e in experiences]
    problem = no_plan(sweep_plans(plans), draw, generator(seed), "boxes", 7)
    scene = scene_of(problem)
    assert all(count_free_prefix(plan.states, CAR, scene) < len(plan.states) for plan in plans)
    assert problem.id == "boxes~no-plan-7"


def test_a_class_that_cannot_block_a_plan_is_reported(experiences):
    empty = obstacles_of([])
    with pytest.raises(RuntimeError, match="never blocked plans"):
        no_plan(sweep_plans([experiences[0].plan]), lambda _: empty, generator(0), "empty", 0)


def test_an_experience_that_its_plan_does_not_solve_is_refused(experiences, draw):
    wrong = dataclasses.replace(experiences[0].problem, goal=(20.0, -6.0))
    with pytest.raises(RuntimeError, match="is not solved by its own plan"):
        first_problems("rearrange", Experience(wrong, experiences[0].plan), draw, 0, 1)


def test_a_worlds_empty_draw_is_fine(experiences):
    (problem,) = first_problems("rearrange", experiences[0], lambda _: obstacles_of([]), 0, 1)
    assert free_plans(experiences[0].sweep, scene_of(problem))[0]
