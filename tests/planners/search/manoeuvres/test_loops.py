"""Loops: trains turn round forwards, and straighten on the way into the goal."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.search.manoeuvres import loops, manoeuvring
from planners.search.manoeuvres.loops import MOST_BLOCKED, allocate_loops, lay_loop, list_loops
from planners.search.manoeuvres.pose_tree import pose_of
from planners.search.manoeuvres.variants import word_radius
from planners.search.query import Limits
from planners.search.registry import plan
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.families import family
from planners.world.geometry.collision import scene_of, state_is_free
from planners.world.goal import goal_of
from planners.world.problem import Problem, start_state
from planners.world.randomness import generator
from planners.world.vehicles.dynamics import load
from planners.world.vehicles.vehicle import CAR_2_TRAILERS, Vehicle, state_size, trailers_of
from tests.worlds import problem_of

TRAIN: Vehicle = CAR_2_TRAILERS
SIZE = state_size(TRAIN)
LENGTH = sum(each.hitch_length for each in trailers_of(TRAIN))
WITH_ROOM = 3  # a yard of seed 6 in which it turns round forwards


def yard(number: int) -> Problem:
    return to_canonical(family("yard", "standard", TRAIN).draw(6, number))[0]


@settings(max_examples=20, deadline=None)
@given(number=st.integers(0, 50), hitches=st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)))
def test_loops_lead_into_the_goal_and_say_what_is_blocked(number: int, hitches: tuple[float, float]) -> None:
    problem = yard(number)
    scene = scene_of(problem)
    start, end = start_state(problem, TRAIN)[np.newaxis], pose_of(goal_of(problem, TRAIN), SIZE)[np.newaxis]
    start[0, 5:] = hitches
    found = allocate_loops()
    list_loops(found, start, end, word_radius(TRAIN), LENGTH, TRAIN, scene)
    assert np.all(np.diff(found.blocked) >= 0.0)
    way = np.zeros((4000, SIZE))
    for k in np.flatnonzero(found.blocked < 1.0):
        rows = lay_loop(way, found, k, start, TRAIN)
        assert way[0, :2] == pytest.approx(start[0, :2])
        assert way[rows - 1, :2] == pytest.approx(end[0, :2], abs=0.02)
        assert math.cos(way[rows - 1, 2] - end[0, 2]) == pytest.approx(1.0, abs=1e-3)
        looks = np.flatnonzero(np.hypot(*np.diff(way[:rows, :2], axis=0).T) > 1e-9) + 1
        way[:rows, 3] = 0.0  # at rest it keeps the least margin
        blocked = [not state_is_free(load(way, i, TRAIN), TRAIN, scene) for i in looks]
        assert np.mean(blocked) == pytest.approx(found.blocked[k], abs=2.0 / len(looks))
        assert found.blocked[k] < MOST_BLOCKED
        hitches_at_last = np.abs(way[rows - 1, 5:])
        assert hitches_at_last.max() < 0.7


def test_a_loop_is_a_plan_and_the_same_again() -> None:
    problem = yard(WITH_ROOM)
    limits = Limits(expansions=300)
    found, again = (
        plan("lattice", problem, generator(0), limits=limits, vehicle=TRAIN).plan for _ in range(2)
    )
    assert found is not None
    assert again is not None
    assert faults(problem, found, TRAIN) == []
    assert found.controls.tobytes() == again.controls.tobytes()
    turned = np.unwrap(found.states[:, 2])
    assert abs(turned[-1] - turned[0]) > 2.5
    assert found.states[:, 3].min() > -0.5


def test_trees_alone_drive_longer(monkeypatch: pytest.MonkeyPatch) -> None:
    problems = [yard(number) for number in range(2)]
    here = [solve(each, "lattice", vehicle=TRAIN).duration_s for each in problems]
    monkeypatch.setattr(manoeuvring, "loop", lambda *_: False)
    alone = [solve(each, "lattice", vehicle=TRAIN).duration_s for each in problems]
    assert None not in here + alone
    assert sum(here) < sum(alone) - 1.0


def test_loops_are_for_goals_that_are_near_and_trains_that_are_quick_forwards(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    laid = []
    monkeypatch.setattr(loops, "list_loops", lambda found, *_: laid.append(found.blocked.fill(1.0)))
    near, far = yard(WITH_ROOM), problem_of([])
    far = replace(far, start=(5.0, 5.0, 0.0), goal=(40.0, 40.0), arrival=near.arrival)
    backwards = TRAIN._replace(max_speed=0.5 * -TRAIN.min_speed)
    for problem, vehicle, times in ((far, TRAIN, 0), (near, TRAIN, 1), (near, backwards, 0)):
        laid.clear()
        plan("lattice", problem, generator(0), limits=Limits(expansions=400), vehicle=vehicle)
        assert len(laid) == times


def test_who_hardly_moves_backwards_turns_round_forwards() -> None:
    crawling = TRAIN._replace(min_speed=-0.001)
    found = plan(
        "lattice", yard(WITH_ROOM), generator(0), limits=Limits(expansions=300), vehicle=crawling
    ).plan
    assert found is not None
    assert found.states[:, 3].min() >= -0.001
    assert found.duration_s < 30.0


def test_a_loop_beyond_the_bound_is_no_answer() -> None:
    problem = yard(WITH_ROOM)
    whole = plan("lattice", problem, generator(0), limits=Limits(expansions=300), vehicle=TRAIN).plan
    assert whole is not None
    bound_s = 0.9 * whole.duration_s
    limits = Limits(expansions=300, bound_s=bound_s)
    quicker = plan("lattice", problem, generator(0), limits=limits, vehicle=TRAIN).plan
    assert quicker is None or quicker.duration_s < bound_s
