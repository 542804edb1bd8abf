from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.memory.plans.free import Ends, free_plans, plan_fits
from planners.memory.plans.sweeps import coarse_to_fine, sweep_plans
from planners.world.geometry.collision import count_free_prefix, scene_of
from planners.world.problem import Plan
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR

SEEDS = st.integers(0, 2**32 - 1)


@pytest.fixture(scope="module")
def sweeps(experiences):
    return sweep_plans([e.plan for e in experiences])


def random_problem(experience, draw, seed):
    obstacles = draw(generator(seed, "labels"), 5)
    return dataclasses.replace(experience.problem, obstacles=obstacles)


@given(count=st.integers(0, 1000))
def test_coarse_to_fine_visits_every_state_once(count):
    assert sorted(coarse_to_fine(count)) == list(range(count))
    assert (coarse_to_fine(count) == coarse_to_fine.py_func(count)).all()


@given(seed=SEEDS)
def test_labels_equal_the_state_by_state_check(experiences, draw, sweeps, seed):
    scene = scene_of(random_problem(experiences[0], draw, seed))
    brute = [count_free_prefix(e.plan.states, CAR, scene) == len(e.plan.states) for e in experiences]
    assert free_plans(sweeps, scene).tolist() == brute


def test_both_verdicts_occur(experiences, draw, sweeps):
    labels = np.array(
        [free_plans(sweeps, scene_of(random_problem(experiences[0], draw, seed))) for seed in range(40)]
    )
    assert 0.1 < labels.mean() < 0.9


def test_jitted_labels_equal_interpreted_ones(experiences, draw, sweeps):
    for seed in range(3):
        scene = scene_of(random_problem(experiences[0], draw, seed))
        assert (free_plans(sweeps, scene) == free_plans.py_func(sweeps, scene)).all()


@given(seed=SEEDS)
def test_a_plan_that_begins_or_ends_elsewhere_answers_nothing(experiences, draw, sweeps, seed):
    problem = random_problem(experiences[0], draw, seed)
    scene = scene_of(problem)
    free = bool(free_plans(sweeps, scene)[0])
    x, y, heading = problem.start
    gx, gy = problem.goal
    ends = Ends(problem.start, problem.goal, 2.0)
    checked = plan_fits(sweeps, 0, ends, scene)
    assert checked[0] == free
    assert 0 < checked[1] <= len(experiences[0].plan.states)
    assert not free or checked[1] == len(experiences[0].plan.states)
    for start, goal in [
        ((x + 1e-6, y, heading), problem.goal),
        (problem.start, (gx + 2.001, gy)),
    ]:
        assert plan_fits(sweeps, 0, Ends(start, goal, 2.0), scene) == (False, 0)


@given(seed=SEEDS, turn=st.floats(-0.3, 0.3))
def test_a_turned_plan_is_checked_where_it_then_lies(experiences, draw, sweeps, seed, turn):
    problem = random_problem(experiences[0], draw, seed)
    scene = scene_of(problem)
    plan = experiences[0].plan
    states = plan.states.copy()
    cos, sin = math.cos(turn), math.sin(turn)
    states[:, :2] = (states[:, :2] - states[0, :2]) @ np.array([[cos, sin], [-sin, cos]]) + states[0, :2]
    states[:, 2] += turn
    turned = sweep_plans([Plan(states, plan.controls)])
    start = (problem.start[0], problem.start[1], problem.start[2] + turn)
    goal = (float(states[-1, 0]), float(states[-1, 1]))
    expected = bool(free_plans(turned, scene)[0])
    assert plan_fits(sweeps, 0, Ends(start, goal, 2.0), scene)[0] == expected


def test_no_plans_have_no_labels(experiences):
    assert free_plans(sweep_plans([]), scene_of(experiences[0].problem)).shape == (0,)
