from __future__ import annotations

import math
import re
from dataclasses import replace

import fcl
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.search.registry import PLANNERS, plan
from planners.world.arrays import Floats
from planners.world.authority.authority import faults
from planners.world.authority.authority_sweeps import _hits, _on_arc, _pose, _shape, prism
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.geometry.collision import count_free_prefix, scene_of
from planners.world.goal import goal_of, reaches
from planners.world.problem import Arrival, Plan, obstacles_of, start_state
from planners.world.randomness import generator
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR, CAR_2_TRAILERS, DIFFERENTIAL_DRIVE, Vehicle
from tests.planners.world.motions import exact_motion
from tests.planners.world.strategies import box_corners, clutter, problem_with, seeds

EMPTY = problem_with(obstacles_of([]))


def straight(car: Vehicle, steps: int) -> Plan:
    """Full speed ahead from the start: some 70 m in 190 steps."""
    controls = np.zeros((steps, 2))
    controls[: round(car.max_speed / car.max_acceleration / car.dt), 0] = car.max_acceleration
    return Plan(simulate(start_state(EMPTY), controls, car), controls)


def good_plan() -> Plan:
    return straight(CAR, 185)


def winding_plan(rng: np.random.Generator) -> Plan:
    """Wheels turned to and fro as far as they go."""
    controls = np.column_stack((rng.uniform(-0.5, 2.0, 60), np.repeat(rng.uniform(-1.6, 1.6, 12), 5)))
    return Plan(simulate(start_state(EMPTY), controls, CAR), controls)


def kinds(problem_faults: list[str]) -> list[str]:
    assert all("\n" not in line for line in problem_faults)
    return [line.split(":")[0] for line in problem_faults]


def footprint(pose: Floats) -> Floats:
    x, y, heading = pose[:3]
    ahead = 0.5 * (CAR.front - CAR.rear)
    return box_corners(
        x + ahead * math.cos(heading), y + ahead * math.sin(heading), heading,
        0.5 * (CAR.front + CAR.rear), 0.5 * CAR.width,
    )  # fmt: skip


def test_a_good_plan_has_no_faults() -> None:
    assert faults(EMPTY, good_plan()) == []


def test_a_teleport_is_found() -> None:
    plan_ = good_plan()
    plan_.states[100:, 0] += 1e-5
    assert kinds(faults(EMPTY, plan_)) == ["Dynamics"]


def test_how_far_a_state_is_off_is_told_in_real_metres() -> None:
    plan_ = good_plan()
    plan_.states[100:, 0] += 0.01
    (told,) = faults(replace(EMPTY, scale=2.0), plan_)
    assert "x of state 100 is 0.02 m" in told


def test_too_fast_a_car_is_found() -> None:
    assert kinds(faults(EMPTY, straight(CAR._replace(max_speed=4.5), 170))) == ["Speed"]


def test_controls_beyond_the_limits_are_found() -> None:
    assert kinds(faults(EMPTY, straight(CAR._replace(max_acceleration=4.0), 180))) == ["Acceleration"]


def test_a_missed_goal_is_found() -> None:
    assert kinds(faults(EMPTY, straight(CAR, 160))) == ["Goal"]


def test_a_wrong_start_is_found() -> None:
    states = good_plan().states.copy()
    states[:, 1] += 0.5
    assert kinds(faults(EMPTY, Plan(states, good_plan().controls))) == ["Start"]


def test_another_time_step_is_found() -> None:
    assert kinds(faults(EMPTY, replace(good_plan(), dt=0.2))) == ["Time step"]


def test_leaving_the_bounds_is_found() -> None:
    narrow = problem_with(obstacles_of([]), (-7.0, -7.0, 57.0, 50.0))
    assert kinds(faults(narrow, good_plan())) == ["Bounds"]


def test_driving_along_the_bounds_with_a_corner_outside_is_found() -> None:
    narrow = problem_with(obstacles_of([]), (-7.0, -7.0, 57.0, good_plan().states[:, 1].max() + 0.2))
    assert kinds(faults(narrow, good_plan())) == ["Bounds"]


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_is_no_number_is_found(value: float) -> None:
    broken = good_plan()
    broken.states[50, 2] = value
    assert kinds(faults(EMPTY, broken)) == ["Numbers"]


def test_states_and_controls_that_do_not_fit_are_found() -> None:
    assert kinds(faults(EMPTY, replace(good_plan(), controls=np.zeros((3, 2))))) == ["Shapes"]


