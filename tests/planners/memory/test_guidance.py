from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.memory.guidance import guidance
from planners.world.problem import Plan


def plan(length):
    return Plan(np.random.default_rng(length).random((length, 5)), np.zeros((length - 1, 2)))


@given(lengths=st.lists(st.integers(1, 30), min_size=1, max_size=10))
def test_the_better_a_plan_the_more_it_guides_and_the_goal_and_the_rest_come_last(lengths):
    plans = [plan(length) for length in lengths]
    guide = guidance(plans)
    b_other = 1.0 - guide.probabilities.sum() - guide.goal_probability
    chain = [*guide.probabilities, guide.goal_probability, b_other]
    assert all(a > b for a, b in itertools.pairwise(chain))
    assert b_other > 0.0
    for i, each in enumerate(plans):
        points = guide.points[guide.starts[i] : guide.starts[i + 1]]
        assert (points == each.states[:, :2]).all()


def test_without_plans_there_is_no_guidance():
    with pytest.raises(ValueError, match="search without a guide"):
        guidance([])
