from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from planners.memory.build_memory import build_memory
from planners.memory.encoder.encoder import Architecture, initial_weights
from planners.memory.encoder.training import TrainedEncoder, TrainingSettings
from planners.memory.growth import RIDGE, grow, moments_of, ridge_readout, scatter
from planners.memory.plans.cell_masks import masks_of
from planners.memory.plans.free import free_plans
from planners.memory.ranking.readout import mean_embeddings
from planners.world.geometry.collision import scene_of
from planners.world.geometry.occupancy import occupancy_of
from planners.world.randomness import generator
from tests.planners.memory.conftest import boxes, problem_around

SEEDS = st.integers(0, 2**32 - 1)
ARCHITECTURE = Architecture(channels=(2,), hidden=(), dimensions=4)


def some(seed, problems=60, plans=7, width=4):
    rng = generator(seed, "growth")
    embeddings = rng.standard_normal((problems, width)).astype(np.float32) * 3 + 1
    return embeddings, rng.random((problems, plans)) < rng.uniform(0.0, 0.6, plans)


def with_row_0(labels):
    return np.column_stack((~labels.any(1), labels))


@given(seed=SEEDS)
def test_moments_and_centroids_are_of_the_problems_in_which_a_plan_is_free(seed):
    embeddings, labels = some(seed)
    moments = moments_of(embeddings, iter(labels), labels.shape[1])
    centroids = mean_embeddings(moments.sums, moments.counts).astype(np.float32)
    distances = []
    for row, free in enumerate(with_row_0(labels).T):
        assert moments.counts[row] == free.sum()
        if not free.any():
            assert np.isinf(centroids[row]).all()
            continue
        np.testing.assert_allclose(centroids[row], embeddings[free].mean(0), rtol=1e-4, atol=1e-4)
        distances.append(np.square(embeddings[free] - centroids[row]).sum(1))
    np.testing.assert_allclose(scatter(moments, centroids), np.concatenate(distances).mean(), rtol=1e-3)


@given(seed=SEEDS)
def test_the_readout_minimises_the_regularised_squared_error(seed):
    embeddings, labels = some(seed)
    vectors, biases = ridge_readout(embeddings, moments_of(embeddings, iter(labels), labels.shape[1]))
    weight = RIDGE * np.var(embeddings, axis=0, dtype=np.float64).mean()
    free = labels[:, 2].astype(float)

    def loss(parameters):
        errors = embeddings @ parameters[:4] + parameters[4] - free
        return np.square(errors).mean() + weight * np.square(parameters[:4]).sum()

    best = minimize(loss, np.zeros(5), method="BFGS")
    np.testing.assert_allclose([*vectors[3], biases[3]], best.x, atol=1e-4)


@given(seed=SEEDS, kept=st.integers(1, 6))
def test_rows_of_plans_stay_when_plans_are_added(seed, kept):
    embeddings, labels = some(seed)
    few = ridge_readout(embeddings, moments_of(embeddings, iter(labels[:, :kept]), kept))
    many = ridge_readout(embeddings, moments_of(embeddings, iter(labels), labels.shape[1]))
    for before, after in zip(few, many, strict=True):
        np.testing.assert_allclose(before[1:], after[1 : kept + 1], rtol=1e-5, atol=1e-6)


@pytest.fixture(scope="module")
def memory(experiences):
    weights = initial_weights(ARCHITECTURE, generator(0, "weights"))
    rng = generator(1, "readout")
    vectors, biases = rng.standard_normal((4, 4)).astype(np.float32), np.zeros(4, np.float32)
    settings = TrainingSettings(architecture=ARCHITECTURE)
    trained = TrainedEncoder(
        settings, weights, vectors, vectors, biases, np.zeros(3, np.float32), (), np.empty(0, np.int32)
    )
    return build_memory(trained, [each.plan for each in experiences[:3]], "boxes")


@pytest.fixture(scope="module")
def problems(experiences):
    return [problem_around(experiences[0].plan, boxes(generator(5, i)), f"p-{i}") for i in range(40)]


@pytest.mark.parametrize("objective", ["labels", "triplet"])
def test_a_grown_memory_has_all_plans_and_the_same_encoder(memory, experiences, problems, objective):
    plans = [each.plan for each in experiences]
    grown = grow(dataclasses.replace(memory, objective=objective), plans, problems)
    assert grown.plans == plans
    assert grown.weights is memory.weights
    assert len(grown.vectors) == len(plans) + 1
    np.testing.assert_array_equal(grown.masks, masks_of(grown.sweeps))
    embeddings = np.stack([memory.encoder(occupancy_of(problem)) for problem in problems])
    free = np.stack([free_plans(grown.sweeps, scene_of(problem)) for problem in problems])
    for i in np.flatnonzero(free.any(0)):
        np.testing.assert_allclose(grown.centroids[i + 1], embeddings[free[:, i]].mean(0), rtol=1e-3)


def test_growth_needs_plans_and_problems(memory, problems):
    with pytest.raises(ValueError, match="cannot be read out from 0 problems"):
        grow(memory, memory.plans, [])
    with pytest.raises(ValueError, match="a memory of 0 plans"):
        grow(memory, [], problems)
