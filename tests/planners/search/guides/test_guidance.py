from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.search.guides.guidance import SPACING_M, guidance, published_guidance
from planners.search.guides.sampling import guided
from planners.world.problem import BOUNDS
from planners.world.randomness import generator


def way(length):
    return np.random.default_rng(length).uniform(0.0, 20.0, (length, 5))


@pytest.mark.parametrize("make", [guidance, published_guidance])
@given(lengths=st.lists(st.integers(1, 30), min_size=1, max_size=10))
def test_the_better_a_way_the_more_it_guides_and_the_goal_and_the_rest_come_last(make, lengths):
    guide = make([way(length) for length in lengths])
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


@given(lengths=st.lists(st.integers(1, 30), min_size=1, max_size=10))
def test_the_papers_guide_holds_every_state_of_the_plans_in_their_order(lengths):
    guide = published_guidance([way(length) for length in lengths])
    np.testing.assert_array_equal(guide.points, np.concatenate([way(length)[:, :2] for length in lengths]))
    assert guide.starts.tolist() == [0, *itertools.accumulate(lengths)]


def test_the_papers_targets_lie_near_the_plans_as_often_as_the_probabilities_say():
    corners = np.array([[5.0, 40.0], [25.0, 25.0], [40.0, 5.0]])  # of three plans, far from the goal
    guide = published_guidance([corner + np.linspace(0.0, 3.0, 7)[:, None] for corner in corners])
    goal, bounds, bits = np.array([50.0, 50.0, 2.0]), np.array(BOUNDS), generator(0).bit_generator
    draws = np.array([guided(guide, goal, bounds, 2.0, 4.0, bits) for _ in range(3000)])
    np.testing.assert_array_equal(draws[:, :2], draws[:, 2:])
    apart = np.hypot(*(draws[:, None, :2] - guide.points).T).T.reshape(-1, 3, 7).min(2)  # of each plan
    shares = [*(apart <= 4.0).mean(0), (np.hypot(*(draws[:, :2] - goal[:2]).T) <= 2.0).mean()]
    b_other = 1.0 - guide.probabilities.sum() - guide.goal_probability
    assert shares == pytest.approx([*guide.probabilities, guide.goal_probability], abs=0.2 * b_other + 0.03)
    assert 2.5 < apart.min(1)[apart.min(1) <= 4.0].max() <= 4.0


def test_without_ways_there_is_no_guidance():
    with pytest.raises(ValueError, match="search without a guide"):
        guidance([])
