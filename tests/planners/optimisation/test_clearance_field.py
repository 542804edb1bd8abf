"""The clearance field against distances by shapely."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from planners.optimisation.clearance_field import clearance_field, least_clearance, signed_distances
from planners.world.arrays import Floats
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.problem import BOUNDS, Obstacles, Problem
from planners.world.vehicles.vehicle import CAR
from tests.planners.world.strategies import clutter, problem_with, seeds
from tests.worlds import box, problem_of


def true_distances(problem: Problem, points: Floats) -> Floats:
    """Signed distances ``[n]`` by shapely: to the nearest piece outside, to the union's outline inside."""
    pieces = [shapely.Polygon(piece) for piece in problem.obstacles.pieces()]
    union, where = shapely.union_all(pieces), shapely.points(points)
    outside = np.min([shapely.distance(where, piece) for piece in pieces], axis=0)
    inside = shapely.distance(where, union.boundary)
    signed = np.where(shapely.intersects(union, where), -inside, outside)
    low, high = points - problem.bounds[:2], np.array(problem.bounds[2:]) - points
    return np.minimum(signed, np.minimum(low, high).min(axis=1))


def clutter_of(seed: int) -> Obstacles:
    rng = np.random.default_rng(seed)
    return clutter(rng, int(rng.integers(1, 15)))


@given(seeds)
def test_nodes_hold_the_exact_distance(seed: int) -> None:
    problem = problem_with(clutter_of(seed))
    field = clearance_field(problem, 4.0)
    columns, rows = np.indices(field.distances.shape)
    nodes = field.corner + 4.0 * np.column_stack((columns.ravel(), rows.ravel()))
    np.testing.assert_allclose(field.distances.ravel(), true_distances(problem, nodes), atol=1e-6)


@pytest.mark.parametrize("name", CLASSES)
def test_between_nodes_the_spline_errs_by_centimetres(name: str) -> None:
    problem = problem_class(name).draw(7, 0)
    points = np.random.default_rng(7).uniform(-6.0, 56.0, (4000, 2))
    found = np.array(clearance_field(problem).symbolic().map(len(points))(points.T)).ravel()
    error = np.abs(found - true_distances(problem, points))
    assert np.quantile(error, 0.9) < 0.02
    assert error.max() < 0.1  # metres, at the ridges half way between obstacles


def test_without_obstacles_the_bounds_are_nearest() -> None:
    field = clearance_field(problem_of([]), 1.0).symbolic()
    assert float(field([25.0, 0.0])) == pytest.approx(7.0, abs=1e-6)
    assert float(field([-8.0, 20.0])) == pytest.approx(-1.0, abs=1e-6)


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_inside_is_negative_even_level_with_corners(x: float, y: float) -> None:
    square = np.array([[-2.0, -2, 2, -2], [2, -2, 2, 2], [2, 2, -2, 2], [-2, 2, -2, -2]])
    found = signed_distances(np.array([x]), np.array([y]), square, np.array(BOUNDS))[0, 0]
    beyond = np.maximum(np.abs([x, y]) - 2.0, 0.0)
    expected = np.hypot(*beyond) if beyond.any() else max(abs(x), abs(y)) - 2.0
    assert found == pytest.approx(expected, abs=1e-9)


def test_the_least_clearance_of_a_footprint_is_its_gap() -> None:
    states = np.array([[10.0, 10.0, 0.0, 1.0, 0.0], [11.0, 10.0, 0.0, 1.0, 0.0]])
    wall = box(15.8, 10.0, 0.0, 1.0, 3.0)  # begins at x = 14.8, the car ends at 12.8
    assert least_clearance(problem_of([wall]), states, CAR) == pytest.approx(2.0)
    assert least_clearance(problem_of([box(12.0, 10.0, 0.0, 0.1, 0.1)]), states, CAR) == 0.0
