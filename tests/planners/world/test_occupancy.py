from __future__ import annotations

import numpy as np
import shapely
from hypothesis import given, settings

from planners.world.classes import CLASSES, problem_class
from planners.world.occupancy import GRID, draw_occupancy, occupancy_of, pack, unpack
from planners.world.problem import BOUNDS, Problem, obstacles_of
from tests.planners.world.strategies import clutter, problem_with, seeds

LOW = BOUNDS[0] + np.arange(GRID)
CELLS = shapely.box(*np.meshgrid(LOW, LOW), *np.meshgrid(LOW + 1.0, LOW + 1.0))  # [row, column]


def assert_right(problem: Problem) -> None:
    """Shapely agrees with the grid, cells that are only just touched aside."""
    union = shapely.union_all([shapely.Polygon(piece) for piece in problem.obstacles.pieces()])
    inside = shapely.box(*problem.bounds)
    grid = occupancy_of(problem) == 1
    reached = shapely.intersects(CELLS, union.buffer(1e-9)) | ~shapely.covers(inside, CELLS)
    well_reached = shapely.intersects(CELLS, union.buffer(-1e-9)) | ~shapely.covers(inside, CELLS)
    assert not (grid & ~reached).any()
    assert not (well_reached & ~grid).any()


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_a_cell_is_set_exactly_where_its_square_meets_an_obstacle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    assert_right(problem_with(clutter(rng, 20)))


@settings(max_examples=10, deadline=None)
@given(seeds)
def test_cells_that_are_not_wholly_inside_the_bounds_are_set(seed: int) -> None:
    rng = np.random.default_rng(seed)
    bounds = (*rng.uniform(-10.0, 0.0, 2).tolist(), *rng.uniform(50.0, 60.0, 2).tolist())
    assert_right(problem_with(clutter(rng, 3), bounds))


def test_every_class_is_drawn_right() -> None:
    for name in CLASSES:
        for index in range(3):
            assert_right(problem_class(name).draw(0, index))


def test_row_is_y_and_column_is_x() -> None:
    grid = occupancy_of(problem_with(obstacles_of([[np.array([[10.2, 20.2], [10.8, 20.2], [10.5, 20.8]])]])))
    assert np.argwhere(grid).tolist() == [[27, 17]]


def test_an_empty_problem_has_an_empty_grid() -> None:
    assert not occupancy_of(problem_with(obstacles_of([]))).any()


@settings(max_examples=10, deadline=None)
@given(seeds)
def test_the_kernel_equals_its_python_function(seed: int) -> None:
    obstacles = clutter(np.random.default_rng(seed), 5)
    arguments = (obstacles.vertices, obstacles.piece_starts, np.array(BOUNDS))
    assert (draw_occupancy(*arguments) == draw_occupancy.py_func(*arguments)).all()  # type: ignore[attr-defined]


@settings(max_examples=20, deadline=None)
@given(seeds)
def test_a_packed_grid_comes_back(seed: int) -> None:
    grid = np.random.default_rng(seed).integers(0, 2, (GRID, GRID), np.uint8)
    packed = pack(grid)
    assert packed.shape == (512,)
    assert (unpack(packed) == grid).all()
