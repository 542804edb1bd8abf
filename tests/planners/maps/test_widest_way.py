"""The narrowest place of the widest way between two places."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from planners.maps.occupancy_map import OccupancyMap
from planners.maps.widest_way import narrowest_gap

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
    gap = narrowest_gap(walls([(low, low + min(slim, wide - 2)), (high, high + wide)]), START, GOAL, 1.0)
    assert gap is not None
    assert abs(gap.width - CELL_M * wide) <= 0.5 * CELL_M + 1e-9
    assert 8.0 <= gap.place[0] <= 8.3
    assert CELL_M * high <= gap.place[1] <= CELL_M * (high + wide)


@given(one=st.integers(3, 25), other=st.integers(3, 25))
def test_of_two_walls_the_narrower_door_counts(one: int, other: int) -> None:
    gap = narrowest_gap(walls([(20, 20 + one)], [(100, 100 + other)]), START, GOAL, 1.0)
    assert gap is not None
    assert abs(gap.width - CELL_M * min(one, other)) <= 0.5 * CELL_M + 1e-9
    if abs(one - other) > 1:
        assert math.isclose(gap.place[0], 8.15 if one < other else 12.15, abs_tol=0.2)


def test_where_no_wall_is_or_no_door_there_is_no_gap() -> None:
    assert narrowest_gap(walls(), START, GOAL, 1.0) is None
    assert narrowest_gap(walls([]), START, GOAL, 1.0) is None


def test_places_at_the_edge_of_a_coarse_map_are_on_it() -> None:
    gap = narrowest_gap(walls([(20, 30)]), START, (20.0, 16.0), 0.01)
    assert gap is None  # the corner is narrower than the door
