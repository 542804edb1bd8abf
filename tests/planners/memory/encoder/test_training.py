from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import softmax
from torch.optim.adamw import adamw

from planners.memory.encoder import training
from planners.memory.encoder.adamw import AdamW, one_cycle
from planners.memory.encoder.encoder import Architecture
from planners.memory.encoder.objectives import BIASES, VECTORS, Labels, Triplet
from planners.memory.encoder.splits import first_of_each, split
from planners.memory.encoder.training import OBJECTIVES, TrainingSettings, hit_rate
from planners.world.randomness import generator
from tasks.settings.presets import for_preset

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


def train(bits, plan_index, labels, *others, **named):
    """Plans that sweep no cells, so that everything has to be learned."""
    masks = np.zeros((labels.shape[1], 64), np.uint64)
    return training.train(bits, plan_index, labels, masks, *others, **named)


def settings(objective, **changes):
    return TrainingSettings(objective=objective, architecture=SMALL, epochs=4, batch=32, **changes)


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_training_is_deterministic(objective):
    bits, plan_index, labels = problems(300)
    first, second = (train(bits, plan_index, labels, settings(objective)) for _ in range(2))
    for name, weight in first.weights.items():
        assert (weight == second.weights[name]).all()
    assert [epoch[:-1] for epoch in first.history] == [epoch[:-1] for epoch in second.history]
    assert (first.held_out == second.held_out).all()
    other = train(bits, plan_index, labels, settings(objective, seed=1))
    assert (other.weights["linear.0.weight"] != first.weights["linear.0.weight"]).any()


def test_training_on_labels_finds_the_free_plans():
    heard = []
    trained = train(*problems(2000), settings("labels"), heard.append)
    history = trained.history
    assert [checkpoint.history for checkpoint in heard] == [history[: i + 1] for i in range(4)]
    assert [epoch.epoch for epoch in history] == [1, 2, 3, 4]
    assert history[-1].loss < history[0].loss
    assert history[-1].hit_1 > 0.9 * history[-1].oracle
    assert history[-1].hit_1 <= history[-1].hit_5 <= history[-1].oracle


def test_training_on_triplets_beats_chance():
    bits, plan_index, labels = problems(2000)
    trained = train(bits, plan_index, labels, settings("triplet"))
    assert trained.history[-1].hit_1 > labels.mean() + 0.2
    assert (trained.vectors == trained.centroids).all()


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("after", [1, 3, 4])
def test_training_goes_on_from_a_checkpoint_to_the_same_end(objective, after):
    given = problems(300)
    kept = []
    whole = train(*given, settings(objective), kept.append)
    resumed = train(*given, settings(objective), checkpoint=kept[after - 1])
    for name, weight in whole.weights.items():
        assert (weight == resumed.weights[name]).all()
    for name in ("centroids", "vectors", "biases"):
        assert (getattr(whole, name) == getattr(resumed, name)).all()
    assert [epoch[:-1] for epoch in whole.history] == [epoch[:-1] for epoch in resumed.history]
    assert resumed.history[-1].seconds >= kept[after - 1].history[-1].seconds


def test_a_checkpoint_of_another_network_is_refused():
    kept = []
    train(*problems(50), settings("labels"), kept.append)
    with pytest.raises(ValueError, match="was it made with the same settings"):
        train(*problems(50), TrainingSettings(), checkpoint=kept[0])


def test_training_ends_when_its_patience_does_and_keeps_the_best_epoch():
    asked = settings("labels", learning_rate=1e-9, patience=1)
    kept = []
    bits, plan_index, labels = problems(600)
    trained = train(bits, plan_index, labels, replace(asked, epochs=12), kept.append)
    hits = [epoch.hit_1 for epoch in trained.history]
    assert len(hits) == 12 or hits[-1] < max(hits)
    assert trained.score == max(hits)
    best = len(hits) - 1 - hits[::-1].index(max(hits))
    assert (kept[-1].best == kept[best].values).all()


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_problems_made_for_no_plan_are_learned_from_too(objective):
    bits, plan_index, labels = problems(900)
    drawn = np.arange(len(labels)) % 2 == 0
    plan_index[drawn] = -1
    trained = train(bits, plan_index, labels, settings(objective))
    assert trained.history[-1].hit_1 > labels.mean() + 0.2
    without = train(bits[~drawn], plan_index[~drawn], labels[~drawn], settings(objective))
    assert any((weight != without.weights[name]).any() for name, weight in trained.weights.items())


