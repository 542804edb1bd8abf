from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.search.guides.guidance import SPACING_M, guidance


def way(length):
    return np.random.default_rng(length).uniform(0.0, 20.0, (length, 5))


@given(lengths=st.lists(st.integers(1, 30), min_size=1, max_size=10))
def test_the_better_a_way_the_more_it_guides_and_the_goal_and_the_rest_come_last(lengths):
    guide = guidance([way(length) for length in lengths])
    b_other = 1.0 - guide.probabilities.sum() - guide.goal_probability
    chain = [*guide.probabilities, guide.goal_probability, b_other]
    assert all(a > b for a, b in itertools.pairwise(chain))
    assert b_other > 0.0


@given(lengths=st.lists(st.integers(1, 30), min_size=1, max_size=10))
def test_a_guide_holds_the_ways_in_their_order_with_points_apart(lengths):
    guide = guidance([way(length) for length in lengths])
    for i, length in enumerate(lengths):
        points = guide.points[guide.starts[i] : guide.starts[i + 1]]
        whole = way(length)[:, :2]
        assert (points[0] == whole[0]).all()
        assert (np.hypot(*np.diff(points, axis=0).T) >= SPACING_M).all()
        places = [int(np.flatnonzero((whole == point).all(axis=1))[0]) for point in points]
        assert places == sorted(places)


def test_without_ways_there_is_no_guidance():
    with pytest.raises(ValueError, match="search without a guide"):
        guidance([])
