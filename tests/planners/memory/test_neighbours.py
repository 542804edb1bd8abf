from __future__ import annotations

import mmap

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.memory.neighbours import Neighbours, index_readout
from planners.world.randomness import generator

PLANS, DIMENSIONS = 3000, 30


def readout(seed=0, plans=PLANS):
    """Rows that differ in a few ways, as those of plans do, and in length."""
    rng = generator(seed, "neighbours")
    ways = rng.standard_normal((plans + 1, 6)) @ rng.standard_normal((6, DIMENSIONS))
    vectors = ways + 0.2 * rng.standard_normal((plans + 1, DIMENSIONS))
    return vectors.astype(np.float32), rng.standard_normal(plans + 1).astype(np.float32)


@pytest.fixture(scope="module")
def indexed():
    return index_readout(*readout())


@settings(max_examples=20)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_index_finds_what_scoring_every_plan_finds(indexed, seed):
    vectors, biases = readout()
    embeddings = generator(seed).standard_normal((20, DIMENSIONS)).astype(np.float32)
    found = 0
    for embedding in embeddings:
        scores = (vectors @ embedding + biases)[1:]
        best = indexed.best(embedding, 16)
        assert len(set(best.tolist())) == 16
        assert (np.diff(scores[best]) <= 1e-4).all()  # best first
        found += len(set(best.tolist()) & set(np.argsort(-scores)[:16].tolist()))
    assert found >= 0.7 * 16 * len(embeddings)


def test_the_same_readout_gives_the_same_bytes(indexed):
    assert index_readout(*readout()).contents == indexed.contents


def test_an_index_is_used_where_it_lies(indexed, tmp_path):
    (tmp_path / "index").write_bytes(indexed.contents)
    embedding = np.ones(DIMENSIONS, np.float32)
    with (tmp_path / "index").open("rb") as file:
        mapped = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    found = Neighbours(memoryview(mapped), PLANS, DIMENSIONS).best(embedding, 10)
    np.testing.assert_array_equal(found, indexed.best(embedding, 10))


def test_no_more_plans_are_found_than_there_are():
    few = index_readout(*readout(plans=3))
    assert sorted(few.best(np.ones(DIMENSIONS, np.float32), 10).tolist()) == [0, 1, 2]


@pytest.mark.parametrize("length", [0, 10, 50, 1000])
def test_an_index_that_was_cut_off_is_refused(indexed, length):
    with pytest.raises(ValueError, match=r"index|End of file"):
        Neighbours(indexed.contents[:length], PLANS, DIMENSIONS)


def test_an_index_of_other_plans_is_refused(indexed):
    with pytest.raises(ValueError, match="not of 7 plans"):
        Neighbours(indexed.contents, 7, DIMENSIONS)
    with pytest.raises(ValueError, match="5 numbers each"):
        Neighbours(indexed.contents, PLANS, 5)
