from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from planners.memory.encoder import Architecture
from planners.memory.objectives import Triplet
from planners.memory.training import OBJECTIVES, TrainingSettings, hit_rate, train
from planners.world.randomness import generator

PLANS = 6
SMALL = Architecture(channels=(4, 8), hidden=(32,), dimensions=12)


def problems(count=900, seed=0):
    """Six columns of the grid as plans: a plan is free where its column has no block."""
    rng = generator(seed, "columns")
    labels = rng.random((count, PLANS)) < 0.35
    grids = rng.random((count, 64, 64)) < 0.05
    for p in range(PLANS):
        grids[:, 20:30, 10 * p + 2 : 10 * p + 8] = ~labels[:, p, None, None]
    order = rng.random((count, PLANS))
    plan_index = np.where(labels.any(1), np.argmax(labels * order, axis=1), -1).astype(np.int32)
    return np.packbits(grids.reshape(count, -1), axis=1), plan_index, labels


def settings(objective, **changes):
    return TrainingSettings(objective=objective, architecture=SMALL, epochs=4, batch=32, **changes)


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_training_is_deterministic(objective):
    bits, plan_index, labels = problems(300)
    first, second = (train(bits, plan_index, labels, settings(objective)) for _ in range(2))
    for name, weight in first.weights.items():
        assert (weight == second.weights[name]).all()
    assert [epoch[:-1] for epoch in first.history] == [epoch[:-1] for epoch in second.history]
    assert (first.validation == second.validation).all()
    other = train(bits, plan_index, labels, settings(objective, seed=1))
    assert (other.weights["linear.0.weight"] != first.weights["linear.0.weight"]).any()


def test_training_on_labels_finds_the_free_plans():
    heard = []
    trained = train(*problems(2000), settings("labels"), heard.append)
    assert tuple(heard) == trained.history
    assert [epoch.epoch for epoch in heard] == [1, 2, 3, 4]
    assert heard[-1].loss < heard[0].loss
    assert heard[-1].hit_1 > 0.9 * heard[-1].oracle
    assert heard[-1].hit_1 <= heard[-1].hit_5 <= heard[-1].oracle


def test_training_on_triplets_beats_chance():
    bits, plan_index, labels = problems(2000)
    trained = train(bits, plan_index, labels, settings("triplet"))
    assert trained.history[-1].hit_1 > labels.mean() + 0.2
    assert trained.vectors is None
    assert trained.biases is None


@given(seed=st.integers(0, 1000))
def test_the_triplet_loss_is_the_mean_over_checked_triplets(seed):
    _, plan_index, labels = problems(12, seed)
    embeddings = generator(seed).standard_normal((12, 5))
    targets = np.concatenate([~labels.any(1, keepdims=True), labels], 1)
    rows = plan_index.astype(np.int64) + 1
    distances = np.linalg.norm(embeddings[:, None] - embeddings[None], axis=2)
    losses = [
        max(distances[a, s] - distances[a, d] + 1.0, 0.0)
        for a in range(12)
        for s in range(12)
        for d in range(12)
        if a != s and targets[a, rows[s]] and not targets[a, rows[d]] and not targets[d, rows[s]]
    ]
    loss = Triplet(1.0).loss(*(torch.from_numpy(array) for array in (embeddings, rows, targets)))
    assert float(loss) == pytest.approx(np.mean(losses) if losses else 0.0, abs=1e-6)


def test_a_batch_without_triplets_has_no_loss_and_a_gradient():
    embeddings = torch.ones(3, 2, requires_grad=True)
    loss = Triplet(1.0).loss(embeddings, torch.tensor([1, 1, 1]), torch.ones(3, 2, dtype=torch.bool))
    torch.autograd.backward(loss)
    assert float(loss.detach()) == 0.0
    assert embeddings.grad is not None
    assert (embeddings.grad == 0.0).all()


@given(seed=st.integers(0, 1000), k=st.integers(1, 7))
def test_hit_rate_counts_problems_with_a_free_plan_among_the_first_k(seed, k):
    rng = generator(seed)
    scores = rng.permutation(20 * PLANS).reshape(20, PLANS).astype(np.float32)
    labels = rng.random((20, PLANS)) < 0.2
    best = [sorted(range(PLANS), key=lambda p: -row[p])[:k] for row in scores]
    hits = [labels[i, plans].any() for i, plans in enumerate(best)]
    assert hit_rate(scores, labels, k) == pytest.approx(np.mean(hits))


def test_training_leaves_torch_as_it_was():
    threads, deterministic = torch.get_num_threads(), torch.are_deterministic_algorithms_enabled()
    train(*problems(50), settings("labels"))
    assert torch.get_num_threads() == threads
    assert torch.are_deterministic_algorithms_enabled() == deterministic


def test_what_cannot_be_trained_is_refused():
    bits, plan_index, labels = problems(10)
    with pytest.raises(ValueError, match="'wish'; choose one of labels, triplet"):
        TrainingSettings(objective="wish")
    with pytest.raises(ValueError, match="cannot be trained with"):
        TrainingSettings(epochs=0)
    with pytest.raises(ValueError, match="one of each for every problem"):
        train(bits, plan_index[1:], labels, TrainingSettings())
