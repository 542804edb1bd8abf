from __future__ import annotations

import dataclasses
import math
from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import cdist

from planners.memory.plans.cell_masks import rank_by_cells
from planners.memory.plans.free import ends_of, first_fitting, free_plans
from planners.memory.recall import (
    LIKELY_CELLS,
    MOST_EXHAUSTIVE,
    STRATEGIES,
    WORTH_CELLS,
    by_encoder,
    default_recall,
    rank,
    recall,
)
from planners.world.driving_cost import cost_of
from planners.world.geometry.collision import scene_of
from planners.world.geometry.occupancy import bits_of, occupancy_of
from planners.world.problem import CANONICAL_GOAL
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import Costs
from planners.world.view import View
from tests.planners.memory.untrained import PLANS, untrained_memory

SEEDS = st.integers(0, 2**32 - 1)


@pytest.fixture(scope="module")
def memory(experiences):
    return untrained_memory(experiences)


@pytest.fixture(scope="module")
def problem_in(experiences, draw):
    """Problems that some of the stored plans answer: among a few obstacles, with a wide goal."""

    def make(seed, count=5):
        obstacles, problem = draw(generator(seed, "recall"), count), experiences[seed % PLANS].problem
        wide = math.dist(problem.goal, CANONICAL_GOAL) + 4.0  # so that this plan ends there, and some others
        return dataclasses.replace(problem, obstacles=obstacles, goal=CANONICAL_GOAL, goal_radius=wide)

    return make


def free_in(memory, problem):
    ends = memory.sweeps.last_positions - problem.goal
    return free_plans(memory.sweeps, scene_of(problem)) & (np.hypot(*ends.T) <= problem.goal_radius)


def recalled_by(memory, problem, strategy, k, **options):
    return recall(memory, View(problem), strategy, k, generator(k, "blindly"), **options)


@given(
    seed=SEEDS, k=st.integers(1, 12), strategy=st.sampled_from(STRATEGIES), off=st.sampled_from([0.0, 0.01])
)
def test_recalled_plans_are_distinct_at_most_k_and_a_free_one_is_among_them(
    memory, problem_in, seed, k, strategy, off
):
    problem = problem_in(seed)
    start = (*problem.start[:2], problem.start[2] + off)
    problem = dataclasses.replace(problem, start=start)
    found = recalled_by(memory, problem, strategy, k)
    assert len(set(found.plans)) == len(found.plans) <= min(k, PLANS)
    assert set(found.plans) <= set(range(PLANS))
    if found.free >= 0:
        assert found.free in found.plans
        assert off or free_in(memory, problem)[found.free]


@given(seed=SEEDS, k=st.integers(1, 12), strategy=st.sampled_from(["encoder", "mask", "random"]))
def test_no_free_plan_among_those_recalled_drives_shorter(memory, problem_in, seed, k, strategy):
    problem = problem_in(seed)
    found = recalled_by(memory, problem, strategy, k)
    if found.free >= 0:
        free = [i for i in found.plans if free_in(memory, problem)[i]]
        assert memory.costs[found.free] == memory.costs[free].min()


@given(seed=SEEDS, k=st.integers(1, 12), count=st.integers(0, 12))
def test_of_plans_with_few_blocked_cells_exhaustive_finds_the_one_that_drives_shortest(
    memory, problem_in, seed, k, count
):
    problem = problem_in(seed, count)
    likely = likely_in(memory, problem)
    if likely.any():
        free = recalled_by(memory, problem, "exhaustive", k).free
        assert memory.costs[free] == memory.costs[likely].min()


@given(seed=SEEDS, count=st.integers(0, 12))
def test_for_another_heading_a_free_plan_that_the_encoder_ranks_high_is_the_answer(
    memory, problem_in, seed, count
):
    problem = problem_in(seed, count)
    problem = dataclasses.replace(problem, start=(*problem.start[:2], problem.start[2] + 0.01))
    view = View(problem)
    head = by_encoder(memory, view, 2, never_none=True)
    with mock.patch("planners.memory.recall.CHECKED_EARLY", 2):
        found = recalled_by(memory, problem, "exhaustive", 1)
    if first_fitting(head, memory.sweeps, ends_of(problem), view.scene)[0] >= 0:
        assert found.free in head


