"""The comparison with OMPL compares like with like: same equations, same checker, plans by our rules."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.families import family
from planners.world.classes.problem_classes import problem_class
from planners.world.geometry.collision import count_free_prefix, scene_of
from planners.world.problem import Problem, start_state
from planners.world.randomness import generator
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR
from planners.world.workspace import Workspace
from tests.speed.peers.answer import MissingError
from tests.speed.peers.native import Native
from tests.speed.peers.settings import KPIECE1, RRT

LIMIT_S = 30.0


@cache
def problem() -> Problem:
    return problem_class("trap", "easy").draw(77, 0)


@pytest.fixture(scope="module")
def native() -> Iterator[Native]:
    try:
        program = Native()
    except MissingError as missing:
        pytest.skip(str(missing))
    with program:
        yield program


def test_a_plan_of_the_wheel_is_a_plan_by_our_rules() -> None:
    pytest.importorskip("ompl", reason="the ompl wheel is not here", exc_type=ImportError)
    from tests.speed.peers.wheel import Wheel

    answer = Wheel().kpiece1(problem(), 1, LIMIT_S, KPIECE1)
    assert answer.plan is not None
    assert faults(problem(), answer.plan) == []


@pytest.mark.slow  # its kernels take half a minute to compile
def test_curves_of_others_are_driven_by_our_rules() -> None:
    pytest.importorskip("ompl", reason="the ompl wheel is not here", exc_type=ImportError)
    from tests.speed.peers.hybrid_astar import hybrid_astar
    from tests.speed.peers.reeds_shepp import reeds_shepp_plan

    workspace = Workspace()
    for name in ("parallel", "angled"):
        slot = to_canonical(family(name, "easy", CAR).draw(77, 1))[0]
        again, found = (hybrid_astar(slot, CAR, workspace).plan for _ in range(2))
        of_ompl = reeds_shepp_plan(slot, CAR, "RRTConnect", 1, LIMIT_S, workspace).plan
        assert again is not None
        assert found is not None
        assert of_ompl is not None
        assert np.array_equal(again.states, found.states)
        assert faults(slot, found, CAR) == faults(slot, of_ompl, CAR) == []


@pytest.mark.parametrize("motion", [(), (2.0, 0.1)], ids=["from rest", "moving"])
@pytest.mark.parametrize("turns", [0.0, math.tau], ids=["heading within pi", "a turn more"])
@pytest.mark.parametrize("name", ["kpiece1", "rrt"])
def test_a_plan_of_the_native_program_is_a_plan_by_our_rules(
    native: Native, name: str, turns: float, motion: tuple[float, ...]
) -> None:
    x, y, heading = problem().start
    asked = replace(problem(), id=f"{turns} {motion}", start=(x, y, heading + turns), start_motion=motion)
    for seed in range(1, 6):
        answer = (
            native.kpiece1(asked, seed, LIMIT_S, KPIECE1)
            if name == "kpiece1"
            else native.rrt(asked, seed, LIMIT_S, RRT)
        )
        assert answer.plan is not None
        assert faults(asked, answer.plan) == []


def test_the_same_seed_gives_the_same_native_plan(native: Native) -> None:
    one, other = (native.kpiece1(problem(), 3, LIMIT_S, KPIECE1) for _ in range(2))
    assert one.plan is not None
    assert other.plan is not None
    assert one.checks == other.checks
    assert np.array_equal(one.plan.states, other.plan.states)


def test_the_native_checker_agrees_with_ours(native: Native) -> None:
    low = [problem().bounds[0], problem().bounds[1], -10.0, CAR.min_speed, -CAR.max_steering]
    high = [problem().bounds[2], problem().bounds[3], 10.0, CAR.max_speed, CAR.max_steering]
    states = generator(0, "states").uniform(low, high, (20_000, 5))
    scene = scene_of(problem())
    free = np.array([count_free_prefix(states[i : i + 1], CAR, scene) == 1 for i in range(len(states))])
    assert 0.1 < free.mean() < 0.9
    assert np.array_equal(native.free(problem(), states), free)


def test_the_native_equations_agree_with_ours(native: Native) -> None:
    rng = generator(0, "controls")
    for _ in range(20):
        controls = rng.uniform(-1.0, 1.0, (200, 2)) * (CAR.max_acceleration, CAR.max_steering_rate)
        start = start_state(problem())
        start[2] = rng.uniform(-math.pi, math.pi)
        driven = native.simulate(start, controls)
        assert np.abs(driven - simulate(start, controls, CAR)).max() < 1e-10
