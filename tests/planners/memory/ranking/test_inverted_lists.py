from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.memory.ranking.inverted_lists import best_listed, list_readout, lists_with
from planners.world.randomness import generator

PLANS, DIMENSIONS = 3000, 30
SEEDS = st.integers(0, 2**32 - 1)


def readout(seed=0, plans=PLANS):
    """Rows that differ in a few ways, as those of plans do, and in length."""
    rng = generator(seed, "rows")
    ways = rng.standard_normal((plans + 1, 6)) @ rng.standard_normal((6, DIMENSIONS))
    vectors = ways + 0.2 * rng.standard_normal((plans + 1, DIMENSIONS))
    return vectors.astype(np.float32), rng.standard_normal(plans + 1).astype(np.float32)


def scored(embedding):
    vectors, biases = readout()
    return (vectors.astype(np.float64) @ embedding + biases)[1:]


@pytest.fixture(scope="module")
def lists():
    return list_readout(*readout())


def test_every_plan_stands_in_one_list_with_its_own_row(lists):
    vectors, biases = readout()
    assert sorted(lists.plans.tolist()) == list(range(PLANS))
    np.testing.assert_array_equal(lists.rows[:, :-1], vectors[1:][lists.plans])
    np.testing.assert_array_equal(lists.rows[:, -1], biases[1:][lists.plans])


@settings(max_examples=20)
@given(seed=SEEDS, k=st.integers(1, 40))
def test_all_lists_together_find_what_scoring_every_plan_finds(lists, seed, k):
    embedding = generator(seed).standard_normal(DIMENSIONS).astype(np.float32)
    best = best_listed(lists, embedding, k, probes=len(lists.centres))
    scores = scored(embedding)
    assert len(set(best.tolist())) == k
    np.testing.assert_allclose(scores[best], np.sort(scores)[::-1][:k], atol=1e-3)


@settings(max_examples=10)
@given(seed=SEEDS)
def test_few_lists_find_most_of_the_best_plans(lists, seed):
    embeddings = generator(seed).standard_normal((30, DIMENSIONS)).astype(np.float32)
    found = 0
    for embedding in embeddings:
        scores = scored(embedding)
        best = best_listed(lists, embedding, 16)
        assert (np.diff(scores[best]) <= 1e-3).all()  # best first
        found += len(set(best.tolist()) & set(np.argsort(-scores)[:16].tolist()))
    assert found >= 0.7 * 16 * len(embeddings)


def test_the_same_readout_gives_the_same_lists(lists):
    for one, other in zip(list_readout(*readout()), lists, strict=True):
        np.testing.assert_array_equal(one, other)


def test_no_more_plans_are_found_than_there_are():
    few = list_readout(*readout(plans=3))
    assert sorted(best_listed(few, np.ones(DIMENSIONS, np.float32), 10).tolist()) == [0, 1, 2]


def test_lists_are_put_together_again_from_what_is_kept(lists):
    again = lists_with(lists.centres, lists.starts, lists.plans, *readout())
    for one, other in zip(again, lists, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("part", ["centres", "starts", "plans", "twice", "beyond", "backwards", "type"])
def test_lists_that_do_not_fit_are_refused(lists, part):
    centres, starts, plans = lists.centres, lists.starts.copy(), lists.plans.copy()
    if part == "centres":
        centres = centres[:-1]
    elif part == "starts":
        starts[-1] += 1
    elif part == "plans":
        plans = plans[1:]
    elif part == "twice":
        plans[0] = plans[1]
    elif part == "beyond":
        plans[0] = PLANS
    elif part == "backwards":
        starts[1] = starts[2] + 1
    else:
        plans = plans.astype(np.int64)
    with pytest.raises(ValueError, match="3000 plans"):
        lists_with(centres, starts, plans, *readout())


def test_plans_that_are_never_ranked_do_not_hide_the_others():
    vectors, biases = readout()
    never = np.arange(5, PLANS, 500)
    biases[never] = -np.inf
    lists = list_readout(vectors, biases)
    assert np.isfinite(lists.centres).all()
    assert sorted(lists.plans.tolist()) == list(range(PLANS))
    assert np.diff(lists.starts).max() < PLANS / 4
    found = best_listed(lists, vectors[7].astype(np.float32), 5)
    assert len(found)
    assert not set(found.tolist()) & set(never.tolist())