@given(seed=st.integers(0, 1000))
def test_the_triplet_loss_is_the_mean_over_checked_triplets(seed):
    _, plan_index, labels = problems(12, seed)
    embeddings = generator(seed).standard_normal((12, 5))
    targets = np.concatenate([~labels.any(1, keepdims=True), labels], 1)
    rows = plan_index.astype(np.int64) + 1
    rows[generator(seed, "drawn").random(12) < 0.3] = -1
    distances = np.linalg.norm(embeddings[:, None] - embeddings[None], axis=2)
    triplets = [
        (distances[a, s], distances[a, d])
        for a in range(12)
        for s in range(12)
        for d in range(12)
        if a != s and rows[s] >= 0 and targets[a, rows[s]] and not targets[d, rows[s]]
        if rows[d] < 0 or not targets[a, rows[d]]
    ]
    given = [torch.from_numpy(array) for array in (embeddings, rows, targets)]
    for semi_hard in (False, True):
        counted = [(s, d) for s, d in triplets if not semi_hard or s < d < s + 1.0]
        losses = [max(s - d + 1.0, 0.0) for s, d in counted]
        loss = Triplet(1.0, semi_hard).loss({}, *given)
        assert float(loss) == pytest.approx(np.mean(losses) if losses else 0.0, abs=1e-6)


@given(seed=st.integers(0, 1000))
def test_published_triplets_are_two_problems_of_a_plan_and_one_that_it_does_not_solve(seed):
    _, plan_index, labels = problems(12, seed)
    embeddings = generator(seed).standard_normal((12, 5))
    targets = np.concatenate([~labels.any(1, keepdims=True), labels], 1)
    rows = plan_index.astype(np.int64) + 1  # 0: no plan solves it
    distances = np.linalg.norm(embeddings[:, None] - embeddings[None], axis=2)
    losses = [
        max(distances[a, s] - distances[a, d] + 1.0, 0.0)
        for a, s, d in itertools.product(range(12), repeat=3)
        if a != s and rows[a] == rows[s] and not targets[d, rows[a]]
    ]
    given = (torch.from_numpy(array) for array in (embeddings, rows, targets))
    loss = Triplet(1.0, own_anchors=True).loss({}, *given)
    assert float(loss) == pytest.approx(np.mean(losses) if losses else 0.0, abs=1e-6)


def test_the_published_training_gives_equal_encoders_for_equal_seeds():
    bits, plan_index, labels = problems(300)
    published = for_preset("paper-method").learning.settings("triplet", 2, 7)
    around = plan_index >= 0
    one, other = (train(bits[around], plan_index[around], labels[around], published) for _ in range(2))
    assert all((weight == other.weights[name]).all() for name, weight in one.weights.items())
    assert (one.centroids == other.centroids).all()
    assert np.isinf(one.centroids[0]).all()  # no problems that no plan solves: nothing is ever nearest


@given(seed=st.integers(0, 1000))
def test_the_label_loss_is_the_sum_of_its_three_cross_entropies(seed):
    rng = generator(seed)
    targets = rng.random((9, 5)) < 0.4
    targets[:, 0] = ~targets[:, 1:].any(1)
    rows = np.array([rng.choice(np.flatnonzero(line)) for line in targets])
    rows[rng.random(9) < 0.3] = -1
    embeddings, vectors, biases = (rng.standard_normal(shape) for shape in ((9, 3), (5, 3), 5))
    logits = embeddings @ vectors.T + biases
    odds = 1.0 / (1.0 + np.exp(-logits))
    shares = softmax(logits, axis=1)
    each = -np.where(targets, np.log(odds), np.log(1.0 - odds)).sum(1).mean()
    first = -np.log((shares * targets).sum(1)).mean()
    origin = -sum(np.log(shares[i, row]) for i, row in enumerate(rows) if row >= 0) / 9
    own = {VECTORS: torch.from_numpy(vectors), BIASES: torch.from_numpy(biases)}
    given = [torch.from_numpy(array) for array in (embeddings, rows, targets)]
    assert float(Labels(0.5, 2.0).loss(own, *given)) == pytest.approx(each + 0.5 * first + 2.0 * origin)


def test_a_batch_without_triplets_has_no_loss_and_a_gradient():
    embeddings = torch.ones(3, 2, requires_grad=True)
    loss = Triplet(1.0).loss({}, embeddings, torch.tensor([1, 1, 1]), torch.ones(3, 2, dtype=torch.bool))
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
    assert torch.utils.deterministic.fill_uninitialized_memory


