"""Who plans again while driving is given what is left of its plan, unless another is quicker."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.current_plan import fits, is_near, rest_of
from planners.search.query import Limits
from planners.solve import solve
from planners.world.authority.authority import faults
from planners.world.geometry.collision import scene_of
from planners.world.problem import Arrival, Plan, Problem, obstacles_of, start_state
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, DIFFERENTIAL_DRIVE, Vehicle, name_of
from planners.world.workspace import Workspace
from tests.worlds import box

PLACE = Problem(
    "rooms",
    "rooms",
    (2.0, 4.0, 0.4),
    (26.0, 12.0),
    0.5,
    (-4.0, -4.0, 32.0, 20.0),
    obstacles_of([[box(9.2, 1.5, 0.0, 0.2, 5.5)], [box(9.2, 14.75, 0.0, 0.2, 5.25)]]),
)
POSE = replace(PLACE, goal_radius=0.1, arrival=Arrival(1.2, 0.05, 0.0, 0.0))
WORKSPACE = Workspace()
FEW = Limits(expansions=8_000)


ASKED = {"place": PLACE, "pose": POSE}
CASES = st.tuples(st.sampled_from(list(ASKED)), st.sampled_from([CAR, DIFFERENTIAL_DRIVE, CAR_1_TRAILER]))


@cache
def first_plan(kind: str, vehicle: Vehicle) -> Plan:
    plan = solve(ASKED[kind], "lattice", vehicle=vehicle, workspace=WORKSPACE).plan
    assert plan is not None
    return plan


def seen_from(state: np.ndarray, problem: Problem) -> Problem:
    x, y, heading, *motion = state.tolist()
    return replace(problem, start=(x, y, heading), start_motion=tuple(motion))


def beside_plan(
    case: tuple[str, Vehicle], share: float, off: tuple[float, float, float]
) -> tuple[int, Problem]:
    """How many steps make a share of a case's plan, and the problem seen from so far off it there."""
    (kind, _), plan = case, first_plan(*case)
    at = int(share * (len(plan.states) - 1))
    state = plan.states[at].copy()
    state[:3] += off
    return at, seen_from(state, ASKED[kind])


@settings(deadline=None, max_examples=12)
@given(CASES, st.floats(0.0, 1.0), st.sampled_from([-math.tau, 0.0, math.tau]))
def test_planning_again_never_arrives_later(case: tuple[str, Vehicle], share: float, turn: float) -> None:
    (_, vehicle), plan = case, first_plan(*case)
    at, problem = beside_plan(case, share, (0.0, 0.0, turn))  # a measured heading knows no whole turns
    answer = solve(problem, "lattice", vehicle=vehicle, limits=FEW, workspace=WORKSPACE, current=plan)
    assert answer.plan is not None
    assert faults(problem, answer.plan, vehicle) == []
    left = plan.dt * (len(plan.controls) - at)
    assert answer.plan.duration_s <= left + 1e-9
    assert answer.source in ("kept", "searched")


@settings(deadline=None, max_examples=12)
@given(CASES, st.floats(0.0, 0.8), st.floats(-0.05, 0.05), st.floats(-0.05, 0.05), st.floats(-0.02, 0.02))
def test_beside_its_plan_a_robot_drives_near_it(
    case: tuple[str, Vehicle], share: float, x: float, y: float, turn: float
) -> None:
    (kind, vehicle), plan = case, first_plan(*case)
    at, problem = beside_plan(case, share, (x, y, turn))
    rest = rest_of(plan, problem, vehicle, scene_of(problem), WORKSPACE, math.inf)
    if rest is not None:  # a step before a wall there may be no way on
        assert faults(problem, rest, vehicle) == []
        assert rest.duration_s <= plan.dt * (len(plan.controls) - at) + 1.0
    else:
        assert kind == "pose" or solve(problem, "lattice", vehicle=vehicle, current=plan).source != "kept"


def test_who_brakes_as_hard_as_it_can_is_not_later_by_rounding() -> None:
    controls = np.tile([-CAR.max_acceleration, 0.0], (10, 1))
    states = simulate(np.array([0.0, 0.0, 0.0, 2.0 + 1.000001e-9, 0.0]), controls, CAR)
    x, y = states[-1, :2].tolist()
    asked = replace(POSE, goal=(x, y), obstacles=obstacles_of([]), arrival=Arrival(0.0, 0.05, 0.0, 0.0))
    for at in (0, 5, 9):
        problem = seen_from(states[at], asked)
        rest = rest_of(Plan(states, controls), problem, CAR, scene_of(problem), WORKSPACE, math.inf)
        assert rest is not None
        assert len(rest.controls) == len(controls) - at
        assert faults(problem, rest, CAR) == []


