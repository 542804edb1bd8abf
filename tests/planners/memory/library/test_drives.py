"""Whole drives that are moved to another question begin and end there; at their own they stay as they are."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.drive_answers import FAR
from planners.memory.library.drives import (
    HOPELESS,
    LOOK,
    NEAREST,
    TRIED,
    drives_of,
    moved_drive,
    rank_drives,
)
from planners.memory.library.plan_library import gathered_library
from planners.memory.plans.plan_arrays import store_plans
from planners.world.arrays import Floats
from planners.world.geometry.collision import blocked_states, scene_of
from planners.world.goal import goal_of_pose
from planners.world.problem import Plan
from planners.world.vehicles.dynamics import control_limits, simulate
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, Vehicle, state_size
from tests.worlds import box, problem_of

poses = st.tuples(st.floats(-40.0, 40.0), st.floats(-40.0, 40.0), st.floats(-3.1, 3.1))
vehicles = st.sampled_from([CAR, CAR_1_TRAILER])


def drive(seed: int, vehicle: Vehicle) -> Plan:
    """Some drive from rest to rest."""
    rng = np.random.default_rng(seed)
    most = np.array(control_limits(vehicle))
    there = rng.uniform(0.1, 1.0, (8, 2)) * most
    controls = np.concatenate([there, -there[::-1], 0.5 * there * [-1.0, 1.0], -0.5 * there * [-1.0, 1.0]])
    controls[0::16, 1] *= 0.5
    start = np.zeros(state_size(vehicle))
    start[:3] = rng.uniform(-3.0, 3.0, 3)
    return Plan(simulate(start, controls, vehicle), controls, vehicle.dt)


def placed(states: Floats, pose: tuple[float, float, float], side: float) -> Floats:
    """States seen from a frame at a pose, mirrored if the side is -1."""
    x, y, turn = pose
    there = states.copy()
    there[:, 0] = x + math.cos(turn) * states[:, 0] - math.sin(turn) * side * states[:, 1]
    there[:, 1] = y + math.sin(turn) * states[:, 0] + math.cos(turn) * side * states[:, 1]
    there[:, 2] = turn + side * states[:, 2]
    there[:, 4:] *= side
    return there


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), pose=poses, side=st.sampled_from([1.0, -1.0]), vehicle=vehicles)
def test_moved_to_its_own_question_a_drive_stays_as_it_is(
    seed: int, pose: tuple[float, float, float], side: float, vehicle: Vehicle
) -> None:
    plan = drive(seed, vehicle)
    drives = drives_of(store_plans([plan], state_size(vehicle)), vehicle)
    wanted = placed(plan.states, pose, side)
    goal = goal_of_pose(*wanted[-1, :3])
    moved = moved_drive(drives, 0 if side > 0.0 else -1, wanted[0], goal, plan.dt)
    np.testing.assert_allclose(moved.states, wanted, atol=1e-9)
    np.testing.assert_array_equal(moved.controls, plan.controls * [1.0, side])


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), start=poses, goal=poses, entry=st.sampled_from([0, -1]), vehicle=vehicles)
def test_a_moved_drive_begins_and_ends_where_it_is_asked(
    seed: int,
    start: tuple[float, float, float],
    goal: tuple[float, float, float],
    entry: int,
    vehicle: Vehicle,
) -> None:
    drives = drives_of(store_plans([drive(seed, vehicle)], state_size(vehicle)), vehicle)
    first = np.zeros(state_size(vehicle))
    first[:3] = start
    moved = moved_drive(drives, entry, first, goal_of_pose(*goal), vehicle.dt).states
    np.testing.assert_array_equal(moved[0], first)
    np.testing.assert_allclose(moved[-1, :2], goal[:2], atol=1e-9)
    assert math.remainder(moved[-1, 2] - goal[2], math.tau) == pytest.approx(0.0, abs=1e-9)
    assert np.abs(np.diff(moved[:, 2])).max() < math.pi  # no heading jumps by a turn


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), vehicle=vehicles)
def test_only_drives_that_begin_near_are_ranked(seed: int, vehicle: Vehicle) -> None:
    plans = [drive(seed + number, vehicle) for number in range(30)]
    drives = drives_of(store_plans(plans, state_size(vehicle)), vehicle)
    scene, order = scene_of(problem_of([])), np.zeros(TRIED, np.int32)
    rng = np.random.default_rng(seed)
    start = np.zeros(state_size(vehicle))
    start[:3] = 25.0, 25.0, rng.uniform(-3.0, 3.0)
    goal = goal_of_pose(*(start[:2] + rng.uniform(-3.0, 3.0, 2)), rng.uniform(-3.0, 3.0))
    count, quickest, checks = rank_drives(drives, start, goal, FAR, order, vehicle, scene)
    body = vehicle.front + vehicle.rear
    assert (count == 0) == (checks == 0)
    near = []
    for entry in range(-len(plans), len(plans)):
        number, side = (entry, 1.0) if entry >= 0 else (-1 - entry, -1.0)
        first = drives.states[drives.starts[number]]
        begins = placed(first[np.newaxis], (goal[0], goal[1], goal[3]), side)[0]
        off = math.dist(begins[:2], start[:2]) / body + abs(math.remainder(begins[2] - start[2], math.tau))
        off += np.abs(begins[5:] - start[5:]).sum()
        if off < FAR:
            near.append((off, len(plans[number].controls), entry))
    near.sort()
    assert {*order[:count].tolist()} <= {entry for *_, entry in near}
    assert len(set(order[:count].tolist())) == count == min(len(near), TRIED)
    usual = min(steps for _, steps, _ in near[:NEAREST]) if len(near) >= NEAREST else 0
    assert quickest == usual


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), vehicle=vehicles)
def test_drives_that_are_mostly_blocked_are_left_out(seed: int, vehicle: Vehicle) -> None:
    plans = [drive(seed + number, vehicle) for number in range(8)]
    drives = drives_of(store_plans(plans, state_size(vehicle)), vehicle)
    rng = np.random.default_rng(seed)
    posts = [box(x, y, 0.0, 0.5, 0.5) for x, y in rng.uniform(10.0, 40.0, (40, 2))]
    scene, order = scene_of(problem_of(posts)), np.zeros(TRIED, np.int32)
    start = np.zeros(state_size(vehicle))
    start[:3] = 25.0, 25.0, rng.uniform(-3.0, 3.0)
    goal = goal_of_pose(*(start[:2] + rng.uniform(-3.0, 3.0, 2)), rng.uniform(-3.0, 3.0))
    count, _, _ = rank_drives(drives, start, goal, math.inf, order, vehicle, scene)
    hopeful = 0
    for entry in range(-len(plans), len(plans)):
        states = moved_drive(drives, entry, start, goal, vehicle.dt).states
        blocked = LOOK * blocked_states(states[::LOOK], vehicle, scene).sum()
        is_hopeful = blocked <= HOPELESS * len(states)
        assert is_hopeful or entry not in order[:count]
        hopeful += is_hopeful
    assert count == min(hopeful, TRIED)


def test_drives_that_do_not_end_at_rest_are_left_out() -> None:
    whole = drive(1, CAR)
    moving = Plan(whole.states[:9], whole.controls[:8], whole.dt)
    standing = Plan(whole.states[:1], whole.controls[:0], whole.dt)
    drives = drives_of(store_plans([moving, whole, standing], state_size(CAR)), CAR)
    assert drives.plans.tolist() == [1]
    assert len(drives_of(store_plans([moving], state_size(CAR)), CAR).plans) == 0


def test_of_the_plans_of_a_question_only_the_quickest_is_a_drive() -> None:
    quick, other = drive(1, CAR), drive(2, CAR)
    waits = np.vstack([quick.states[:1], quick.states]), np.vstack([np.zeros((1, 2)), quick.controls])
    slow = Plan(*waits, CAR.dt)
    library = gathered_library("test", CAR, [("a", slow), ("b", other), ("a", quick), ("c", slow)])
    assert library.drives.plans.tolist() == [1, 2, 3]
