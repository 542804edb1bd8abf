from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import cdist

from planners.memory.ranking.readout import centroids_of, nearest_readout
from planners.memory.ranking.scores import best_plans
from tests.planners.memory.untrained import PLANS, problems, untrained_memory

SEEDS = st.integers(0, 2**32 - 1)


@pytest.fixture(scope="module")
def memory(experiences):
    return untrained_memory(experiences)


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
    recalled = best_plans(memory.vectors @ embedding + memory.biases, k)
    bits, plan_index = problems()
    embeddings = memory.encoder(np.unpackbits(bits, axis=1).reshape(-1, 64, 64))
    scatter = (np.linalg.norm(embeddings - memory.centroids[plan_index + 1], axis=1) ** 2).mean()
    if distances[0] ** 2 + 2 * scatter < distances[1:].min() ** 2:
        assert len(recalled) == 0
    else:
        assert len(recalled) == min(k, PLANS)
        np.testing.assert_allclose(distances[1:][recalled], np.sort(distances[1:])[:k], rtol=1e-4, atol=1e-5)


def test_without_no_plan_problems_row_0_never_wins(memory):
    bits, plan_index = problems()
    embeddings = memory.encoder(np.unpackbits(bits, axis=1).reshape(-1, 64, 64))
    rows = np.where(plan_index < 0, -1, plan_index + 1)
    centroids, scatter = centroids_of(embeddings, rows, PLANS + 1)
    vectors, biases = nearest_readout(centroids, scatter)
    bare = dataclasses.replace(memory, centroids=centroids, vectors=vectors, biases=biases)
    scores = bare.vectors @ np.ones(6, np.float32) + bare.biases
    assert scores.argmax() > 0


def test_rows_that_do_not_fit_the_plans_are_refused(memory):
    with pytest.raises(ValueError, match="8 rows of biases; 8 plans need 9"):
        dataclasses.replace(memory, biases=memory.biases[1:])
