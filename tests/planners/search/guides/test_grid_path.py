import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from planners.search.guides.grid_path import grid_metres, grid_path
from planners.world.geometry.occupancy import CELL, GRID, drawing_of, occupancy_of
from planners.world.problem import BOUNDS
from planners.world.vehicles.vehicle import CAR
from tests.worlds import box, problem_of, strewn, walled_goal


def path_of(problem):
    return grid_path(drawing_of(problem).occupied, problem.start[:2], problem.goal, problem.goal_radius)


def cells_of(points):
    return np.floor((points - BOUNDS[:2]) / CELL).astype(int)


def steps_by_scipy(problem):
    """Fewest steps from the start's cell to a cell centre in the goal disc, by an independent search."""
    grid = occupancy_of(problem)
    free, number = grid == 0, np.arange(GRID * GRID).reshape(GRID, GRID)
    square = free[:-1, :-1] & free[:-1, 1:] & free[1:, :-1] & free[1:, 1:]  # around a corner of four cells
    steps = [
        (number[:, :-1], number[:, 1:], free[:, :-1] & free[:, 1:]),
        (number[:-1], number[1:], free[:-1] & free[1:]),
        (number[:-1, :-1], number[1:, 1:], square),
        (number[:-1, 1:], number[1:, :-1], square),
    ]
    ends = np.concatenate([np.stack((a[open_], b[open_])) for a, b, open_ in steps], axis=1)
    graph = coo_matrix((np.ones(ends.shape[1]), ends), (GRID * GRID, GRID * GRID))
    column, row = cells_of(np.array(problem.start[:2]))
    steps = dijkstra(graph, directed=False, unweighted=True, indices=row * GRID + column).reshape(GRID, GRID)
    centres = BOUNDS[0] + (np.arange(GRID) + 0.5) * CELL
    at_goal = np.hypot(centres - problem.goal[0], (centres - problem.goal[1])[:, None]) <= problem.goal_radius
    return steps[at_goal].min()


@given(seed=st.integers(0, 10**6), count=st.integers(0, 110))
@settings(max_examples=25, deadline=None)
def test_a_path_is_as_short_as_scipys_or_there_is_none(seed, count):
    problem = strewn(seed, count)
    path, fewest = path_of(problem), steps_by_scipy(problem)
    assert (path is None) == np.isinf(fewest)
    occupied = drawing_of(problem).occupied
    metres = grid_metres(occupied, problem.start[:2], problem.goal, problem.goal_radius)
    if path is None:
        assert np.isinf(metres)
    else:
        assert len(path) == fewest + 1
        np.testing.assert_allclose(metres, np.hypot(*np.diff(path, axis=0).T).sum())


@given(seed=st.integers(0, 10**6), count=st.integers(0, 60))
@settings(max_examples=25, deadline=None)
def test_a_body_as_wide_as_the_car_fits_along_a_path(seed, count):
    problem = strewn(seed, count)
    path = path_of(problem)
    if path is None:
        return
    strip = shapely.LineString(path).buffer(CAR.width / 2, cap_style="flat", join_style="mitre")
    obstacles = shapely.union_all([shapely.Polygon(piece) for piece in problem.obstacles.pieces()])
    assert strip.intersection(obstacles).area < 1e-9
    assert np.hypot(*(path[-1] - problem.goal)) <= problem.goal_radius
    assert np.abs(np.diff(cells_of(path), axis=0)).max() == 1


def test_what_is_walled_in_has_no_path():
    assert path_of(walled_goal()) is None
    assert path_of(problem_of([box(50, 50, 0.0, 3.0, 3.0)])) is None


def test_where_an_obstacle_touches_the_starts_cell_the_path_begins_beside_it():
    path = path_of(problem_of([box(0.9, 0.1, 0.0, 0.05, 0.05)]))
    assert np.abs(cells_of(path[0]) - cells_of(np.zeros(2))).max() == 1