def test_a_stop_on_the_way_is_one_though_a_robot_beside_its_plan_stands_there_but_for_rounding() -> None:
    harder = CAR.max_acceleration
    controls = np.repeat([[-harder, 0.0], [harder, 0.0], [-harder, 0.0]], 10, axis=0)
    plan = Plan(simulate(np.array([0.0, 0.0, 0.0, 2.0 + 1.000001e-9, 0.0]), controls, CAR), controls)
    x, y = plan.states[10, :2].tolist()
    asked = replace(POSE, goal=(x, y), obstacles=obstacles_of([]), arrival=Arrival(0.0, 0.05, 0.0, 0.0))
    problem = seen_from(plan.states[3] + [0.0, 0.01, 0.0, 0.0, 0.0], asked)
    rest = rest_of(plan, problem, CAR, scene_of(problem), WORKSPACE, -math.inf)
    assert rest is not None
    assert len(rest.controls) <= 9
    assert faults(problem, rest, CAR) == []


@pytest.mark.parametrize(("off", "is_there"), [(0.01, True), (0.11, False)])
def test_a_robot_beside_the_end_of_its_plan_is_there_if_it_stands_in_the_goal(
    off: float, is_there: bool
) -> None:
    plan, x, y = first_plan("pose", CAR), *POSE.goal
    problem = seen_from(np.array([x + off, y, 1.2, 0.0, 0.0]), POSE)
    at_goal = Plan(np.array([[x, y, 1.2, 0.0, 0.0]]), plan.controls[:0])
    rest = rest_of(at_goal, problem, CAR, scene_of(problem), WORKSPACE, -math.inf)
    assert (rest is not None) is is_there
    if rest is not None:
        assert len(rest.controls) == 0
        assert faults(problem, rest, CAR) == []


def test_without_limits_of_time_most_measured_states_are_driven_on_from() -> None:
    rng, plan = np.random.default_rng(3), first_plan("place", CAR)
    found = 0
    for at in range(0, len(plan.states) - 1, 5):
        state = plan.states[at].copy()
        state[:3] += 0.01 * rng.normal(size=3)
        problem = seen_from(state, PLACE)
        found += rest_of(plan, problem, CAR, scene_of(problem), WORKSPACE, math.inf) is not None
    assert found >= 0.8 * len(range(0, len(plan.states) - 1, 5))


@settings(deadline=None, max_examples=24)
@given(CASES, st.floats(0.0, 0.7), st.floats(-0.02, 0.02), st.floats(-0.02, 0.02), st.floats(-0.01, 0.01))
def test_where_nothing_is_in_the_way_who_is_beside_a_plan_drives_on_without_any_time(
    case: tuple[str, Vehicle], share: float, x: float, y: float, turn: float
) -> None:
    (_, vehicle), plan = case, first_plan(*case)
    at, walled = beside_plan(case, share, (x, y, turn))
    problem = replace(walled, obstacles=obstacles_of([]))
    rest = rest_of(plan, problem, vehicle, scene_of(problem), WORKSPACE, -math.inf)
    assert rest is not None
    assert faults(problem, rest, vehicle) == []
    assert rest.duration_s <= plan.dt * (len(plan.controls) - at) + 0.5


