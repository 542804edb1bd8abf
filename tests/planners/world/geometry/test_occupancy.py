from __future__ import annotations

import numpy as np
import shapely
from hypothesis import given, settings

from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.geometry.occupancy import (
    CANONICAL_WINDOW,
    GRID,
    allocate_drawing,
    bits_of,
    draw,
    draw_occupancy,
    drawing_of,
    grid_of,
    occupancy_of,
    pack,
    unpack,
)
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
    drawings = []
    for draw_it in (draw, draw.py_func):  # type: ignore[attr-defined]
        drawing = allocate_drawing(len(obstacles.piece_starts))
        draw_it(obstacles.vertices, obstacles.piece_starts, BOUNDS, CANONICAL_WINDOW, drawing)
        drawings.append(drawing.occupied.copy())
    assert (drawings[0] == drawings[1]).all()
    grid = draw_occupancy(obstacles.vertices, obstacles.piece_starts, np.array(BOUNDS))
    assert (bits_of(grid) == drawings[0]).all()


@settings(max_examples=20, deadline=None)
@given(seeds)
def test_what_is_occupied_is_what_the_pieces_meet(seed: int) -> None:
    problem = problem_with(clutter(np.random.default_rng(seed), 20))
    drawing = drawing_of(problem)
    together = np.zeros(GRID, np.uint64)
    for i, piece in enumerate(problem.obstacles.pieces()):
        first, last = drawing.rows[i]
        rows = np.arange(first, last + 1)
        together[rows] |= drawing.pieces[i, rows]
        alone = drawing.pieces[i, rows].copy()
        assert (bits_of(occupancy_of(problem_with(obstacles_of([[piece]]))))[rows] == alone).all()
        drawing = drawing_of(problem)
    assert (together == drawing.occupied).all()


@settings(max_examples=20, deadline=None)
@given(seeds)
def test_bits_are_the_grid(seed: int) -> None:
    grid = np.random.default_rng(seed).integers(0, 2, (GRID, GRID), np.uint8)
    bits = bits_of(grid)
    assert (grid_of(bits) == grid).all()
    assert all(bool(int(bits[r]) >> c & 1) == grid[r, c] for r in range(0, GRID, 9) for c in range(GRID))


@settings(max_examples=20, deadline=None)
@given(seeds)
def test_a_packed_grid_comes_back(seed: int) -> None:
    grid = np.random.default_rng(seed).integers(0, 2, (GRID, GRID), np.uint8)
    packed = pack(grid)
    assert packed.shape == (512,)
    assert (unpack(packed) == grid).all()
