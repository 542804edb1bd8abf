from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings

from planners.world.arrays import Floats
from planners.world.authority.authority import faults
from planners.world.authority.authority_equations import Body, bodies_of, simulate_again
from planners.world.geometry.collision import count_free_prefix, scene_of
from planners.world.problem import Plan, obstacles_of
from planners.world.vehicles.bodies import box_corners as corners_of_boxes
from planners.world.vehicles.bodies import swept_boxes
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, CAR_2_TRAILERS, VEHICLES, Vehicle, state_size
from tests.planners.world.authority.test_authority import kinds
from tests.planners.world.motions import (
    KINDS,
    SECOND_ORDER,
    exact_motion,
    gentle_controls,
    placed,
    random_controls,
    random_state,
    turning_limits,
)
from tests.planners.world.strategies import box_corners, clutter, problem_with, seeds

EMPTY = problem_with(obstacles_of([]))
WIDE = (-100.0, -100.0, 100.0, 100.0)
each_vehicle = pytest.mark.parametrize("vehicle", KINDS.values(), ids=KINDS)


def driven(vehicle: Vehicle, controls: Floats) -> Plan:
    """What the controls make of a vehicle at rest at the canonical start."""
    start = np.zeros(state_size(vehicle))
    start[:3] = EMPTY.start
    return Plan(simulate_again(start, controls, vehicle), controls)