def test_what_cannot_be_trained_is_refused():
    bits, plan_index, labels = problems(10)
    with pytest.raises(ValueError, match="'wish'; choose one of labels, triplet"):
        TrainingSettings(objective="wish")
    with pytest.raises(ValueError, match=r"^0 epochs: give 1 or more.$"):
        TrainingSettings(epochs=0)
    with pytest.raises(ValueError, match=r"^learning_rate is nan: give a number above 0.$"):
        TrainingSettings(learning_rate=float("nan"))
    with pytest.raises(ValueError, match="leave problems to train with"):
        TrainingSettings(held_out_share=0.97)
    with pytest.raises(ValueError, match="one of each for every problem"):
        train(bits, plan_index[1:], labels, TrainingSettings())


def test_the_optimiser_steps_as_the_published_one():
    rng = generator(5)
    start, pulls = rng.standard_normal(7), rng.standard_normal((6, 7))
    ours, theirs = torch.tensor(start, requires_grad=True), torch.tensor(start)
    optimiser = AdamW(ours, weight_decay=0.1)
    means, squares, steps = torch.zeros_like(theirs), torch.zeros_like(theirs), torch.tensor(0.0)
    for pull in torch.from_numpy(pulls):
        optimiser.step(pull, 1e-2)
        adamw(  # torch.optim.AdamW takes seconds to import what compiles it
            [theirs], [pull], [means], [squares], [], [steps], foreach=False, amsgrad=False, maximize=False,
            lr=1e-2, beta1=0.9, beta2=0.999, eps=1e-8, weight_decay=0.1,
        )  # fmt: skip
    assert steps == len(pulls)
    torch.testing.assert_close(ours.detach(), theirs)


@given(steps=st.integers(4, 500))
def test_the_learning_rate_rises_to_its_highest_and_falls(steps):
    rates = np.array([one_cycle(step, steps, 1e-3) for step in range(steps)])
    top = int(rates.argmax())
    assert rates.max() <= 1e-3
    assert (np.diff(rates[: top + 1]) > 0.0).all()
    assert (np.diff(rates[top:]) < 0.0).all()
    assert rates.min() > 0.0


@given(seed=st.integers(0, 1000), count=st.integers(12, 200))
def test_a_split_has_every_problem_once(seed, count):
    _, plan_index, labels = problems(count, seed)
    plan_index[:PLANS] = np.arange(PLANS)
    parts = split(plan_index, labels, 0.05, 0.1)
    assert sorted(np.concatenate(parts).tolist()) == list(range(count))
    assert min(map(len, parts)) >= 1


def test_a_plan_without_problems_is_refused():
    bits, plan_index, labels = problems(100)
    kept = plan_index != 3
    with pytest.raises(ValueError, match=r"5 of 6 plans \(without problems: \[3\]\)"):
        train(bits[kept], plan_index[kept], labels[kept], TrainingSettings())


@given(st.lists(st.integers(-1, 5), max_size=40), st.integers(1, 4))
def test_the_first_of_each_value_are_those_of_a_plain_loop(values, count):
    found = first_of_each(np.array(values, np.int32), count)
    expected = [i for i, value in enumerate(values) if value >= 0 and values[:i].count(value) < count]
    assert found.tolist() == expected


def test_a_warm_start_begins_where_another_training_ended():
    given = problems(2000)
    first = train(*given, settings("labels"))
    short = replace(settings("labels"), epochs=1)
    cold, warm = train(*given, short), train(*given, short, warm=first.weights)
    assert warm.history[0].loss < 0.5 * cold.history[0].loss
    still = train(*given, replace(short, learning_rate=1e-9), warm=first.weights)
    for name, weight in first.weights.items():
        assert np.allclose(still.weights[name], weight, atol=1e-6)
    again = train(*given, short, warm=dict(reversed(first.weights.items())))
    assert all((again.weights[name] == weight).all() for name, weight in warm.weights.items())


def test_a_warm_start_from_a_network_of_another_size_is_refused():
    bits, plan_index, labels = problems(300)
    weights = train(bits, plan_index, labels, replace(settings("labels"), epochs=1)).weights
    other = replace(settings("labels"), architecture=Architecture((4,), (8,), 12))
    with pytest.raises(ValueError, match="weights to begin with are of"):
        train(bits, plan_index, labels, other, warm=weights)
