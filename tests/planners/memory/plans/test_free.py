from __future__ import annotations

import dataclasses

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from planners.memory.plans.cell_masks import masks_of
from planners.memory.plans.free import ends_of, first_fitting, first_fitting_drawn, plan_fits
from planners.memory.plans.sweeps import sweep_plans
from planners.world.geometry.collision import scene_of
from planners.world.geometry.occupancy import drawing_of
from planners.world.problem import BOUNDS, CANONICAL_GOAL, CANONICAL_START
from planners.world.randomness import generator

SEEDS = st.integers(0, 2**32 - 1)


def answers(experiences, problem):
    """Which of the experiences' plans answer a problem: from the drawing, and from the scene."""
    sweeps = sweep_plans([each.plan for each in experiences])
    window = dataclasses.replace(problem, start=CANONICAL_START, goal=CANONICAL_GOAL)  # that of the masks
    masks, drawing, scene = masks_of(sweeps), drawing_of(window), scene_of(problem)
    ends = ends_of(problem)
    one_by_one = [np.array([i], np.int32) for i in range(len(experiences))]
    drawn = [first_fitting_drawn(each, sweeps, masks, drawing, problem)[0] >= 0 for each in one_by_one]
    built = [plan_fits(sweeps, i, ends, scene)[0] for i in range(len(experiences))]
    order = generator(len(drawn), "order").permutation(len(drawn)).astype(np.int32)
    first = (
        first_fitting_drawn(order, sweeps, masks, drawing, problem)[0],
        first_fitting(order, sweeps, ends, scene)[0],
    )
    return drawn, built, first


@given(seed=SEEDS, count=st.integers(0, 12))
def test_the_drawing_says_what_the_scene_says(experiences, draw, seed, count):
    obstacles = draw(generator(seed, "checking"), count)
    problem = dataclasses.replace(experiences[seed % 8].problem, obstacles=obstacles, goal_radius=12.0)
    drawn, built, first = answers(experiences, problem)
    assert drawn == built
    assert first[0] == first[1]


@given(seed=SEEDS, count=st.integers(0, 12), told=st.integers(1, 8))
def test_no_plan_is_tried_if_there_are_telling_ones_and_none_of_these_is_free(
    experiences, draw, seed, count, told
):
    rng = generator(seed, "telling")
    problem = dataclasses.replace(experiences[seed % 8].problem, obstacles=draw(rng, count), goal_radius=12.0)
    sweeps = sweep_plans([each.plan for each in experiences])
    window = dataclasses.replace(problem, start=CANONICAL_START, goal=CANONICAL_GOAL)
    asked = (sweeps, masks_of(sweeps), drawing_of(window), problem)
    order, telling = (rng.permutation(len(experiences)).astype(np.int32)[:n] for n in (8, told))
    anyone, _ = first_fitting_drawn(telling, *asked)
    expected = first_fitting_drawn(order, *asked)[0] if anyone >= 0 else -1
    assert first_fitting_drawn(order, *asked, telling)[0] == expected


@given(seed=SEEDS)
def test_narrower_and_wider_bounds_count(experiences, draw, seed):
    rng = generator(seed, "bounds")
    bounds = tuple((np.array(BOUNDS) + rng.uniform(-8.0, 8.0, 4)).tolist())
    problem = dataclasses.replace(
        experiences[seed % 8].problem, obstacles=draw(rng, 3), goal_radius=12.0, bounds=bounds
    )
    drawn, built, _ = answers(experiences, problem)
    assert drawn == built


@given(seed=SEEDS)
def test_plans_that_leave_the_window_are_checked_all_the_same(experiences, draw, seed):
    rng = generator(seed, "outside")
    offset = rng.uniform(-25.0, 25.0, 2)
    moved = []
    for each in experiences:
        states = each.plan.states.copy()
        states[:, :2] += offset
        moved.append(dataclasses.replace(each, plan=dataclasses.replace(each.plan, states=states)))
    vertices, *rest = draw(rng, 8)
    obstacles = type(experiences[0].problem.obstacles)(vertices + offset, *rest)
    problem = dataclasses.replace(
        experiences[0].problem,
        start=tuple(moved[0].plan.states[0, :3].tolist()),
        goal=tuple(moved[0].plan.states[-1, :2].tolist()),
        goal_radius=12.0,
        obstacles=obstacles,
        bounds=(-60.0, -60.0, 110.0, 110.0),
    )
    drawn, built, _ = answers(moved, problem)
    assert drawn == built


def test_another_start_or_goal_is_not_answered(experiences):
    problem = experiences[0].problem
    for change in ({"start": (0.0, 0.1, problem.start[2])}, {"goal": (0.0, 50.0)}):
        assert not any(answers(experiences, dataclasses.replace(problem, **change))[0])


def test_both_verdicts_occur(experiences, draw):
    verdicts = [
        verdict
        for seed in range(20)
        for verdict in answers(
            experiences,
            dataclasses.replace(experiences[0].problem, obstacles=draw(generator(seed), 5), goal_radius=12.0),
        )[0]
    ]
    assert 0.1 < np.mean(verdicts) < 0.9
