from __future__ import annotations

import itertools

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from planners.maps.occupancy_map import Cells
from planners.maps.rectangles import Rectangles, rectangles_of

grids = arrays.arrays(bool, st.tuples(st.integers(1, 9), st.integers(1, 9)))


def painted(found: Rectangles, shape: tuple[int, ...]) -> np.ndarray:
    """How many rectangles cover each cell."""
    times = np.zeros(shape, int)
    for first_row, last_row, first_column, last_column in zip(*found, strict=True):
        times[first_row:last_row, first_column:last_column] += 1
    return times


def fewest(occupied: Cells) -> int:
    """The least number of rectangles, by trying all that begin at the first cell left."""
    if not occupied.any():
        return 0
    row, column = np.unravel_index(int(np.argmax(occupied)), occupied.shape)
    least = occupied.size
    for last_row, last_column in itertools.product(
        range(int(row) + 1, occupied.shape[0] + 1), range(int(column) + 1, occupied.shape[1] + 1)
    ):
        if occupied[row:last_row, column:last_column].all():
            rest = occupied.copy()
            rest[row:last_row, column:last_column] = False
            least = min(least, 1 + fewest(rest))
    return least


@given(occupied=grids)
def test_rectangles_cover_exactly_the_occupied_cells_once(occupied: Cells) -> None:
    assert np.array_equal(painted(rectangles_of(occupied), occupied.shape), occupied)


@given(occupied=arrays.arrays(bool, st.tuples(st.integers(1, 4), st.integers(1, 4))))
def test_no_partition_has_fewer_rectangles(occupied: Cells) -> None:
    assert len(rectangles_of(occupied).first_rows) == fewest(occupied)


@given(occupied=grids)
def test_the_number_of_rectangles_knows_no_up_and_no_left(occupied: Cells) -> None:
    counts = {
        len(rectangles_of(turned).first_rows)
        for turned in (occupied, occupied.T, occupied[::-1], occupied[:, ::-1])
    }
    assert len(counts) == 1


def test_crossing_chords_are_not_both_cut() -> None:
    cross = np.zeros((9, 9), bool)
    cross[3:6] = True
    cross[:, 3:6] = True
    assert len(rectangles_of(cross).first_rows) == 3
    comb = np.ones((4, 9), bool)
    comb[2:, 1::2] = False
    assert len(rectangles_of(comb).first_rows) == 6
