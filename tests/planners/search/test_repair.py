import functools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.search.outcome import Status
from planners.search.query import Query
from planners.search.registry import plan
from planners.search.repair import free_prefix, repair
from planners.search.tracking import ARRIVED, BLOCKED, TRACKING, track
from planners.world.authority.authority import faults
from planners.world.geometry.collision import blocked_states, count_free_prefix, scene_of
from planners.world.geometry.occupancy import drawing_of
from planners.world.goal import goal_of
from planners.world.problem import start_state
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, VEHICLES
from planners.world.workspace import Workspace
from tests.worlds import box, problem_of, strewn


@functools.cache
def stored_plan(seed=0):
    return plan("follow", strewn(seed, 20), generator(seed)).plan


def with_boxes_on(stored, places, half=1.5):
    """Only boxes on the plan, at these shares of its states."""
    at = [stored.states[int(share * len(stored.states)), :2] for share in places]
    return problem_of([box(*point, 0.3 * i, half, half) for i, point in enumerate(at)], f"boxes-{places}")


def repaired(problem, stored, seed=0, vehicle=CAR):
    scene = scene_of(problem)
    query = Query(problem, generator(seed), scene, Workspace(), vehicle=vehicle)
    drive, _ = free_prefix(stored, scene, vehicle)
    return repair(query, stored, drive, drawing_of(problem).occupied)


@given(seed=st.integers(0, 20), count=st.integers(0, 60))
@settings(max_examples=20, deadline=None)
def test_blocked_states_begin_where_the_free_prefix_ends(seed, count):
    scene, stored = scene_of(strewn(seed + 100, count)), stored_plan(seed % 3)
    blocked = blocked_states(stored.states, CAR, scene)
    free = count_free_prefix(stored.states, CAR, scene)
    count = int(blocked.sum())
    assert free == (int(blocked.argmax()) if blocked.any() else len(blocked))
    prefix, checked = free_prefix(stored, scene)
    assert checked == min(free + 1, len(blocked))
    assert (prefix is None) == (free == 0)
    if prefix is not None:
        np.testing.assert_array_equal(prefix.states, stored.states[: len(prefix.states)])
        assert not blocked[: len(prefix.states)].any()


@given(
    seed=st.integers(0, 2),
    places=st.lists(st.sampled_from([0.3, 0.45, 0.6, 0.75]), min_size=1, max_size=3, unique=True),
)
@settings(max_examples=12, deadline=None)
def test_a_repaired_plan_is_whole_and_begins_as_the_stored_one(seed, places):
    stored = stored_plan(seed)
    problem = with_boxes_on(stored, places)
    outcome = repaired(problem, stored)
    blocked = blocked_states(stored.states, CAR, scene_of(problem))
    assert (outcome.plan is not None) == (outcome.status is Status.SOLVED)
    if outcome.plan is None:
        return
    assert faults(problem, outcome.plan) == []
    common = min(len(stored.states), len(outcome.plan.states))
    same = (stored.states[:common] == outcome.plan.states[:common]).all(axis=1)
    kept = common if same.all() else int(same.argmin())
    assert kept >= 2
    assert kept <= int(blocked.argmax())


def test_a_plan_blocked_in_one_place_is_mostly_repaired():
    plans = [stored_plan(seed) for seed in range(10)]
    done = [repaired(with_boxes_on(plan, (0.5,)), plan).status is Status.SOLVED for plan in plans]
    assert np.mean(done) >= 0.8


def test_the_same_seed_repairs_alike():
    problem = with_boxes_on(stored_plan(), (0.4, 0.7))
    first, again = (repaired(problem, stored_plan(), 5) for _ in range(2))
    np.testing.assert_array_equal(first.plan.states, again.plan.states)
    counts = [(each.collision_checks, each.expansions, each.nodes) for each in (first, again)]
    assert counts[0] == counts[1]


@pytest.mark.slow  # each vehicle compiles for a minute
@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=list(VEHICLES))
def test_plans_of_every_vehicle_are_repaired_and_pass_the_authority(vehicle):
    done = []
    for seed in range(8):
        stored = plan("follow", strewn(seed, 10), generator(seed), vehicle=vehicle).plan
        problem = with_boxes_on(stored, (0.55,), 1.0)
        outcome = repaired(problem, stored, seed, vehicle)
        done.append(outcome.plan is not None)
        if outcome.plan is not None:
            assert faults(problem, outcome.plan, vehicle) == []
    assert np.mean(done) >= 0.5


def test_where_the_start_is_blocked_nothing_is_free():
    assert free_prefix(stored_plan(), scene_of(problem_of([box(0.8, 0.8, 0, 0.5, 0.5)]))) == (None, 1)


def test_where_a_wall_has_no_gap_repair_gives_up():
    outcome = repaired(problem_of([box(25, 25, -np.pi / 4, 60, 0.5)]), stored_plan())
    assert (outcome.plan, outcome.expansions) == (None, 0)


@pytest.mark.parametrize("seed", range(5))
def test_the_controller_follows_a_plan_from_its_start_to_its_goal(seed):
    stored = stored_plan(seed)
    problem = problem_of([])
    states, controls = np.empty((2000, 5)), np.empty((2000, 2))
    states[0] = start_state(problem)
    goal = goal_of(problem, CAR)
    ended, last, _ = track(states, controls, 0, stored.states, 0, goal, TRACKING, CAR, scene_of(problem))
    assert ended == ARRIVED
    assert last <= 1.5 * len(stored.states)
    apart = states[: last + 1, None, :2] - stored.states[None, :, :2]
    off = np.hypot(apart[..., 0], apart[..., 1]).min(axis=1)
    assert np.median(off) < 0.5
    assert off.max() < TRACKING.lost_m  # a small loop is cut


def test_the_controller_stops_before_an_obstacle():
    stored = stored_plan()
    problem = with_boxes_on(stored, (0.5,))
    states, controls = np.empty((2000, 5)), np.empty((2000, 2))
    states[0] = start_state(problem)
    scene = scene_of(problem)
    goal = goal_of(problem, CAR)
    ended, last, _ = track(states, controls, 0, stored.states, 0, goal, TRACKING, CAR, scene)
    assert ended == BLOCKED
    assert count_free_prefix(states[: last + 1], CAR, scene) == last + 1


@pytest.mark.parametrize("longest", [20, 100, 200])
def test_a_drive_longer_than_the_buffers_is_given_up(monkeypatch, longest):
    monkeypatch.setattr("planners.search.repair.LONGEST", longest)
    stored = stored_plan()
    outcome = repaired(with_boxes_on(stored, [0.45, 0.75]), stored)
    assert outcome.plan is None or len(outcome.plan.states) <= longest
