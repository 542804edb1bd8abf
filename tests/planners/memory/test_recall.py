from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import cdist

from planners.memory.build_memory import build_memory
from planners.memory.encoder import Architecture, Encoder, initial_weights, to_onnx
from planners.memory.readout import centroids_of, label_readout, nearest_readout
from planners.memory.recall import nearest, rank, recall, scores
from planners.memory.training import TrainedEncoder, TrainingSettings
from planners.world.randomness import generator

PLANS = 8
SEEDS = st.integers(0, 2**32 - 1)
ARCHITECTURE = Architecture(channels=(2, 2), hidden=(), dimensions=6)


def problems(seed=0):
    rng = generator(seed, "recall")
    plan_index = np.repeat(np.arange(-1, PLANS), 3).astype(np.int32)
    density = rng.uniform(0.05, 0.5, (len(plan_index), 1))
    return np.packbits(rng.random((len(plan_index), 4096)) < density, axis=1), plan_index


@pytest.fixture(scope="module")
def memory(experiences):
    weights = initial_weights(ARCHITECTURE, generator(0, "weights"))
    bits, plan_index = problems()
    embeddings = Encoder(to_onnx(weights))(np.unpackbits(bits, axis=1).reshape(-1, 64, 64))
    centroids, scatter = centroids_of(embeddings, plan_index + 1, PLANS + 1)
    trained = TrainedEncoder(
        TrainingSettings(objective="triplet", architecture=ARCHITECTURE),
        weights,
        centroids,
        *nearest_readout(centroids, scatter),
        np.zeros(PLANS, np.float32),
        (),
        np.empty(0, np.int32),
    )
    return build_memory(trained, [e.plan for e in experiences], "boxes")


def test_centroids_are_the_mean_embeddings(memory):
    bits, plan_index = problems()
    grids = np.unpackbits(bits, axis=1).reshape(-1, 64, 64)
    for row in range(PLANS + 1):
        expected = memory.encoder(grids[plan_index == row - 1]).mean(0)
        np.testing.assert_allclose(memory.centroids[row], expected, atol=1e-6)


@given(seed=SEEDS, k=st.integers(1, 12))
def test_ranking_by_centroids_is_ranking_by_euclidean_distance(memory, seed, k):
    embedding = memory.encoder(np.unpackbits(problems(seed)[0][seed % 27]).reshape(64, 64))
    distances = cdist(embedding[np.newaxis], memory.centroids)[0]
    recalled = nearest(memory, embedding, k)
    bits, plan_index = problems()
    embeddings = memory.encoder(np.unpackbits(bits, axis=1).reshape(-1, 64, 64))
    scatter = (np.linalg.norm(embeddings - memory.centroids[plan_index + 1], axis=1) ** 2).mean()
    if distances[0] ** 2 + 2 * scatter < distances[1:].min() ** 2:
        assert recalled == ()
    else:
        assert len(recalled) == min(k, PLANS)
        np.testing.assert_allclose(
            distances[1:][list(recalled)], np.sort(distances[1:])[:k], rtol=1e-4, atol=1e-5
        )


@given(seed=SEEDS, k=st.integers(1, 8))
def test_recall_is_the_head_of_the_rank(memory, seed, k):
    grid = np.unpackbits(problems(seed)[0][seed % 27]).reshape(64, 64)
    order, no_plan = rank(memory, grid)
    assert sorted(order) == list(range(PLANS))
    assert recall(memory, grid, k) == (() if no_plan else tuple(order[:k]))


def test_nothing_is_recalled_where_row_0_scores_best(memory):
    hopeless = dataclasses.replace(memory, biases=np.array([1e6] + [0.0] * PLANS, np.float32))
    grid = np.zeros((64, 64), np.uint8)
    assert recall(hopeless, grid, 5) == ()
    assert rank(hopeless, grid)[1]


def test_equal_scores_are_recalled_in_order_of_storing(memory):
    flat = dataclasses.replace(
        memory, vectors=np.zeros_like(memory.vectors), biases=np.zeros_like(memory.biases)
    )
    assert recall(flat, np.zeros((64, 64), np.uint8), 3) == (0, 1, 2)


def test_without_no_plan_problems_row_0_never_wins(memory):
    bits, plan_index = problems()
    embeddings = memory.encoder(np.unpackbits(bits, axis=1).reshape(-1, 64, 64))
    rows = np.where(plan_index < 0, -1, plan_index + 1)
    centroids, scatter = centroids_of(embeddings, rows, PLANS + 1)
    vectors, biases = nearest_readout(centroids, scatter)
    bare = dataclasses.replace(memory, centroids=centroids, vectors=vectors, biases=biases)
    assert scores(bare, np.ones(6, np.float32)).argmax() > 0


def test_rows_that_do_not_fit_the_plans_are_refused(memory):
    with pytest.raises(ValueError, match="8 rows of biases, 8 plans need 9"):
        dataclasses.replace(memory, biases=memory.biases[1:])


def test_k_below_one_is_refused(memory):
    with pytest.raises(ValueError, match="at least 1"):
        nearest(memory, np.zeros(6, np.float32), 0)


@given(seed=SEEDS)
def test_the_label_readout_is_what_was_learned_but_for_the_odds_of_no_plan(seed):
    rng = generator(seed)
    vectors, biases = rng.standard_normal((PLANS + 1, 6)), rng.standard_normal(PLANS + 1)
    ready = label_readout(vectors.astype(np.float32), biases.astype(np.float32))
    assert (ready[0] == vectors.astype(np.float32)).all()
    assert (ready[1][1:] == biases.astype(np.float32)[1:]).all()
    assert ready[1][0] == pytest.approx(biases[0] - np.log(20.0), abs=1e-5)
