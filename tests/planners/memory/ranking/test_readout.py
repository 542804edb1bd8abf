from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.memory.ranking.readout import label_readout
from planners.memory.ranking.scores import best_plans
from planners.world.randomness import generator

PLANS = 8
SEEDS = st.integers(0, 2**32 - 1)


@given(
    seed=SEEDS,
    k=st.integers(1, 30) | st.integers(1000, 2000),
    count=st.integers(1, 30) | st.integers(1000, 2000),
)
def test_the_best_are_those_of_a_stable_sort(seed, k, count):
    rng = generator(seed, "best")
    vectors = rng.integers(-2, 3, (count + 1, 4)).astype(np.float32)
    biases = rng.integers(-2, 3, count + 1).astype(np.float32)
    embedding = rng.integers(-2, 3, 4).astype(np.float32)
    scores = vectors @ embedding + biases
    expected = np.argsort(-scores[1:], kind="stable")[:k].tolist()
    assert best_plans(scores, k, never_none=True).tolist() == expected
    nothing = scores[0] > scores[1:].max()
    assert best_plans(scores, k).tolist() == ([] if nothing else expected)


@given(seed=SEEDS)
def test_the_label_readout_is_what_was_learned_but_for_the_odds_of_no_plan(seed):
    rng = generator(seed)
    vectors, biases = rng.standard_normal((PLANS + 1, 6)), rng.standard_normal(PLANS + 1)
    ready = label_readout(vectors.astype(np.float32), biases.astype(np.float32))
    assert (ready[0] == vectors.astype(np.float32)).all()
    assert (ready[1][1:] == biases.astype(np.float32)[1:]).all()
    assert ready[1][0] == pytest.approx(biases[0] - np.log(20.0), abs=1e-5)
