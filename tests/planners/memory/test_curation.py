from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.memory.curation import LEFT, MISSED_S, choose, coverage, curate
from planners.memory.plans.experience import Experience
from planners.memory.plans.free import free_plans
from planners.memory.plans.sweeps import sweep_plans
from planners.solve import solve
from planners.world.classes.problem_classes import problem_class
from planners.world.geometry.collision import scene_of
from planners.world.problem import Plan
from planners.world.randomness import generator

SEEDS = st.integers(0, 2**32 - 1)
CLASS = problem_class("trap", "easy")


def drawn(seed: int, problems: int, plans: int):
    """Labels and driving times of plans, what the problems cost without any, and whose plans they are."""
    rng = generator(seed, "curation")
    labels = rng.random((problems, plans)) < rng.random(plans) ** 3
    owners = rng.permutation(plans)
    return labels, rng.uniform(18.0, 30.0, plans), rng.uniform(20.0, 32.0, problems), owners


def choice(labels, durations, without, owners, count):
    return choose(labels, durations, without, count, owners).tolist()


def brute_force(labels, durations, without, owners, count):
    """The same choice, every gain from the definition at every step."""
    costs, unmet, order = without.copy(), np.ones(len(without)), []
    for _ in range(count):
        savings = np.where(labels, np.maximum(costs[:, None] - durations, 0.0), 0.0)
        gains = savings.sum(0) if savings[:, ~np.isin(owners, owners[order])].any() else unmet @ labels
        gains[np.isin(owners, owners[order])] = -1.0
        best = int(np.flatnonzero(np.isclose(gains, gains.max(), rtol=1e-12, atol=1e-12))[0])
        order.append(best)
        costs -= (1.0 - LEFT) * savings[:, best]
        unmet[labels[:, best]] *= LEFT
    return order


@given(seed=SEEDS, problems=st.integers(0, 40), plans=st.integers(1, 25), variants=st.integers(1, 3))
def test_the_lazy_choice_is_that_of_a_brute_force_greedy(seed, problems, plans, variants):
    *drawing, owners = drawn(seed, problems, plans)
    owners //= variants
    count = len(set(owners.tolist()))
    chosen = choice(*drawing, owners, count)
    assert chosen == brute_force(*drawing, owners, count)
    assert len(set(owners[chosen].tolist())) == count


@given(seed=SEEDS, plans=st.integers(1, 30), share=st.floats(0.0, 1.0))
def test_fewer_are_the_beginning_of_more(seed, plans, share):
    labels, durations, without, owners = drawn(seed, 50, plans)
    order = choose(labels, durations, without, plans, owners)
    grown = coverage(labels, order)
    assert (np.diff(grown) >= 0.0).all()
    assert grown[-1] == labels.any(1).mean()
    count = int(share * plans)
    assert choice(labels, durations, without, owners, count) == order[:count].tolist()
    assert sorted(order) == list(range(plans))


def test_of_two_plans_that_fit_alike_the_quicker_is_kept():
    labels = np.ones((10, 2), bool)
    assert choice(labels, np.array([21.0, 20.0]), np.full(10, 25.0), np.arange(2), 1) == [1]


def test_where_no_plan_saves_driving_those_that_are_free_in_more_problems_come_first():
    labels = np.zeros((30, 6), bool)
    labels[:20, 4] = labels[15:, 2] = True
    assert choice(labels, np.full(6, 30.0), np.full(30, 25.0), np.arange(6), 2) == [4, 2]


def test_plans_that_answer_no_problem_are_kept_last():
    labels, _, without, owners = drawn(3, 60, 20)
    labels[:, ::2] = False
    labels[:10, 1::2] |= np.eye(10, dtype=bool)  # each of the others answers some
    assert set(choice(labels, np.full(20, 18.0), without, owners, 10)) == set(range(1, 20, 2))


def test_the_arrays_must_be_of_the_same_plans_and_problems():
    labels, durations, without, owners = drawn(0, 5, 4)
    for wrong in (
        (labels[:, :3], durations, without, 2, owners),
        (labels, durations, without[:4], 2, owners),
        (labels, durations, without, 5, owners),
        (labels, durations, without, 4, owners // 2),
        (labels, durations, without, -1, owners),
    ):
        with pytest.raises(ValueError, match="cannot be chosen"):
            choose(*wrong)


def lengthened(plan):
    """The plan with a second of standing still at its beginning."""
    states = np.concatenate((np.repeat(plan.states[:1], 10, axis=0), plan.states))
    return Plan(states, np.concatenate((np.zeros((10, 2)), plan.controls)), plan.dt)


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
    durations = np.array([candidate.plan.duration_s for candidate in candidates])
    owners = np.arange(len(candidates))
    assert curate(candidates, 20).tolist() == choice(labels, durations, durations + MISSED_S, owners, 20)


def test_plans_of_one_problem_compete_and_at_most_one_is_kept(candidates):
    doubled = [each for each in candidates for _ in range(2)]
    kept = curate(doubled, 20)
    assert (kept // 2).tolist() == curate(candidates, 20).tolist()
    longer = [Experience(each.problem, lengthened(each.plan)) for each in candidates]
    competing = [each for pair in zip(longer, candidates, strict=True) for each in pair]
    assert (curate(competing, 15) % 2 == 1).all()  # with more, some answer nothing that others do not
    assert curate(competing, len(candidates)).tolist() == list(range(0, len(competing), 2))


def test_as_many_as_there_are_stay_in_their_order(candidates):
    assert curate(candidates[:5], 5).tolist() == list(range(5))
    assert curate(candidates[:5], 9).tolist() == list(range(5))
