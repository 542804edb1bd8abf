from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.world.arrays import Floats
from planners.world.classes.families import (
    FAMILIES,
    LAST_TRAILER,
    PARKED,
    WITH_TRAILERS,
    WITHOUT_TRAILERS,
    family,
    tolerances_of,
)
from planners.world.classes.problem_classes import DIFFICULTIES
from planners.world.geometry.collision import count_free_prefix, scene_of
from planners.world.problem import Problem, start_state
from planners.world.problem_faults import problem_fault
from planners.world.vehicles.bodies import footprints
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, CAR_2_TRAILERS, VEHICLES, Vehicle, trailers_of
from storage.vehicles.vehicle_files import read_vehicle

OF_FILES = [read_vehicle(path) for path in sorted(Path("docs/vehicles").glob("*.yaml"))]
REVERSING = [each for each in (*VEHICLES.values(), *OF_FILES) if each.min_speed < 0.0]
SUITED = [
    (vehicle, name)
    for vehicle in REVERSING
    for name in (WITH_TRAILERS if trailers_of(vehicle) else WITHOUT_TRAILERS)
]
each_pair = pytest.mark.parametrize(
    ("vehicle", "name"), SUITED, ids=[f"{vehicle.about.name.decode()}-{name}" for vehicle, name in SUITED]
)
each_difficulty = pytest.mark.parametrize("difficulty", DIFFICULTIES)


def state_at_goal(problem: Problem, vehicle: Vehicle) -> Floats:
    assert problem.arrival is not None
    state = np.zeros_like(start_state(problem, vehicle))
    state[:3] = *problem.goal, problem.arrival.heading
    return state


@each_pair
@each_difficulty
def test_start_and_goal_are_free_and_make_sense(vehicle: Vehicle, name: str, difficulty: str) -> None:
    for index in range(12):
        problem = family(name, difficulty, vehicle).draw(9, index)
        assert problem_fault(problem, vehicle) is None
        scene = scene_of(problem)
        ends = np.stack([start_state(problem, vehicle), state_at_goal(problem, vehicle)])
        assert count_free_prefix(ends, vehicle, scene) == 2
        pieces = [shapely.Polygon(piece) for piece in problem.obstacles.pieces()]
        for body in footprints(ends, vehicle).reshape(-1, 4, 2):  # and so says another library
            assert not any(shapely.Polygon(body).intersects(piece) for piece in pieces)


@each_pair
def test_the_same_seed_number_and_vehicle_draw_the_same_problem(vehicle: Vehicle, name: str) -> None:
    drawn = family(name, "standard", vehicle)
    one, again, other = drawn.draw(5, 7), drawn.draw(5, 7), drawn.draw(5, 8)
    assert one.id == again.id == f"{name}-standard-5-7"
    assert (one.start, one.goal, one.arrival, one.bounds) == (
        again.start,
        again.goal,
        again.arrival,
        again.bounds,
    )
    assert (one.obstacles.vertices == again.obstacles.vertices).all()
    assert one.start != other.start


@each_difficulty
@pytest.mark.parametrize("name", FAMILIES)
def test_parked_bodies_keep_to_themselves_and_within_the_bounds(name: str, difficulty: str) -> None:
    vehicle = CAR_1_TRAILER if name in WITH_TRAILERS else CAR
    for index in range(12):
        problem = family(name, difficulty, vehicle).draw(2, index)
        pieces = [shapely.Polygon(piece) for piece in problem.obstacles.pieces()]
        ground = shapely.box(*problem.bounds).buffer(1e-5)
        assert all(ground.contains(piece) for piece in pieces)
        overlap = sum(piece.area for piece in pieces) - shapely.union_all(pieces).area
        assert overlap < 1e-4  # square metres, of corners rounded to float32


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_the_last_trailer_is_where_it_should_be_within_the_tolerances(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for vehicle in (CAR_1_TRAILER, CAR_2_TRAILERS, *(each for each in OF_FILES if trailers_of(each))):
        metres, radians = tolerances_of(vehicle)
        trailers = trailers_of(vehicle)
        heading = rng.choice([-1.0, 1.0]) * radians
        place = metres * np.array([math.cos(phi := rng.uniform(-4.0, 4.0)), math.sin(phi)])
        where, straight = place.copy(), np.zeros(2)
        for trailer in trailers:
            heading -= rng.choice([-1.0, 1.0]) * radians
            length = vehicle.scale * trailer.hitch_length
            where -= length * np.array([math.cos(heading), math.sin(heading)])
            straight -= [length, 0.0]
        assert abs(heading) <= LAST_TRAILER[1] + 1e-12
        assert np.hypot(*(where - straight)) <= 1.01 * LAST_TRAILER[0]  # what is said holds to first order


def test_a_car_is_parked_to_five_centimetres_and_a_degree() -> None:
    road_car = next(each for each in OF_FILES if each.about.name == b"road-car")
    for vehicle in (CAR, road_car):
        problem = family("parallel", "hard", vehicle).draw(1, 0)
        assert problem.arrival is not None
        asked = problem.scale * problem.goal_radius, problem.arrival.heading_tolerance
        assert asked == pytest.approx(PARKED)
        assert (problem.arrival.least_speed, problem.arrival.most_speed) == (0.0, 0.0)


def test_rooms_are_in_proportion_to_the_vehicle() -> None:
    half = CAR._replace(
        **{
            name: 0.5 * getattr(CAR, name)
            for name in ("front", "rear", "width", "wheelbase", "min_speed", "max_speed", "max_acceleration")
        }
    )
    large, small = (family("lot", "hard", vehicle).draw(1, 4) for vehicle in (CAR, half))
    assert np.allclose(0.5 * large.obstacles.vertices, small.obstacles.vertices, atol=1e-5)
    assert np.allclose(0.5 * np.array(large.goal), small.goal)


@pytest.mark.parametrize(
    ("name", "difficulty", "vehicle", "told"),
    [
        ("diagonal", "easy", CAR, "choose one of parallel"),
        ("lot", "brutal", CAR, "choose one of easy"),
        ("dock", "easy", CAR, "dock is not for car; choose parallel"),
        ("parallel", "easy", CAR_2_TRAILERS, "choose dock, yard, or a vehicle without trailers"),
        ("parallel", "easy", CAR._replace(min_speed=0.0), "cannot drive backwards"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_one_line(
    name: str, difficulty: str, vehicle: Vehicle, told: str
) -> None:
    with pytest.raises(ValueError, match=told) as caught:
        family(name, difficulty, vehicle)
    assert "\n" not in str(caught.value)