@pytest.mark.parametrize("vehicle", [CAR, DIFFERENTIAL_DRIVE, CAR_1_TRAILER], ids=name_of)
def test_a_robot_within_the_margins_of_a_post_drives_on_unless_it_meets_it(vehicle: Vehicle) -> None:
    problem = replace(PLACE, start=(0.0, 4.0, 0.0), goal=(30.0, 4.0), obstacles=obstacles_of([]))
    plan = solve(problem, "lattice", vehicle=vehicle, workspace=WORKSPACE).plan
    assert plan is not None
    state = plan.states[len(plan.states) // 2]
    for gap, status in ((0.01, "solved"), (-0.01, "start-blocked")):
        post = box(float(state[0]) + 0.3, 4.0 + 0.5 * vehicle.width + gap + 0.1, 0.0, 0.1, 0.1)
        there = replace(seen_from(state, problem), obstacles=obstacles_of([[post]]))
        assert solve(there, "lattice", vehicle=vehicle, workspace=WORKSPACE).status == "start-blocked"
        answer = solve(there, "lattice", vehicle=vehicle, workspace=WORKSPACE, current=plan)
        assert answer.status == status
        if answer.plan is not None:
            assert faults(there, answer.plan, vehicle) == []


@pytest.mark.parametrize("kind", ["place", "pose"])
def test_a_blocked_plan_is_left(kind: str) -> None:
    plan = first_plan(kind, CAR)
    at = len(plan.states) // 4
    x, y = plan.states[3 * len(plan.states) // 4, :2].tolist()
    problem = seen_from(plan.states[at], ASKED[kind])
    across = box(x, y, 0.0, 0.5, 0.5)
    walls = [[piece] for piece in PLACE.obstacles.pieces()]
    problem = replace(problem, obstacles=obstacles_of([*walls, [across]]))
    assert faults(problem, Plan(plan.states[at:], plan.controls[at:]))
    answer = solve(problem, "lattice", workspace=WORKSPACE, current=plan)
    assert answer.plan is not None
    assert faults(problem, answer.plan) == []


@pytest.mark.parametrize("vehicle", [CAR, DIFFERENTIAL_DRIVE, CAR_1_TRAILER], ids=name_of)
def test_what_stands_on_the_plan_is_passed_and_the_plan_is_driven_on(vehicle: Vehicle) -> None:
    problem = replace(PLACE, goal=(60.0, 4.0), bounds=(-4.0, -14.0, 66.0, 20.0), obstacles=obstacles_of([]))
    plan = solve(problem, "lattice", vehicle=vehicle, workspace=WORKSPACE).plan
    assert plan is not None
    at, on = len(plan.states) // 10, len(plan.states) // 2
    x, y = plan.states[on, :2].tolist()
    there = replace(seen_from(plan.states[at], problem), obstacles=obstacles_of([[box(x, y, 0.3, 0.4, 0.4)]]))
    rest = rest_of(plan, there, vehicle, scene_of(there), WORKSPACE, math.inf, polishes=False)
    assert rest is not None
    assert faults(there, rest, vehicle) == []
    assert rest.duration_s <= plan.dt * (len(plan.controls) - at) + 1.0
    same = (np.abs(rest.states[: on - at - 50] - plan.states[at : on - 50]) < 1e-9).all(axis=1)
    assert same.all()  # as far as it need not be left


def test_who_is_elsewhere_has_no_plan_left() -> None:
    plan = first_plan("pose", CAR)
    elsewhere = seen_from(np.array([28.0, 0.0, 0.0, 0.0, 0.0]), POSE)
    assert rest_of(plan, elsewhere, CAR, scene_of(elsewhere), WORKSPACE, math.inf) is None
    assert not is_near(plan, start_state(elsewhere, CAR), CAR)


@pytest.mark.parametrize(("off", "near"), [([0.2, 0.1, 0.1], True), ([0.0, 0.0, 1.5], False)])
def test_near_a_plan_is_who_stands_and_looks_nearly_as_it_says(off: list[float], near: bool) -> None:
    plan = first_plan("place", CAR)
    state = plan.states[len(plan.states) // 2].copy()
    state[:3] += off
    assert is_near(plan, state, CAR) is near


def test_a_goal_may_move_meanwhile() -> None:
    plan = first_plan("pose", CAR)
    at = len(plan.states) // 2
    problem = replace(seen_from(plan.states[at], POSE), goal=(26.0, 11.0))
    rest = rest_of(plan, problem, CAR, scene_of(problem), WORKSPACE, math.inf)
    assert rest is not None
    assert faults(problem, rest) == []


def test_a_plan_fits_the_vehicle_that_drives_it() -> None:
    plan = first_plan("place", CAR_1_TRAILER)
    assert fits(plan, CAR_1_TRAILER)
    assert not fits(plan, CAR)
    assert not fits(replace(plan, dt=0.5 * plan.dt), CAR_1_TRAILER)
    assert not fits(replace(plan, controls=plan.controls[1:]), CAR_1_TRAILER)


@pytest.mark.parametrize(
    "slower",
    [{"max_acceleration": 1.0}, {"max_steering_rate": 0.5}, {"max_speed": 3.0}, {"max_steering": 0.4}],
)
def test_who_may_do_less_than_planned_drives_on_within_the_new_limits(slower: dict[str, float]) -> None:
    plan, vehicle = first_plan("place", CAR), CAR._replace(**slower)
    for at in range(0, len(plan.states), 20):
        state = plan.states[at].copy()
        state[3] = min(state[3], vehicle.max_speed)
        state[4] = np.clip(state[4], -vehicle.max_steering, vehicle.max_steering)
        problem = seen_from(state, PLACE)
        rest = rest_of(plan, problem, vehicle, scene_of(problem), WORKSPACE, math.inf)
        assert rest is None or faults(problem, rest, vehicle) == []


def test_a_plan_of_lower_precision_is_driven_on() -> None:
    plan = first_plan("place", CAR)
    rounded = Plan(*(each.astype(np.float32).astype(np.float64) for each in (plan.states, plan.controls)))
    for at in range(0, len(plan.states), 20):
        problem = seen_from(plan.states[at], PLACE)
        rest = rest_of(rounded, problem, CAR, scene_of(problem), WORKSPACE, math.inf)
        assert rest is not None
        assert faults(problem, rest) == []