@settings(max_examples=20)
@given(seeds)
def test_a_thin_wall_across_the_way_is_found(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = good_plan().states[rng.integers(20, 185), :2] + rng.uniform(-0.2, 0.2, 2)
    wall = box_corners(x, y, rng.uniform(-math.pi, math.pi), 5e-4, 0.5)
    assert kinds(faults(problem_with(obstacles_of([[wall]])), good_plan())) == ["Collision"]


@settings(max_examples=30)
@given(seeds)
def test_what_is_hit_only_between_two_states_is_found(seed: int) -> None:
    """A splinter where the body passes, but stands at no state."""
    rng = np.random.default_rng(seed)
    winding = winding_plan(rng)
    wide = (-100.0, -100.0, 100.0, 100.0)
    bodies = shapely.union_all([shapely.Polygon(footprint(state)) for state in winding.states])
    for i in rng.permutation(len(winding.controls)):
        between = exact_motion(winding.states[i], winding.controls[i], np.array([0.5 * CAR.dt]), CAR)[0]
        for corner in footprint(between):
            splinter = box_corners(*corner, rng.uniform(-math.pi, math.pi), 1e-4, 1e-4)
            if shapely.Polygon(splinter).disjoint(bodies):
                problem = problem_with(obstacles_of([[splinter]]), wide)
                assert "Collision" in kinds(faults(problem, winding))
                return


@settings(max_examples=50)
@given(seeds)
def test_what_the_kernel_calls_free_the_authority_calls_free(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = problem_with(clutter(rng, 12))
    winding = winding_plan(rng)
    free = count_free_prefix(winding.states, CAR, scene_of(problem))
    begun = Plan(winding.states[: max(free, 1)], winding.controls[: max(free - 1, 0)])
    if free:
        assert {"Collision", "Bounds"}.isdisjoint(kinds(faults(problem, begun)))


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize("name", CLASSES)
def test_every_plan_that_a_planner_finds_is_good(planner: str, name: str) -> None:
    for index in range(5):
        problem = problem_class(name).draw(3, index)
        found = plan(planner, problem, generator(0, problem.id, planner)).plan
        assert found is None or faults(problem, found) == []


@given(speed=st.floats(-1.0, 4.0), steering=st.floats(-0.6, 0.6), off=st.floats(1e-5, 1.0))
def test_another_start_than_the_one_asked_for_is_refused(speed: float, steering: float, off: float) -> None:
    asked = replace(EMPTY, start_motion=(speed, steering), goal=(0.0, 0.0))
    alone = Plan(start_state(asked)[np.newaxis], np.empty((0, 2)))
    assert faults(asked, alone) == []
    assert kinds(faults(replace(asked, start_motion=(speed + off, steering)), alone)) == ["Start"]
    assert kinds(faults(replace(asked, start_motion=(speed, steering - off)), alone)) == ["Start"]


@given(
    heading=st.floats(-20.0, 20.0),
    allowed=st.floats(0.01, 1.0),
    low=st.floats(-1.0, 4.0),
    most=st.floats(-1.0, 4.0),
)
def test_an_arrival_is_judged_as_the_planners_judge_it(
    heading: float, allowed: float, low: float, most: float
) -> None:
    plan = good_plan()
    arrival = Arrival(heading, allowed, min(low, most), max(low, most))
    asked = replace(EMPTY, arrival=arrival)
    wrong = set()
    if math.cos(plan.states[-1, 2] - heading) < math.cos(allowed):
        wrong.add("Heading")
    if not arrival.least_speed <= plan.states[-1, 3] <= arrival.most_speed:
        wrong.add("Arrival")
    assert set(kinds(faults(asked, plan))) == wrong
    assert reaches(tuple(plan.states[-1]), goal_of(asked, CAR)) == (not wrong)


@given(
    turn=st.sampled_from([0.0, -2.0, 1e-4, 2.0]),
    most=st.sampled_from([0.0, 0.5]),
    heading=st.sampled_from([None, 0.0]),
    vehicle=st.sampled_from([CAR, DIFFERENTIAL_DRIVE, DIFFERENTIAL_DRIVE._replace(first_order=True)]),
)
def test_who_is_to_rest_must_not_turn(
    turn: float, most: float, heading: float | None, vehicle: Vehicle
) -> None:
    """Of a car the fifth number is its steering, and a unicycle of the first order stops at once."""
    turn = min(max(turn, -0.5), 0.5) if vehicle is CAR else turn
    arrival = Arrival(heading, 0.1, 0.0, most)
    asked = replace(
        EMPTY, start=(10.0, 10.0, 0.0), goal=(10.0, 10.0), start_motion=(0.0, turn), arrival=arrival
    )
    plan = Plan(start_state(asked, vehicle)[np.newaxis], np.empty((0, 2)))
    wrong = ["Turn"] if vehicle is DIFFERENTIAL_DRIVE and most == 0.0 and turn != 0.0 else []
    assert kinds(faults(asked, plan, vehicle)) == wrong
    assert reaches(tuple(plan.states[-1]), goal_of(asked, vehicle)) == (not wrong)


def test_hitch_angles_at_the_goal_are_judged() -> None:
    start = replace(EMPTY, start=(10.0, 10.0, 0.0), goal=(10.0, 10.0), start_motion=(0.0, 0.0, 0.3, -0.2))
    plan = Plan(np.array([[10.0, 10.0, 0.0, 0.0, 0.0, 0.3, -0.2]]), np.empty((0, 2)))
    for asked, wrong in (((0.25, -0.2), []), ((0.1, -0.2), ["Hitch 1"]), ((0.3, 0.0), ["Hitch 2"])):
        problem = replace(start, arrival=Arrival(hitches=asked, hitch_tolerances=(0.1, 0.1)))
        assert kinds(faults(problem, plan, CAR_2_TRAILERS)) == wrong
        assert reaches(tuple(plan.states[-1]), goal_of(problem, CAR_2_TRAILERS)) == (not wrong)


def test_a_long_thin_piece_two_decimetres_away_is_not_met() -> None:
    """The step of a road car in a hard parallel slot for which a good plan was refused."""
    piece = [(2.067532539367676, -6.491831302642822), (2.067532539367676, 7.206526279449463)]
    piece.append((0.10534708946943283, 7.206526279449463))
    body = np.array([[-0.5875, -0.2425], [0.5875, -0.2425], [0.5875, 0.2425], [-0.5875, 0.2425]])
    body[[0, 3], 0] = -0.5874999999999999
    begin, along = (
        np.array([0.3855436038302086, 0.15457373662631957]),
        [-0.38811459608159593, -0.9216111220620222],
    )
    end, along_end = (
        np.array([0.4186652806374982, 0.19353764627595033]),
        [-0.34410958631362154, -0.9389294928838204],
    )
    footprint = fcl.CollisionObject(_shape(body, 0.0051223299752779046), _pose(begin, np.array(along)))
    way = (begin, np.array(along), end, np.array(along_end))
    assert not _hits(footprint, way, 0.65, prism(np.array(piece)))


@given(st.integers(0, 10**6))
def test_a_step_meets_a_long_thin_piece_only_where_shapely_says_so(seed: int) -> None:
    """FCL alone met such pieces, which turned bounds leave, from decimetres away."""
    rng = np.random.default_rng(seed)
    a, c = rng.uniform(-3.0, 3.0, 2), rng.uniform(-8.0, 8.0, 2)
    piece = np.array([a, [a[0], c[1]], [c[0], c[1]]])
    if abs(c[0] - a[0]) < 0.2 or abs(c[1] - a[1]) < 2.0:
        return
    piece = piece if shapely.LinearRing(piece).is_ccw else piece[::-1]
    body = np.array([[-0.5, -0.24], [0.5, -0.24], [0.5, 0.24], [-0.5, 0.24]])
    corner = piece[rng.integers(3)]
    heading, turn = rng.uniform(-np.pi, np.pi), rng.uniform(-0.2, 0.2)
    begin = corner + rng.normal(0.0, 0.8, 2)
    end = begin + rng.uniform(-0.1, 0.1) * np.array([np.cos(heading + turn / 2), np.sin(heading + turn / 2)])
    towards = [np.array([np.cos(each), np.sin(each)]) for each in (heading, heading + turn)]
    footprint = fcl.CollisionObject(_shape(body, 0.0), _pose(begin, towards[0]))
    met = _hits(footprint, (begin, towards[0], end, towards[1]), float(np.hypot(0.5, 0.24)), prism(piece))
    distances = []
    for share in np.linspace(0.0, 1.0, 41):
        pose = _on_arc(begin, towards[0], end, turn, share)
        placed = body @ np.asarray(pose.getRotation())[:2, :2].T + np.asarray(pose.getTranslation())[:2]
        distances.append(shapely.Polygon(placed).distance(shapely.Polygon(piece)))
    assert met or min(distances) > 0.0
    assert not met or min(distances) < 0.02


def test_lines_tell_real_metres_where_the_problem_lies() -> None:
    plan = good_plan()
    x, y = plan.states[len(plan.states) // 2, :2].tolist()
    corners = [[x - 0.2, y - 0.2], [x + 0.2, y - 0.2], [x + 0.2, y + 0.2], [x - 0.2, y + 0.2]]
    blocked = problem_with(obstacles_of([[np.array(corners)]]))
    problem = replace(blocked, scale=8.0, offset=(1e6, 0.0), goal=(40.0, 40.0), start_motion=(1.0,))
    told = " ".join(faults(problem, plan))
    assert "speed of state 0 is 8 m/s off" in told
    miss = 8.0 * float(np.hypot(*(plan.states[-1, :2] - 40.0)))
    assert f"{miss:.3f} m" in told
    near = re.search(r"near \(([-\d.]+), ([-\d.]+)\)", told)
    assert near is not None
    assert math.dist([float(each) for each in near.groups()], (1e6 + 8.0 * x, 8.0 * y)) < 8.0 * 2.0
