import gc
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.search.outcome import Status
from planners.search.query import Guide, Limits
from planners.search.registry import PLANNERS, plan
from planners.search.structures.tree import SIZE, allocate_tree
from planners.world.authority.authority import faults
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, state_size
from planners.world.workspace import Workspace
from tests.worlds import box, problem_of, strewn, walled_goal

EVERY = pytest.mark.parametrize("name", PLANNERS)


def straight_guide():
    line = np.linspace([0, 0], [50, 50], 100)
    return Guide(line, np.array([0, 100], np.int32), np.array([0.6]), 0.3, 16)


@EVERY
@given(seed=st.integers(0, 10**6), count=st.integers(0, 50), guided=st.booleans())
@settings(max_examples=15, deadline=None)
def test_every_plan_passes_the_authority(name, seed, count, guided):
    problem = strewn(seed, count)
    guide = straight_guide() if guided else None
    outcome = plan(name, problem, generator(seed), guide, limits=Limits(expansions=3000))
    assert (outcome.plan is not None) == (outcome.status is Status.SOLVED)
    if outcome.plan is not None:
        assert faults(problem, outcome.plan) == []


@EVERY
def test_the_same_seed_gives_the_same_plan_and_counts_whatever_ran_before(name):
    first = plan(name, strewn(1, 40), generator(5))
    plan(name, strewn(2, 50), generator(6))
    again = plan(name, strewn(1, 40), generator(5))
    np.testing.assert_array_equal(first.plan.states, again.plan.states)
    assert (first.collision_checks, first.expansions, first.nodes) == (
        again.collision_checks,
        again.expansions,
        again.nodes,
    )


@EVERY
def test_a_planner_keeps_nothing_of_the_generator_that_it_drew_from(name):
    rng = generator(3)
    before = sys.getrefcount(rng)
    for seed in range(3):
        plan(name, strewn(seed, 40), rng)
    gc.collect()
    assert sys.getrefcount(rng) == before


@pytest.fixture
def unproved(monkeypatch):
    """Nobody sees that there is no drive."""
    monkeypatch.setattr("planners.search.search_loop.is_unreachable", lambda *_: False)


@EVERY
@pytest.mark.usefixtures("unproved")
@pytest.mark.parametrize("expansions", [1, 300, 700])
def test_the_budget_of_expansions_is_spent_exactly_where_the_goal_is_walled_in(name, expansions):
    outcome = plan(name, walled_goal(), generator(0), limits=Limits(expansions=expansions))
    assert outcome.status is Status.BUDGET_SPENT
    assert outcome.expansions == expansions
    assert outcome.plan is None


@EVERY
@pytest.mark.usefixtures("unproved")
def test_a_full_tree_makes_room_for_a_new_one_until_all_expansions_are_used(name):
    limits = Limits(expansions=1000, nodes=500)
    outcome = plan(name, walled_goal(), generator(0), limits=limits)
    assert outcome.status is Status.BUDGET_SPENT
    assert outcome.expansions == limits.expansions
    assert outcome.nodes <= limits.nodes


@EVERY
@pytest.mark.usefixtures("unproved")
@pytest.mark.parametrize("half_m", [2.5, 3.5])
def test_a_tree_of_nothing_but_dead_ends_grows_from_its_root(name, half_m):
    walls = [
        (half_m, 0, 0.2, half_m),
        (-half_m, 0, 0.2, half_m),
        (0, half_m, half_m, 0.2),
        (0, -half_m, half_m, 0.2),
    ]
    problem = problem_of([box(x, y, 0.0, length, width) for x, y, length, width in walls])
    limits = Limits(expansions=5000)
    workspace = Workspace()
    outcome = plan(name, problem, generator(0), limits=limits, workspace=workspace)
    assert outcome.status is Status.BUDGET_SPENT
    tree = workspace.buffers(allocate_tree, limits.nodes, state_size(CAR))
    parents = tree.parents[1 : tree.counts[SIZE]]
    assert (parents >= 0).all()
    assert (np.abs(tree.states[: tree.counts[SIZE], :2]) < half_m).all()


@EVERY
def test_the_wall_clock_ends_the_search(name):
    outcome = plan(name, walled_goal(), generator(0), limits=Limits(seconds=0.0))
    assert outcome.status is Status.TIME_SPENT


@EVERY
@pytest.mark.parametrize(
    ("at", "status"), [((0.8, 0.8), Status.START_BLOCKED), ((50.0, 50.0), Status.GOAL_BLOCKED)]
)
def test_a_blocked_end_is_said_without_a_search(name, at, status):
    outcome = plan(name, problem_of([box(*at, 0.0, 0.5, 0.5)]), generator(0))
    assert outcome.status is status
    assert outcome.expansions == 0


@EVERY
def test_nearly_every_strewn_world_is_solved(name):
    solved = [
        plan(name, strewn(seed, 40), generator(seed), limits=Limits(expansions=10_000)).status
        is Status.SOLVED
        for seed in range(40)
    ]
    assert np.mean(solved) >= 0.95