def likely_in(memory, problem):
    return free_in(memory, problem) & (rank_by_cells(memory.masks, View(problem).bits).cells <= LIKELY_CELLS)


@given(seed=SEEDS, k=st.integers(1, 12), count=st.integers(0, 12))
def test_exhaustive_finds_a_free_plan_if_one_with_few_blocked_cells_is_free(
    memory, problem_in, seed, k, count
):
    problem = problem_in(seed, count)
    found = recalled_by(memory, problem, "exhaustive", k).free
    assert found >= 0 or not likely_in(memory, problem).any()
    assert found < 0 or free_in(memory, problem)[found]


@given(seed=SEEDS, k=st.integers(1, 12), count=st.integers(0, 12))
def test_where_most_plans_seem_free_others_are_tried_only_if_one_of_the_least_blocked_is_free(
    memory, problem_in, seed, k, count
):
    problem = problem_in(seed, count)
    least = rank_by_cells(memory.masks, View(problem).bits).order[: 3 * PLANS // 4]
    all_tried = recalled_by(memory, problem, "exhaustive", k)
    with mock.patch("planners.memory.recall.DECISIVE", 1):
        found = recalled_by(memory, problem, "exhaustive", k)
    if free_in(memory, problem)[least].any():
        assert found.free == all_tried.free
    else:
        assert found.free in (-1, all_tried.free)
        assert found.checks <= all_tried.checks


@given(seed=SEEDS, k=st.integers(1, 12), first=st.integers(1, 7), count=st.integers(0, 12))
def test_a_large_memory_finds_a_free_plan_if_one_with_few_blocked_cells_is_free(
    memory, problem_in, seed, k, first, count
):
    problem = problem_in(seed, count)
    free, likely = free_in(memory, problem), likely_in(memory, problem)
    with mock.patch("planners.memory.recall.TRIED_EARLY", first):
        for strategy in ("exhaustive", "hybrid"):
            found = recalled_by(memory, problem, strategy, k)
            assert found.free >= 0 or not likely.any()
            assert len(set(found.plans)) == len(found.plans) <= k
            assert found.free < 0 or (free[found.free] and found.free in found.plans)


@given(seed=SEEDS, k=st.integers(1, 12), off=st.sampled_from([0.0, 0.01]))
def test_hybrid_of_all_plans_is_exhaustive(memory, problem_in, seed, k, off):
    problem = problem_in(seed)
    problem = dataclasses.replace(problem, start=(*problem.start[:2], problem.start[2] + off))
    hybrid = recalled_by(memory, problem, "hybrid", k, candidates=PLANS)
    assert hybrid == recalled_by(memory, problem, "exhaustive", k)


@given(seed=SEEDS, k=st.integers(1, 8), candidates=st.integers(1, 8))
def test_hybrid_checks_the_plans_that_the_encoder_chose(memory, problem_in, seed, k, candidates):
    problem = problem_in(seed)
    chosen = set(rank(memory, occupancy_of(problem))[0][:candidates].tolist())
    found = recalled_by(memory, problem, "hybrid", k, candidates=candidates)
    assert set(found.plans) <= chosen
    assert found.free >= 0 or not likely_in(memory, problem)[list(chosen)].any()


@given(seed=SEEDS, k=st.integers(1, 8))
def test_mask_recalls_the_least_blocked_and_checks_these_alone(memory, problem_in, seed, k):
    problem = problem_in(seed)
    blocked = np.bitwise_count(memory.masks & bits_of(occupancy_of(problem))).sum(axis=1)
    best = np.argsort(blocked, kind="stable")[:k]
    found = recalled_by(memory, dataclasses.replace(problem), "mask", k)
    within = set(best[blocked[best] <= WORTH_CELLS].tolist())
    assert set(found.plans) == within
    assert (found.free >= 0) == free_in(memory, problem)[list(within)].any()


@given(seed=SEEDS)
def test_plans_that_are_blocked_nearly_everywhere_are_not_recalled(memory, problem_in, seed):
    problem = problem_in(seed, 200)
    blocked = np.bitwise_count(memory.masks & bits_of(occupancy_of(problem))).sum(axis=1)
    for strategy in ("mask", "hybrid", "exhaustive"):
        found = recalled_by(memory, problem, strategy, PLANS)
        assert all(blocked[i] <= WORTH_CELLS for i in found.plans if i != found.free)


@given(seed=SEEDS, k=st.integers(1, 8))
def test_what_the_encoder_recalls_is_the_head_of_the_rank(memory, problem_in, seed, k):
    problem = problem_in(seed)
    order, no_plan = rank(memory, occupancy_of(problem))
    assert sorted(order) == list(range(PLANS))
    found = recalled_by(memory, problem, "encoder", k)
    assert set(found.plans) == (set() if no_plan else set(order[:k].tolist()))
    assert found.free >= 0 or list(found.plans) == ([] if no_plan else order[:k].tolist())


@given(seed=SEEDS, k=st.integers(1, 8))
def test_an_encoder_that_knows_nothing_ranks_by_blocked_cells(memory, problem_in, seed, k):
    knows_nothing = dataclasses.replace(
        memory,
        objective="labels",
        vectors=np.zeros_like(memory.vectors),
        biases=np.array([-1e6] + [0.0] * PLANS, np.float32),
    )
    problem = problem_in(seed)
    by_cells = rank_by_cells(memory.masks, bits_of(occupancy_of(problem))).order[:k].tolist()
    assert rank(knows_nothing, occupancy_of(problem))[0][:k].tolist() == by_cells
    with mock.patch("planners.memory.recall.MOST_SCORED", 1):  # as in a large memory
        assert rank(knows_nothing, occupancy_of(problem))[0][:k].tolist() == by_cells


@given(seed=SEEDS, k=st.integers(1, 8))
def test_centroids_recall_the_nearest_plans_and_the_first_free_one_is_the_answer(memory, problem_in, seed, k):
    rng = generator(seed, "readout")  # which a trained readout may contradict
    learned = dataclasses.replace(memory, vectors=rng.normal(size=memory.vectors.shape).astype(np.float32))
    problem = problem_in(seed)
    embedding = memory.encoder(occupancy_of(problem))
    distances = cdist(embedding[np.newaxis], memory.centroids)[0]
    nearest = [] if distances[0] < distances[1:].min() else np.argsort(distances[1:])[:k].tolist()
    recalled = recalled_by(learned, problem, "centroid", k)
    assert list(recalled.plans) == nearest
    assert recalled.free == next((i for i in nearest if free_in(memory, problem)[i]), -1)


def test_nothing_is_recalled_where_row_0_scores_best(memory, problem_in):
    hopeless = dataclasses.replace(memory, biases=np.array([1e6] + [0.0] * PLANS, np.float32))
    problem = problem_in(0)
    assert recalled_by(hopeless, problem, "encoder", 5).plans == ()
    assert rank(hopeless, occupancy_of(problem))[1]
    assert recalled_by(hopeless, problem, "exhaustive", 5).plans != ()


def test_the_default_is_exhaustive_until_there_are_too_many_plans(memory):
    assert default_recall(memory) == "exhaustive"
    many = dataclasses.replace(
        memory,
        plans=[memory.plans[0]] * (MOST_EXHAUSTIVE + 1),
        masks=np.zeros((MOST_EXHAUSTIVE + 1, 64), np.uint64),
        **{name: np.zeros((MOST_EXHAUSTIVE + 2, 6), np.float32) for name in ("centroids", "vectors")},
        biases=np.zeros(MOST_EXHAUSTIVE + 2, np.float32),
    )
    assert default_recall(many) == "hybrid"


@pytest.mark.parametrize(("strategy", "k"), [("mask", 0), ("encoder", -1), ("guess", 1)])
def test_a_wrong_question_is_refused(memory, experiences, strategy, k):
    with pytest.raises(ValueError, match=f"recall {k} plans by '{strategy}': give 1 or more, and one of"):
        recall(memory, View(experiences[0].problem), strategy, k)


def test_blindly_needs_a_generator(memory, experiences):
    with pytest.raises(ValueError, match="pass an rng"):
        recall(memory, View(experiences[0].problem), "random", 1)


def test_plans_are_ordered_by_what_they_cost_to_drive(memory):
    for costs in (memory.vehicle.costs, Costs(gear_change=5.0, forwards=3.0)):
        vehicle = memory.vehicle._replace(costs=costs)
        seconds = np.array([cost_of(each, vehicle) for each in memory.plans], np.float32)
        ordered = dataclasses.replace(memory, vehicle=vehicle).by_cost
        assert ordered.tolist() == np.argsort(seconds, kind="stable").tolist()
