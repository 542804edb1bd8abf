from __future__ import annotations

import math

import numpy as np
import shapely
from hypothesis import given
from hypothesis import strategies as st

from planners.memory.plans.cell_masks import (
    MOST_CELLS,
    count_blocked_cells,
    masks_of,
    rank_by_cells,
    rank_to_try,
)
from planners.memory.plans.free import free_plans
from planners.memory.plans.sweeps import sweep_plans
from planners.world.geometry.collision import scene_of
from planners.world.geometry.occupancy import bits_of, grid_of, occupancy_of
from planners.world.problem import Plan
from planners.world.randomness import generator
from planners.world.vehicles.bodies import swept_boxes
from planners.world.workspace import Workspace
from tests.worlds import strewn

SEEDS = st.integers(0, 2**32 - 1)


def wandering(seed: int) -> Plan:
    """A plan that nobody could drive, 40 m in a few turns from somewhere in the window."""
    rng = generator(seed, "masks")
    headings = np.cumsum(rng.normal(0.0, 0.2, 100)) + rng.uniform(-math.pi, math.pi)
    speeds = np.full(100, rng.uniform(-1.0, 4.0))
    places = rng.uniform(0.0, 50.0, 2) + np.cumsum(
        0.1 * speeds[:, None] * np.column_stack((np.cos(headings), np.sin(headings))), axis=0
    )
    return Plan(np.column_stack((places, headings, speeds, np.zeros(100))), np.zeros((99, 2)))


@given(seed=SEEDS)
def test_masks_are_the_cells_that_the_sweep_meets(seed):
    plan = wandering(seed)
    boxes = swept_boxes(plan.states)
    along, across = boxes[:, 2:4], boxes[:, 3:1:-1] * [-1.0, 1.0]
    half_long, half_wide = boxes[:, 4:5] * along, boxes[:, 5:6] * across
    corners = boxes[:, None, :2] + np.stack(
        (-half_long - half_wide, half_long - half_wide, half_long + half_wide, half_wide - half_long), 1
    )
    sweep = shapely.union_all(shapely.polygons(corners))
    left, bottom = np.meshgrid(np.arange(-7.0, 57.0), np.arange(-7.0, 57.0))
    inside = bool(np.all((corners > -7.0) & (corners < 57.0)))
    drawn = grid_of(masks_of(sweep_plans([plan]))[0]) == 1
    if not inside:
        assert drawn.all()
        return
    shared = shapely.area(shapely.intersection(shapely.box(left, bottom, left + 1, bottom + 1), sweep))
    apart = shapely.distance(shapely.box(left, bottom, left + 1, bottom + 1), sweep)
    assert drawn[shared > 1e-6].all()
    assert not drawn[apart > 1e-5].any()


@given(seed=SEEDS, problems=st.integers(0, 5), plans=st.integers(1, 7), share=st.floats(0.0, 1.0))
def test_blocked_cells_are_those_that_both_have(seed, problems, plans, share):
    rng = generator(seed, "blocked")
    swept, occupied = rng.random((plans, 64, 64)) < 0.3, rng.random((problems, 64, 64)) < share
    swept[0] = seed % 2  # leaves the window, or sweeps nothing
    blocked = np.empty((problems, plans), np.int32)
    count_blocked_cells(bits_of(swept), bits_of(occupied), blocked)
    shared = np.minimum((swept & occupied[:, None]).sum((2, 3)), MOST_CELLS)
    shared[:, swept.all((1, 2))] = MOST_CELLS
    assert np.array_equal(blocked, shared)


@given(seed=SEEDS, count=st.integers(0, 40))
def test_a_plan_whose_cells_no_obstacle_meets_is_free(seed, count):
    problem = strewn(seed, count)
    sweeps = sweep_plans([wandering(seed + i) for i in range(6)])
    ranking = rank_by_cells(masks_of(sweeps), bits_of(occupancy_of(problem)))
    assert free_plans(sweeps, scene_of(problem))[ranking.cells == 0].all()


@given(seed=SEEDS, count=st.integers(1, 60))
def test_plans_are_ranked_by_the_cells_that_they_share_with_obstacles(seed, count):
    rng = generator(seed, "rank")
    masks = rng.integers(0, 2**64, (count, 64), np.uint64) & rng.integers(0, 2**64, (count, 1), np.uint64)
    masks[rng.random((count, 64)) < 0.9] = 0
    masks[rng.random(count) < 0.1] = ~np.uint64(0)
    occupied = rng.integers(0, 2**64, 64, np.uint64)
    shared = np.bitwise_count(masks & occupied).sum(axis=1, dtype=int)
    shared[masks[:, 0] == ~np.uint64(0)] = MOST_CELLS  # they leave the window
    ranking = rank_by_cells(masks, occupied)
    assert ranking.cells.tolist() == np.minimum(shared, MOST_CELLS).tolist()
    assert ranking.order.tolist() == np.argsort(np.minimum(shared, MOST_CELLS), kind="stable").tolist()
    for most in (0, 10, MOST_CELLS):
        assert ranking.ends[most] == (shared <= most).sum()


def test_a_plan_that_leaves_the_window_is_never_taken_for_free():
    outside = Plan(np.tile([60.0, 60.0, 0.0, 0.0, 0.0], (3, 1)), np.zeros((2, 2)))
    ranking = rank_by_cells(masks_of(sweep_plans([outside])), np.zeros(64, np.uint64))
    assert ranking.cells.tolist() == [MOST_CELLS]


@given(
    seed=SEEDS,
    plans=st.integers(1, 40),
    likely=st.integers(0, 20),
    possible=st.integers(0, 20),
)
def test_likely_plans_are_tried_by_driving_time_and_then_some_possible_ones_by_cells(
    seed, plans, likely, possible
):
    rng = generator(seed, "tries")
    possible += likely
    masks = rng.integers(0, 2**64, (plans, 64), np.uint64) & rng.integers(0, 2**64, (plans, 64), np.uint64)
    occupied = np.where(rng.random(64) < 0.05, rng.integers(0, 2**64, 64, np.uint64), np.uint64(0))
    by_cost = rng.permutation(plans).astype(np.int32)
    ranking, tries = rank_to_try(masks, occupied, by_cost, likely, possible, Workspace())
    cells = np.bitwise_count(masks & occupied).sum(1)
    np.testing.assert_array_equal(ranking.cells, cells)
    first = [i for i in by_cost if cells[i] <= likely]
    others = [i for i in np.argsort(cells, kind="stable") if likely < cells[i] <= possible]
    assert tries.tolist() == first + others[: 2 * len(first)]
