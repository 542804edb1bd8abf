"""What a window shows is what the map holds there, by shapely and cell by cell."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.maps.occupancy_map import OccupancyMap
from planners.maps.pieces import pieces_of
from planners.maps.surroundings import surroundings_of
from planners.world.arrays import Floats
from planners.world.problem import BOUNDS, CANONICAL_GOAL, CANONICAL_START
from tests.planners.maps.agreement import cells_shape, disagreements
from tests.planners.maps.samples import town

TOWN = town()


def with_rim(world: OccupancyMap) -> shapely.Geometry:
    """What is occupied of a map, and all around it."""
    rim = shapely.box(-1e3, -1e3, 2e3, 2e3).difference(shapely.box(0.0, 0.0, *world.size))
    shape = shapely.union(cells_shape(world.occupied, world.resolution), rim)
    shapely.prepare(shape)
    return shape


OUTLINES = with_rim(TOWN)

poses = st.tuples(st.floats(5.0, 295.0), st.floats(5.0, 295.0), st.floats(-math.pi, math.pi))


def in_grid(points: Floats, pose: tuple[float, float, float], scale: float) -> Floats:
    """Canonical ``points [n, 2]`` in grid metres, seen from a pose."""
    turn = pose[2] - math.pi / 4.0
    cos, sin = math.cos(turn), math.sin(turn)
    return scale * points @ np.array([[cos, sin], [-sin, cos]]) + pose[:2]


@settings(max_examples=10)
@given(pose=poses, scale=st.sampled_from([1.0, 0.5, 2.0]))
def test_the_free_space_of_a_problem_is_that_of_the_map(
    pose: tuple[float, float, float], scale: float
) -> None:
    problem = surroundings_of(TOWN, scale).problem(*pose, "p", "town")
    assert disagreements(problem, OUTLINES, 400, lambda points: in_grid(points, pose, scale)) == 0


@pytest.mark.parametrize("tolerance", [0.4, 1.0, 1.5])
def test_outlines_move_by_no_more_than_the_tolerance(tolerance: float) -> None:
    pieces = shapely.union_all(pieces_of(TOWN, tolerance))
    cells = cells_shape(TOWN.occupied, TOWN.resolution)
    assert pieces.difference(cells.buffer(tolerance + 1e-6)).area == pytest.approx(0.0, abs=1e-6)
    assert cells.buffer(-tolerance - 1e-6).difference(pieces).area == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("tolerance", [0.0, 1.0])
def test_pieces_are_convex_and_a_tolerance_makes_them_fewer(tolerance: float) -> None:
    pieces = pieces_of(TOWN, tolerance)
    assert shapely.is_valid(pieces).all()
    assert np.allclose(shapely.area(shapely.convex_hull(pieces)), shapely.area(pieces), rtol=1e-9)
    if tolerance:
        assert len(pieces) < 0.8 * len(pieces_of(TOWN))


@given(pose=poses)
def test_a_cut_problem_is_canonical_and_touching_pieces_are_one_obstacle(
    pose: tuple[float, float, float],
) -> None:
    problem = surroundings_of(TOWN, 2.0).problem(*pose, "p", "town")
    assert (problem.start, problem.goal, problem.bounds) == (CANONICAL_START, CANONICAL_GOAL, BOUNDS)
    assert problem.scale == 2.0
    vertices, piece_starts, obstacle_starts = problem.obstacles
    assert np.array_equal(vertices, vertices.astype(np.float32))
    assert obstacle_starts[-1] == len(piece_starts) - 1
    assert piece_starts[-1] == len(vertices)
    shapes = [
        shapely.union_all([shapely.Polygon(p).buffer(1e-4) for p in problem.obstacles.pieces()[first:last]])
        for first, last in pairwise(obstacle_starts)
    ]
    assert all(shape.geom_type == "Polygon" for shape in shapes)


def test_outside_of_the_map_all_is_occupied() -> None:
    empty = OccupancyMap("empty", np.zeros((100, 100), bool), 1.0)
    problem = surroundings_of(empty).problem(50.0, 50.0, math.pi / 4, "p", "empty")
    beyond = shapely.union_all([shapely.Polygon(piece) for piece in problem.obstacles.pieces()])
    assert beyond.symmetric_difference(
        shapely.box(*BOUNDS).difference(shapely.box(-50.0, -50.0, 50.0, 50.0))
    ).area == pytest.approx(0.0, abs=1e-2)
