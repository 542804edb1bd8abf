"""The laws of hallucination for every vehicle, with FCL as the judge."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import islice

import fcl
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.memory.hallucination.learned_obstacles_training import LearnedTraining, train_learned
from planners.memory.hallucination.mixture import METHODS, hallucinate
from planners.memory.hallucination.no_plan import no_plan
from planners.memory.labelling import label_problems
from planners.memory.plans.experience import Experience
from planners.memory.plans.free import free_plans
from planners.memory.plans.sweeps import PlanSweeps, sweep_plans
from planners.world.arrays import Floats
from planners.world.authority.authority import faults
from planners.world.authority.authority_sweeps import prism
from planners.world.classes.problem_classes import problem_class
from planners.world.geometry.collision import scene_of
from planners.world.problem import Obstacles, Plan, Problem, start_state
from planners.world.randomness import generator
from planners.world.vehicles.bodies import box_corners
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import VEHICLES
from tests.planners.memory.conftest import boxes, problem_around
from tests.planners.world.motions import gentle_controls

SEEDS = st.integers(0, 2**32 - 1)
EACH = 3  # experiences a vehicle


@cache
def experiences_of(name: str) -> list[Experience]:
    vehicle = VEHICLES[name]
    empty = problem_class("trap").draw(0, 0)
    made: list[Experience] = []
    attempt = 0
    while len(made) < EACH:
        rng = generator(5, name, attempt)
        attempt += 1
        controls = gentle_controls(rng, 200, vehicle)
        plan = Plan(simulate(start_state(empty, vehicle), controls, vehicle), controls)
        problem = problem_around(plan, draw(rng), f"boxes-{len(made)}")
        if (
            not faults(problem, plan, vehicle)
            and free_plans(sweep_plans([plan], vehicle), scene_of(problem))[0]
        ):
            made.append(Experience(problem, plan, vehicle))
    return made


@cache
def weights_of(name: str):
    return train_learned(experiences_of(name), 1, LearnedTraining(steps=5))


def draw(rng: np.random.Generator) -> Obstacles:
    return boxes(rng, 8)


@pytest.mark.parametrize("name", VEHICLES)
@pytest.mark.parametrize("method", METHODS)
@given(seed=SEEDS)
@settings(max_examples=6)
def test_the_plan_that_a_problem_was_made_for_stays_free(name: str, method: str, seed: int) -> None:
    experience = experiences_of(name)[seed % EACH]
    made = hallucinate(experience, {method: 1.0}, draw, generator(seed), weights_of(name))
    problems = [problem for problem, _ in islice(made, 2)]
    assert label_problems(problems, experience.sweep).free.all()
    for problem in problems:
        assert faults(problem, experience.plan, VEHICLES[name]) == []


def test_made_problems_are_of_the_scale_of_their_vehicle() -> None:
    (experience, *_), scale = experiences_of("car"), 0.25
    small = replace(experience, problem=replace(experience.problem, scale=scale))
    around = hallucinate(small, {"rearrange": 1.0}, draw, generator(1))
    made = [each.problem for each in islice(around, 6)]
    made.append(no_plan(experience.sweep, draw, generator(1), "boxes", 0, scale=scale))
    assert {problem.scale for problem in made} == {scale}


@pytest.mark.parametrize("name", VEHICLES)
@given(seed=SEEDS)
@settings(max_examples=6)
def test_in_a_problem_of_s_0_no_plan_is_free(name: str, seed: int) -> None:
    plans = [experience.plan for experience in experiences_of(name)]
    sweeps = sweep_plans(plans, VEHICLES[name])
    problem = no_plan(sweeps, draw, generator(seed), "boxes", 0)
    assert not fcl_labels(problem, sweeps).any()


@pytest.mark.parametrize("name", VEHICLES)
@given(seed=SEEDS)
@settings(max_examples=6)
def test_label_vectors_are_what_fcl_says_of_the_swept_boxes(name: str, seed: int) -> None:
    experiences = experiences_of(name)
    sweeps = sweep_plans([experience.plan for experience in experiences], VEHICLES[name])
    made = hallucinate(experiences[seed % EACH], {"rearrange": 1.0}, draw, generator(seed))
    problems = [problem for problem, _ in islice(made, 2)]
    assert (label_problems(problems, sweeps).free == [fcl_labels(p, sweeps) for p in problems]).all()


def fcl_labels(problem: Problem, sweeps: PlanSweeps) -> Floats:
    """Which plans' swept boxes lie in the bounds and meet no obstacle, by FCL."""
    manager = fcl.DynamicAABBTreeCollisionManager()
    manager.registerObjects([prism(piece) for piece in problem.obstacles.pieces()])
    manager.setup()
    low, high = problem.bounds[:2], problem.bounds[2:]
    free = []
    for first, last in zip(sweeps.starts[:-1], sweeps.starts[1:], strict=True):
        corners = box_corners(sweeps.boxes[first:last])
        inside = bool(((corners >= low) & (corners <= high)).all())
        free.append(inside and not any(_meets(manager, box) for box in corners.reshape(-1, 4, 2)))
    return np.array(free)


def _meets(manager: fcl.DynamicAABBTreeCollisionManager, box: Floats) -> bool:
    data = fcl.CollisionData()
    manager.collide(prism(box), data, fcl.defaultCollisionCallback)
    return bool(data.result.is_collision)