def straight(vehicle: Vehicle) -> Plan:
    """To the canonical goal, at full speed as soon as possible."""
    hasten = max(round(vehicle.max_speed / vehicle.max_acceleration / vehicle.dt), 1)
    controls = np.zeros((175 + hasten // 2, 2))
    controls[:hasten, 0] = vehicle.max_speed / (hasten * vehicle.dt)
    return driven(vehicle, controls)


@each_vehicle
def test_a_good_plan_has_no_faults(vehicle: Vehicle) -> None:
    assert faults(EMPTY, straight(vehicle), vehicle) == []


@each_vehicle
def test_a_plan_that_slides_is_found(vehicle: Vehicle) -> None:
    """Turning a little at full speed, which all of these vehicles may without a limit."""
    controls = straight(vehicle).controls
    controls[60:62, 1] = 1.0, -1.0
    plan = driven(vehicle, controls)
    motion = exact_motion(plan.states[61], np.zeros(2), np.array([1e-4]), vehicle)[0]
    needed = abs(plan.states[61, 3] * (motion[2] - plan.states[61, 2]) / 1e-4)
    for allowed, kind in ((1.01 * needed, []), (0.99 * needed, ["Lateral acceleration"])):
        limited = vehicle._replace(max_lateral_acceleration=allowed)
        assert [each for each in kinds(faults(EMPTY, plan, limited)) if each.startswith("Lateral")] == kind


@each_vehicle
def test_a_plan_of_another_vehicle_is_found(vehicle: Vehicle) -> None:
    """Were it only because the car, turning its wheels, follows other equations than the others."""
    for other in VEHICLES.values():
        controls = straight(other).controls.copy()
        controls[40:45, 1], controls[45:50, 1] = 0.2, -0.2
        found = kinds(faults(EMPTY, driven(other, controls), vehicle))
        assert ("Shapes" in found or "Dynamics" in found) == (other != vehicle)


@pytest.mark.parametrize("vehicle", SECOND_ORDER.values(), ids=SECOND_ORDER)
def test_turning_too_far_or_too_fast_is_found(vehicle: Vehicle) -> None:
    most, change = turning_limits(vehicle)
    freer = {"max_turn_rate": 9.0} if "max_turn_rate" in vehicle._fields else {"max_steering": 1.2}
    controls = np.zeros((20, 2))
    controls[:, 1] = 1.3 * change
    controls[round(1.1 * most / 0.13 / change) :] = 0.0
    plan = driven(vehicle._replace(**freer), controls)
    names = (
        {"Turn rate", "Turn acceleration"}
        if "max_turn_rate" in vehicle._fields
        else {"Steering", "Steering rate"}
    )
    assert set(kinds(faults(EMPTY, plan, vehicle))) == names


def test_a_jack_knifed_trailer_is_found() -> None:
    plan = straight(CAR_1_TRAILER)
    controls = plan.controls.copy()
    controls[25:29, 1] = 1.6  # wheels as far as they go: no hitch angle within the limit keeps up
    found = kinds(faults(EMPTY, driven(CAR_1_TRAILER, controls), CAR_1_TRAILER))
    assert "Hitch 1" in found


def test_a_hitch_that_passes_its_limit_between_two_states_is_found() -> None:
    """To and fro within a coarse step: both its ends lie within the limit, its middle far beyond."""
    vehicle = CAR_1_TRAILER._replace(dt=1.0, max_acceleration=4.0)
    start = np.array([*EMPTY.start, -1.0, 0.0, 0.9])
    controls = np.array([[2.0, 0.0]])
    problem = replace(EMPTY, start_motion=(-1.0, 0.0, 0.9))
    plan = Plan(simulate_again(start, controls, vehicle), controls, vehicle.dt)
    assert abs(plan.states[1, 5] - 0.9) < 1e-6
    for limit, is_found in ((1.1, False), (0.95, True), (0.9 + 1e-5, True)):
        narrow = vehicle._replace(trailers=(vehicle.trailers[0]._replace(max_hitch=limit),))
        assert ("Hitch 1" in kinds(faults(problem, plan, narrow))) == is_found


def test_a_trailer_that_does_not_begin_straight_behind_is_found() -> None:
    plan = straight(CAR_2_TRAILERS)
    start = plan.states[0].copy()
    start[6] = 0.1
    crooked = Plan(simulate_again(start, plan.controls, CAR_2_TRAILERS), plan.controls)
    assert kinds(faults(EMPTY, crooked, CAR_2_TRAILERS)) == ["Start"]


def test_a_trailer_that_does_not_follow_is_found() -> None:
    plan = straight(CAR_2_TRAILERS)
    plan.states[90:, 6] += 1e-5
    assert kinds(faults(EMPTY, plan, CAR_2_TRAILERS)) == ["Dynamics"]


def test_an_obstacle_behind_the_car_is_in_the_trailers_way_alone() -> None:
    behind = box_corners(-1.5, -1.5, 0.0, 0.1, 0.1)
    problem = problem_with(obstacles_of([[behind]]))
    assert faults(problem, straight(CAR), CAR) == []
    (found,) = faults(problem, straight(CAR_1_TRAILER), CAR_1_TRAILER)
    assert found.startswith("Collision: the trailer 1's footprint")


def test_a_trailer_that_stands_out_of_the_bounds_is_found() -> None:
    problem = problem_with(obstacles_of([]), (-1.5, -1.5, 57.0, 57.0))
    assert faults(problem, straight(CAR), CAR) == []
    assert kinds(faults(problem, straight(CAR_1_TRAILER), CAR_1_TRAILER)) == ["Bounds"]


@each_vehicle
@pytest.mark.parametrize("seed", range(4))
def test_what_any_body_hits_only_between_two_states_is_found(vehicle: Vehicle, seed: int) -> None:
    """A splinter where a body passes, but none stands at any state."""
    rng = np.random.default_rng(seed)
    winding = driven(vehicle, gentle_controls(rng, 80, vehicle))
    bodies = bodies_of(winding.states, winding.controls, vehicle)
    standing = shapely.union_all([polygon for body in bodies for polygon in _polygons(body)])
    met = set()
    for i in rng.permutation(len(winding.controls)):
        between = exact_motion(winding.states[i], winding.controls[i], np.array([0.5 * vehicle.dt]), vehicle)
        for name, corners in _corners(between, vehicle):
            if name in met:
                continue
            for corner in corners:
                splinter = box_corners(*corner, rng.uniform(-3.0, 3.0), 1e-4, 1e-4)
                if shapely.Polygon(splinter).disjoint(standing):
                    problem = problem_with(obstacles_of([[splinter]]), WIDE)
                    found = faults(problem, winding, vehicle)
                    assert any(name in line for line in found if line.startswith("Collision"))
                    met.add(name)
                    break
    assert "vehicle" in met


@each_vehicle
@settings(max_examples=30, deadline=None)
@given(seed=seeds)
def test_what_the_kernel_calls_free_the_authority_calls_free(vehicle: Vehicle, seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = problem_with(clutter(rng, 12))
    winding = driven(vehicle, gentle_controls(rng, 120, vehicle))
    free = count_free_prefix(winding.states, vehicle, scene_of(problem))
    begun = Plan(winding.states[: max(free, 1)], winding.controls[: max(free - 1, 0)])
    if free:
        assert {"Collision", "Bounds"}.isdisjoint(kinds(faults(problem, begun, vehicle)))


@each_vehicle
@settings(max_examples=60, deadline=None)
@given(seed=seeds)
def test_what_the_kernel_calls_free_by_a_hair_the_authority_calls_free(vehicle: Vehicle, seed: int) -> None:
    """A wall and bounds that touch the kernel's boxes of a single step, from any side."""
    rng = np.random.default_rng(seed)
    state = random_state(rng, vehicle)
    controls = random_controls(rng, state, vehicle)[np.newaxis]
    states = simulate_again(state, controls, vehicle)
    boxes = swept_boxes(states, vehicle)
    corners = corners_of_boxes(boxes)
    turn = rng.choice([rng.uniform(-np.pi, np.pi), *(np.arctan2(boxes[:, 3], boxes[:, 2]) + 0.5 * np.pi)])
    normal = np.array([np.cos(turn), np.sin(turn)])
    foremost = corners[np.argmax(corners @ normal)] + (1.0 + 1e-6) * normal
    wall = box_corners(*foremost, turn, 1.0, 5.0)
    around = (*(corners.min(axis=0) - 1e-9), *(corners.max(axis=0) + 1e-9))
    for problem in (problem_with(obstacles_of([[wall]]), WIDE), problem_with(obstacles_of([]), around)):
        found = kinds(faults(problem, Plan(states, controls, vehicle.dt), vehicle))
        assert {"Collision", "Bounds"}.isdisjoint(found)


def test_what_is_met_in_the_last_state_only_is_found() -> None:
    """A long thin triangle that FCL's continuous check passes by."""
    start = np.array([0.31159235, 18.63086796, -1.71816949, 2.8829006, -0.618371066])
    controls = np.array([[2.0, -0.6419639611204353]])
    states = simulate_again(start, controls, CAR)
    triangle = np.array([[-0.63508612, 16.81540298], [-13.65128994, 1.74187815], [-13.65086937, 1.74151492]])
    _, (_, last) = _corners(states, CAR)
    problem = problem_with(obstacles_of([[triangle]]), WIDE)
    assert shapely.Polygon(last).intersects(shapely.Polygon(triangle))
    assert "Collision" in kinds(faults(problem, Plan(states, controls), CAR))


def test_what_stands_on_a_pebble_is_found() -> None:
    """A piece that FCL's distance calls met, and its other answer does not."""
    state = [[2.238052017725064, 3.6457692976253426, -0.4056464341343755, 0.0, -0.08213364781794763]]
    pebble = [[3.850145133568554, 3.4432248424533496], [3.850482831042956, 3.4430009870359295]]
    pebble += [[3.8517018021036376, 3.44283314825566], [3.8509331893488117, 3.4464538512883176]]
    ((_, corners),) = _corners(np.array(state), CAR)
    assert shapely.Polygon(corners).intersects(shapely.Polygon(pebble))
    problem = problem_with(obstacles_of([[np.array(pebble)]]), WIDE)
    assert "Collision" in kinds(faults(problem, Plan(np.array(state), np.empty((0, 2))), CAR))


def _corners(states: Floats, vehicle: Vehicle) -> list[tuple[str, Floats]]:
    return [
        (body.name, np.array(polygon.exterior.coords[:-1]))
        for body in bodies_of(states, np.empty((len(states) - 1, 2)), vehicle)
        for polygon in _polygons(body)
    ]


def _polygons(body: Body) -> list[shapely.Polygon]:
    return [shapely.Polygon(corners) for corners in placed(body)]
