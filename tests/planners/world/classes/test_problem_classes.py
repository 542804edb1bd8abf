from __future__ import annotations

from functools import partial
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given, settings

from planners.world.classes.problem_classes import CLASSES, DIFFICULTIES, ProblemClass, problem_class
from planners.world.classes.shapes import GOAL_ROOM, START_ROOM
from planners.world.geometry.collision import count_free_prefix, scene_of
from planners.world.problem import BOUNDS, Problem, start_state
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, VEHICLES, CarWithTrailers, Vehicle
from tests.planners.world.kernels import state_is_free
from tests.planners.world.strategies import seeds

ALL = [problem_class(name, difficulty) for name in CLASSES for difficulty in DIFFICULTIES]
each_class = pytest.mark.parametrize("drawn", ALL, ids=lambda c: f"{c.name}-{c.difficulty}")


def polygons(problem: Problem) -> list[shapely.Polygon]:
    return [shapely.Polygon(piece) for piece in problem.obstacles.pieces()]


@each_class
def test_the_same_seed_and_index_draw_the_same_problem(drawn: ProblemClass) -> None:
    one, again = drawn.draw(5, 7), drawn.draw(5, 7)
    assert one.id == again.id == f"{drawn.name}-{drawn.difficulty}-5-7"
    for array, same in zip(one.obstacles, again.obstacles, strict=True):
        assert (array == same).all()


@each_class
def test_another_seed_or_index_draws_another_problem(drawn: ProblemClass) -> None:
    drawings = [drawn.draw(*key).obstacles.vertices.tobytes() for key in ((5, 7), (5, 8), (6, 7))]
    assert len(set(drawings)) == 3


@each_class
@settings(max_examples=10)
@given(seeds)
def test_obstacles_are_convex_counter_clockwise_and_exact_in_float32(drawn: ProblemClass, seed: int) -> None:
    obstacles = drawn.draw(seed, 0).obstacles
    assert (obstacles.vertices == obstacles.vertices.astype(np.float32)).all()
    for piece in obstacles.pieces():
        edges = np.roll(piece, -1, axis=0) - piece
        following = np.roll(edges, -1, axis=0)
        assert (edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0] > 0.0).all()
    assert obstacles.piece_starts[-1] == len(obstacles.vertices)
    assert obstacles.obstacle_starts[-1] == len(obstacles.piece_starts) - 1
    assert all(first < last for first, last in pairwise(obstacles.obstacle_starts))


@each_class
@settings(max_examples=10)
@given(seeds)
def test_start_and_goal_have_room(drawn: ProblemClass, seed: int) -> None:
    problem = drawn.draw(seed, 0)
    for x, y, room in (START_ROOM, GOAL_ROOM):
        place = shapely.Point(x, y)
        assert all(place.distance(polygon) > room for polygon in polygons(problem))
    assert state_is_free(tuple(start_state(problem)), CAR, scene_of(problem))


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
@each_class
def test_every_vehicle_stands_free_at_the_start_and_else_gets_the_same_draws(
    drawn: ProblemClass, vehicle: Vehicle
) -> None:
    own = problem_class(drawn.name, drawn.difficulty, vehicle)
    without = 0
    for index in range(100):
        problem, cars = own.draw(9, index), drawn.draw(9, index)
        assert count_free_prefix(start_state(problem, vehicle)[np.newaxis], vehicle, scene_of(problem)) == 1
        kept = {piece.tobytes() for piece in problem.obstacles.pieces()}
        left_out = [piece for piece in cars.obstacles.pieces() if piece.tobytes() not in kept]
        assert len(kept) == len(cars.obstacles.pieces()) - len(left_out)
        obstacles = len(cars.obstacles.obstacle_starts) - len(problem.obstacles.obstacle_starts)
        assert obstacles <= 3  # near the start, of some thirty
        without += bool(left_out)
    if not isinstance(vehicle, CarWithTrailers):
        assert without == 0


@each_class
def test_every_obstacle_stands_in_the_bounds(drawn: ProblemClass) -> None:
    inside = shapely.box(*BOUNDS)
    for index in range(10):
        problem = drawn.draw(0, index)
        pieces = polygons(problem)
        for first, last in pairwise(problem.obstacles.obstacle_starts):
            assert any(inside.intersects(piece) for piece in pieces[first:last])


def test_random_has_some_thirty_to_forty_five_shapes() -> None:
    counts = [len(problem_class("random").draw(0, i).obstacles.obstacle_starts) - 1 for i in range(200)]
    assert 30.0 <= np.mean(counts) <= 45.0


@pytest.mark.parametrize(("name", "difficulty"), [("maze", "standard"), ("trap", "brutal")])
def test_an_unknown_name_is_refused_with_the_known_ones(name: str, difficulty: str) -> None:
    known = CLASSES if name == "maze" else DIFFICULTIES
    with pytest.raises(ValueError, match=", ".join(known)):
        problem_class(name, difficulty)


@each_class
def test_kernels_equal_their_python_functions(drawn: ProblemClass) -> None:
    kernel = drawn.draw_obstacles
    assert isinstance(kernel, partial)
    compiled = kernel(generator(0, "kernel"))
    interpreted = kernel.func.py_func(*kernel.args, generator(0, "kernel"))
    for array, same in zip(compiled, interpreted, strict=True):
        assert np.allclose(array, same, rtol=0.0, atol=1e-5)  # a float32's last digit
