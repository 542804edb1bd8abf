from __future__ import annotations

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Point, Polygon

from planners.memory.hallucination.maximal import Maximal, filled
from planners.world.geometry.occupancy import CELL, GRID, draw_occupancy
from planners.world.problem import BOUNDS, obstacles_of
from planners.world.randomness import generator
from planners.world.vehicles.bodies import box_corners

SEEDS = st.integers(0, 2**32 - 1)
EVERYWHERE = np.array([-np.inf, -np.inf, np.inf, np.inf])


def nothing(_):
    return obstacles_of([])


@given(seed=SEEDS)
@settings(max_examples=20)
def test_rectangles_fill_all_cells_that_are_not_free_and_no_other(seed):
    free = (generator(seed).random((GRID, GRID)) < generator(seed, "share").random()).astype(np.uint8)
    obstacles = filled(free)
    assert (draw_occupancy(obstacles.vertices, obstacles.piece_starts, EVERYWHERE) == 1 - free).all()
    rectangles = [Polygon(piece) for piece in obstacles.pieces()]
    tree = shapely.STRtree(rectangles)
    assert all(len(tree.query(rectangle, "intersects")) == 1 for rectangle in rectangles)


@given(seed=SEEDS, which=st.integers(0, 7), clearance=st.floats(0.0, 3.0))
@settings(max_examples=10)
def test_everything_outside_the_dilated_sweep_is_an_obstacle(experiences, seed, which, clearance):
    experience, size = experiences[which], 0.5 * CELL
    method = Maximal((clearance, clearance), (1.0, 1.0), (0.0, 0.0), (0.0, 0.0))
    obstacles = method.around(experience, generator(seed))(nothing, generator(seed))
    boxes = experience.boxes.reshape(-1, 6)
    dilated = shapely.union_all(
        [Polygon(corners) for corners in box_corners(boxes, clearance).reshape(-1, 4, 2)]
    )
    goal = Point(experience.problem.goal).buffer(experience.problem.goal_radius, quad_segs=32)
    kept = shapely.union_all([dilated, goal])
    solid = shapely.union_all([Polygon(piece) for piece in obstacles.pieces()])
    assert not solid.intersects(kept)
    roomy = kept.buffer(2.0 * size * np.sqrt(2.0) + 0.05)  # a cell's diagonal, and the polygon for the disc
    x, y = generator(seed, "places").uniform(BOUNDS[0] + 0.01, BOUNDS[2] - 0.01, (2, 500))
    outside = ~shapely.contains_xy(roomy, x, y)
    near = shapely.distance(solid, shapely.points(x[outside], y[outside]))
    assert (near < 2e-3).all()  # in a rectangle, or in the seam of a millimetre between two


@given(seed=SEEDS)
@settings(max_examples=5)
def test_clearance_scale_and_discs_vary_between_problems(experiences, seed):
    sample = Maximal().around(experiences[0], generator(seed))
    rng = generator(seed, "sample")
    areas = {round(sum(Polygon(piece).area for piece in sample(nothing, rng).pieces())) for _ in range(6)}
    assert len(areas) > 3
