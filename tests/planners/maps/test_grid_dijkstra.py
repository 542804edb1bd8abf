"""Ways over a grid are as short as SciPy's, and each step of one is a step that the map allows."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse
from scipy.sparse import csgraph

from planners.maps.global_path import GlobalPaths
from planners.maps.grid_dijkstra import OCCUPIED, distances_to
from planners.maps.occupancy_map import OccupancyMap
from planners.world.arrays import Integers


def steps_of(parts: Integers) -> dict[tuple[int, int], float]:
    """The length of each step between two cells that the map allows."""
    columns = parts.shape[1]
    steps = {}
    for row, column in np.argwhere(parts != OCCUPIED).tolist():
        for down, right in product((-1, 0, 1), repeat=2):
            to, beside, above = (
                parts[row + down, column + right],
                parts[row, column + right],
                parts[row + down, column],
            )
            if (down, right) != (0, 0) and to == parts[row, column] and OCCUPIED not in (beside, above):
                ends = row * columns + column, (row + down) * columns + column + right
                steps[ends] = math.hypot(down, right)
    return steps


@given(
    seed=st.integers(0, 10**6),
    shape=st.tuples(st.integers(1, 25), st.integers(1, 25)),
    occupied=st.floats(0.0, 0.6),
    rooms=st.integers(1, 3),
)
def test_distances_are_the_shortest_and_ways_keep_them(
    seed: int, shape: tuple[int, int], occupied: float, rooms: int
) -> None:
    rng = np.random.default_rng(seed)
    inner = np.where(rng.random(shape) < occupied, OCCUPIED, np.sort(rng.integers(0, rooms, shape), axis=1))
    parts = np.pad(inner.astype(np.int32), 1, constant_values=OCCUPIED)
    goal = int(rng.integers(parts.size))
    steps = steps_of(parts)
    ends = np.array([*steps], np.int64).reshape(-1, 2).T
    graph = sparse.csr_array(([*steps.values()], tuple(ends)), shape=(parts.size, parts.size))
    far, after = distances_to(goal, parts)
    np.testing.assert_allclose(far, csgraph.dijkstra(graph, indices=goal), atol=1e-6)
    assert np.array_equal(after >= 0, np.isfinite(far) & (np.arange(parts.size) != goal))
    for cell in np.flatnonzero(after >= 0).tolist():
        assert math.isclose(far[cell], far[after[cell]] + steps[cell, int(after[cell])], abs_tol=1e-6)


@given(x=st.floats(-1e6, 1e6), y=st.floats(-1e6, 1e6))
def test_no_path_leads_to_or_from_a_place_outside_of_the_map(x: float, y: float) -> None:
    paths = GlobalPaths(OccupancyMap("free", np.zeros((4, 6), bool), 0.5))
    outside, inside = np.array([x, y]), np.array([1.1, 0.7])
    if not (0.0 <= x < 3.0 and 0.0 <= y < 2.0):
        assert paths.path(inside, outside) is None
        assert paths.path(outside, inside) is None
