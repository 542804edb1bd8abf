"""The distance to go over the grid, beside SciPy's Dijkstra search over the same cells."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from planners.search.structures.cost_to_go import (
    BESIDE,
    BLOCKED,
    DIAGONAL,
    METRES,
    STRAIGHT,
    allocate_cost_to_go,
    fill_cost_to_go,
    metres_to_go,
)
from planners.world.geometry.occupancy import CANONICAL_WINDOW, CELL, GRID, Window, bits_of
from planners.world.problem import BOUNDS

GO = allocate_cost_to_go()


def by_scipy(grid, sources):
    """Costs [64, 64] to the source cells, each step as dear as the cell that it leaves."""
    padded = np.pad(grid, 1)
    beside = padded[:-2, 1:-1] | padded[2:, 1:-1] | padded[1:-1, :-2] | padded[1:-1, 2:]
    factor = np.where(grid, BLOCKED, np.where(beside, BESIDE, 1.0))
    rows, columns = np.indices((GRID, GRID))
    links = []
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            r, c = rows + down, columns + right
            inside = (r >= 0) & (r < GRID) & (c >= 0) & (c < GRID) & bool(down or right)
            unit = DIAGONAL if down and right else STRAIGHT
            # towards the goal from (rows, columns) means from the goal to it: edges run outwards
            links.append(
                np.stack(
                    [
                        (rows * GRID + columns)[inside],
                        (r * GRID + c)[inside],
                        np.floor(factor * unit)[inside],
                    ]
                )
            )
    edges = np.concatenate(links, axis=1)
    graph = coo_array((edges[2], edges[:2].astype(int)), shape=(GRID**2, GRID**2)).tocsr()
    return dijkstra(graph, indices=np.flatnonzero(sources), min_only=True).reshape(GRID, GRID)


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.6), st.floats(-6, 56), st.floats(-6, 56), st.floats(0, 4))
def test_costs_are_those_of_a_search_by_scipy(seed, share, x, y, radius):
    grid = np.random.default_rng(seed).random((GRID, GRID)) < share
    fill_cost_to_go(bits_of(grid.astype(np.uint8)), x, y, radius, CANONICAL_WINDOW, GO)
    centres = BOUNDS[0] + (np.arange(GRID) + 0.5) * CELL
    sources = np.hypot(centres[None, :] - x, centres[:, None] - y) <= radius
    sources[int((y - BOUNDS[1]) / CELL), int((x - BOUNDS[0]) / CELL)] = True
    assert np.array_equal(GO.costs, by_scipy(grid, sources))


@given(st.floats(-7, 57), st.floats(-7, 57))
def test_in_the_open_the_cost_is_nearly_the_distance(x, y):
    fill_cost_to_go(bits_of(np.zeros((GRID, GRID), np.uint8)), 50.0, 50.0, 2.0, CANONICAL_WINDOW, GO)
    distance = max(np.hypot(x - 50.0, y - 50.0) - 2.0, 0.0)
    assert distance - 1.5 <= metres_to_go(x, y, GO) <= 1.09 * distance + 1.5


def test_a_step_in_the_open_costs_its_length():
    fill_cost_to_go(bits_of(np.zeros((GRID, GRID), np.uint8)), 50.0, 50.0, 2.0, CANONICAL_WINDOW, GO)
    assert STRAIGHT * GO.frame[METRES] == CELL
    assert abs(DIAGONAL * GO.frame[METRES] - CELL * 2**0.5) < 0.02


@given(st.floats(-200, 200), st.floats(-200, 200), st.floats(0.1, 3.0))
def test_beyond_the_window_the_way_to_it_is_estimated(x, y, cell):
    window = Window(-32.0 * cell, -32.0 * cell, cell)
    fill_cost_to_go(bits_of(np.zeros((GRID, GRID), np.uint8)), 0.0, 0.0, 2.0, window, GO)
    distance = max(np.hypot(x, y) - 2.0, 0.0)
    off = 3.0 + 1.5 * cell  # of the border, and of the cells
    assert distance - off <= metres_to_go(x, y, GO) <= 1.42 * distance + off
