from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.memory.curation import AGAIN, ALIKE, choose, coverage, curate, similarity
from planners.memory.plans.cell_masks import masks_of
from planners.memory.plans.experience import Experience
from planners.memory.plans.free import free_plans
from planners.memory.plans.sweeps import sweep_plans
from planners.solve import solve
from planners.world.classes.problem_classes import problem_class
from planners.world.geometry.collision import scene_of
from planners.world.randomness import generator

SEEDS = st.integers(0, 2**32 - 1)
CLASS = problem_class("trap", "easy")


def drawn(seed: int, problems: int, plans: int, doubles: int = 0):
    """Labels and masks of plans, of which some are the same as others."""
    rng = generator(seed, "curation")
    labels = rng.random((problems, plans)) < rng.random(plans) ** 3
    cells = rng.random((plans, 64, 64)) < 0.1
    masks = np.packbits(cells, axis=2, bitorder="little").view("<u8").reshape(plans, 64)
    for _ in range(doubles):
        one, other = rng.integers(plans, size=2)
        labels[:, one], masks[one] = labels[:, other], masks[other]
    return labels, masks.astype(np.uint64)


def brute_force(labels, masks, count):
    """The same choice, every gain from the definition at every step."""
    order: list[int] = []
    aside: set[int] = set()
    for _ in range(count):
        weights = np.array([AGAIN**covered for covered in labels[:, order].sum(1)], float)
        left = [i for i in range(len(masks)) if i not in order and i not in aside]
        if not left:
            left, aside = [i for i in range(len(masks)) if i not in order], set()
        gains = [sum(weights[labels[:, i]].tolist()) for i in left]
        best = left[int(np.flatnonzero(np.isclose(gains, max(gains), rtol=1e-12, atol=0.0))[0])]
        order.append(best)
        aside |= {i for i in left if i != best and shared(masks[i], masks[best]) >= ALIKE}
    return order


def shared(one, other):
    both = sum(bin(a & b).count("1") for a, b in zip(one.tolist(), other.tolist(), strict=True))
    either = sum(bin(a | b).count("1") for a, b in zip(one.tolist(), other.tolist(), strict=True))
    return both / max(either, 1)


@given(seed=SEEDS, problems=st.integers(0, 40), plans=st.integers(1, 25), doubles=st.integers(0, 6))
def test_the_lazy_choice_is_that_of_a_brute_force_greedy(seed, problems, plans, doubles):
    labels, masks = drawn(seed, problems, plans, doubles)
    assert choose(labels, masks, plans).tolist() == brute_force(labels, masks, plans)


@given(seed=SEEDS, plans=st.integers(1, 30), share=st.floats(0.0, 1.0))
def test_coverage_grows_with_each_plan_and_fewer_are_the_beginning_of_more(seed, plans, share):
    labels, masks = drawn(seed, 50, plans)
    order = choose(labels, masks, plans)
    grown = coverage(labels, order)
    assert (np.diff(grown) >= 0.0).all()
    assert grown[-1] == labels.any(1).mean()
    count = int(share * plans)
    assert choose(labels, masks, count).tolist() == order[:count].tolist()
    assert sorted(order) == list(range(plans))


@given(seed=SEEDS, plans=st.integers(2, 20), doubles=st.integers(1, 12))
def test_two_that_are_alike_are_not_both_kept_while_others_are_left(seed, plans, doubles):
    labels, masks = drawn(seed, 30, plans, doubles)
    different = len({mask.tobytes() for mask in masks})
    kept = choose(labels, masks, different)
    assert len({masks[i].tobytes() for i in kept}) == different
    assert all(similarity(masks[kept], masks[i]).max() <= 1.0 for i in kept)


def test_plans_that_answer_no_problem_are_kept_last():
    labels, masks = drawn(3, 60, 20)
    labels[:, ::2] = False
    labels[:10, 1::2] |= np.eye(10, dtype=bool)  # each of the others answers some
    assert set(choose(labels, masks, 10).tolist()) == set(range(1, 20, 2))


def test_nothing_is_like_a_plan_that_leaves_the_window():
    _, masks = drawn(0, 1, 4)
    masks[:2] = ~np.uint64(0)
    assert similarity(masks, masks[0]).tolist() == [0.0] * 4
    assert similarity(masks, masks[2]).tolist()[2] == 1.0


def test_labels_and_masks_must_be_of_the_same_plans():
    labels, masks = drawn(0, 5, 4)
    for wrong in ((labels[:, :3], masks, 2), (labels, masks, 5), (labels, masks, -1)):
        with pytest.raises(ValueError, match="cannot be chosen"):
            choose(*wrong)


@pytest.fixture(scope="module")
def candidates():
    drawn = [CLASS.draw(911, i) for i in range(60)]
    solved = [(problem, solve(problem, "follow").plan) for problem in drawn]
    return [Experience(problem, plan) for problem, plan in solved if plan is not None]


def test_chosen_plans_answer_more_new_problems_than_the_first(candidates):
    kept = curate(candidates, 10)
    sweeps = sweep_plans([candidate.plan for candidate in candidates])
    labels = np.stack([free_plans(sweeps, scene_of(CLASS.draw(912, i))) for i in range(300)])
    chosen, first = labels[:, kept].any(1).mean(), labels[:, :10].any(1).mean()
    assert chosen > first + 0.02
    assert labels[:, kept].mean() > 1.3 * labels[:, :10].mean()


def test_a_plans_own_problem_says_nothing_of_it(candidates):
    labels = np.stack(
        [free_plans(sweep_plans([c.plan for c in candidates]), scene_of(c.problem)) for c in candidates]
    )
    assert labels.diagonal().all()
    np.fill_diagonal(labels, False)
    masks = masks_of(sweep_plans([candidate.plan for candidate in candidates]))
    assert curate(candidates, 20).tolist() == choose(labels, masks, 20).tolist()


def test_as_many_as_there_are_stay_in_their_order(candidates):
    assert curate(candidates[:5], 5).tolist() == list(range(5))
    assert curate(candidates[:5], 9).tolist() == list(range(5))
