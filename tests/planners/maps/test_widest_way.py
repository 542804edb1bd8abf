"""The narrowest place of the widest way between two places."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage, sparse
from scipy.sparse import csgraph

from planners.maps.occupancy_map import OccupancyMap
from planners.maps.widest_way import middle_of, narrowest_gap

CELL_M = 0.1
START, GOAL = (3.0, 8.0), (17.0, 8.0)


def walls(*gaps: list[tuple[int, int]]) -> OccupancyMap:
    """A hall of 20 x 16 m; walls across it, each with gaps from one row to another."""
    occupied = np.zeros((160, 200), bool)
    for number, of_wall in enumerate(gaps):
        column = 80 + 40 * number
        occupied[:, column : column + 3] = True
        for first, last in of_wall:
            occupied[first:last, column : column + 3] = False
    return OccupancyMap("hall", occupied, CELL_M)


@given(wide=st.integers(4, 30), slim=st.integers(2, 30), low=st.integers(10, 60), high=st.integers(95, 120))
def test_of_two_doors_the_wider_one_counts(wide: int, slim: int, low: int, high: int) -> None:
    gap = narrowest_gap(walls([(low, low + min(slim, wide - 2)), (high, high + wide)]), START, GOAL)
    assert gap is not None
    assert CELL_M * wide - 1e-9 <= gap.width <= CELL_M * (wide + 1) + 1e-9
    assert 8.0 <= gap.place[0] <= 8.3
    assert CELL_M * high <= gap.place[1] <= CELL_M * (high + wide)


@given(one=st.integers(3, 25), other=st.integers(3, 25))
def test_of_two_walls_the_narrower_door_counts(one: int, other: int) -> None:
    gap = narrowest_gap(walls([(20, 20 + one)], [(100, 100 + other)]), START, GOAL)
    assert gap is not None
    assert CELL_M * min(one, other) - 1e-9 <= gap.width <= CELL_M * (min(one, other) + 1) + 1e-9
    at = [8.15 if one <= other + 1 else 12.15, 12.15 if other <= one + 1 else 8.15]
    assert min(abs(gap.place[0] - each) for each in at) <= 0.2


def test_where_no_wall_is_or_no_door_there_is_no_gap() -> None:
    assert narrowest_gap(walls(), START, GOAL) is None
    assert narrowest_gap(walls([]), START, GOAL) is None


@pytest.mark.parametrize("slit", [0, 3])
def test_a_hall_behind_a_thin_wall_does_not_count(slit: int) -> None:
    """Start and goal lie in a lane 1.4 m wide beside a hall; its door is found, not the slit to the hall."""
    occupied = np.zeros((160, 200), bool)
    occupied[14] = True
    occupied[14, 100 : 100 + slit] = False
    lane = OccupancyMap("lane", occupied, CELL_M)
    assert narrowest_gap(lane, (3.0, 0.5), (17.0, 0.5)) is None
    occupied[:4, 150] = True
    gap = narrowest_gap(lane, (3.0, 0.5), (17.0, 0.5))
    assert gap is not None
    assert 15.0 <= gap.place[0] <= 15.1
    assert 1.0 - 1e-9 <= gap.width <= 1.1 + 1e-9


def coarse_door(resolution: float, cells: int) -> OccupancyMap:
    """A wall across a map of 40 x 30 cells, with a door."""
    occupied = np.zeros((30, 40), bool)
    occupied[:, 20] = True
    occupied[10 : 10 + cells, 20] = False
    return OccupancyMap("coarse", occupied, resolution)


@given(resolution=st.sampled_from([0.5, 1.0, 2.0]), cells=st.integers(1, 8))
def test_doors_of_coarse_maps_are_never_told_too_narrow(resolution: float, cells: int) -> None:
    far = 39.9 * resolution, 29.9 * resolution
    gap = narrowest_gap(coarse_door(resolution, cells), (0.0, 0.0), far)
    assert gap is not None
    assert resolution * cells <= gap.width + 1e-9 <= resolution * (cells + 1) + 1e-6


@given(resolution=st.sampled_from([0.5, 1.0, 2.0]), cells=st.integers(1, 8))
def test_the_width_of_doors_that_matter_is_told_exactly_on_coarse_maps(resolution: float, cells: int) -> None:
    """A door of one cell counted as two cells wide, so no vehicle was led through it."""
    far = 39.9 * resolution, 29.9 * resolution
    gap = narrowest_gap(coarse_door(resolution, cells), (0.0, 0.0), far, most=3.9 * resolution)
    assert (gap is None) == (cells > 3)
    assert gap is None or gap.width == pytest.approx(cells * resolution)


def bottleneck(world: OccupancyMap, start: tuple[int, int], goal: tuple[int, int]) -> float:
    """The least clearance on the widest way between two cells, by a maximum spanning tree of SciPy."""
    clear = ndimage.distance_transform_edt(np.pad(~world.occupied, 1))[1:-1, 1:-1]
    cells = np.arange(clear.size).reshape(clear.shape)
    tails = np.concatenate([cells[:, :-1].ravel(), cells[:-1].ravel()])
    heads = np.concatenate([cells[:, 1:].ravel(), cells[1:].ravel()])
    least = np.minimum(clear.ravel()[tails], clear.ravel()[heads])
    free = least > 0.0
    graph = sparse.csr_array((-least[free], (tails[free], heads[free])), shape=(clear.size, clear.size))
    tree = csgraph.minimum_spanning_tree(graph)
    _, before = csgraph.breadth_first_order(tree, cells[start], directed=False)
    at, narrowest = int(cells[goal]), math.inf
    while at != cells[start]:
        if before[at] < 0:
            return 0.0
        narrowest = min(narrowest, clear.ravel()[at], clear.ravel()[before[at]])
        at = int(before[at])
    return narrowest


@given(seed=st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_the_width_is_that_of_the_widest_way(seed: int) -> None:
    rng = np.random.default_rng(seed)
    world = OccupancyMap("random", rng.random((20, 24)) < 0.12, 1.0)
    clear = ndimage.distance_transform_edt(np.pad(~world.occupied, 1))[1:-1, 1:-1]
    peaks = np.argwhere((clear == ndimage.maximum_filter(clear, 3)) & (clear > 1.0))
    start, goal = (tuple(each.tolist()) for each in rng.choice(peaks, 2))
    gap = narrowest_gap(world, *((column + 0.5, row + 0.5) for row, column in (start, goal)))
    narrowest = bottleneck(world, start, goal)
    if gap is None:
        assert narrowest in (0.0, math.inf, min(clear[start], clear[goal]))
    else:
        assert gap.width == pytest.approx(2.0 * narrowest)
        x, y = gap.place
        assert clear[int(y), int(x)] == pytest.approx(narrowest)


@given(
    wide=st.floats(0.8, 2.0),
    angle=st.floats(-1.2, 1.2),
    off=st.floats(-3.0, 3.0),
    thickness=st.floats(0.15, 0.8),
    backwards=st.booleans(),
)
def test_the_pose_in_a_door_is_in_its_middle_and_leads_through(
    wide: float, angle: float, off: float, thickness: float, backwards: bool
) -> None:
    y, x = CELL_M * (np.indices((200, 200)) + 0.5) - 10.0
    across = x * math.cos(angle) + y * math.sin(angle)
    along = y * math.cos(angle) - x * math.sin(angle)
    world = OccupancyMap(
        "door", (np.abs(across) < 0.5 * thickness) & (np.abs(along - off) > 0.5 * wide), CELL_M
    )
    sides = [(10.0 + by * math.cos(angle), 10.0 + by * math.sin(angle)) for by in (-5.0, 5.0)]
    gap = narrowest_gap(world, *(sides[::-1] if backwards else sides))
    assert gap is not None
    pose = middle_of(gap, world)
    assert pose is not None
    dx, dy = pose[0] - 10.0, pose[1] - 10.0
    assert abs(dy * math.cos(angle) - dx * math.sin(angle) - off) <= 1.5 * CELL_M
    assert abs(dx * math.cos(angle) + dy * math.sin(angle)) <= 0.5 * thickness + 1.5 * CELL_M
    turned = math.remainder(pose[2] - angle - math.pi * backwards, math.tau)
    assert abs(turned) <= math.atan2(thickness + 2.0 * CELL_M, wide)
