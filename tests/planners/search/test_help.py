import functools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.search.help import PATIENCE, SHARE
from planners.search.outcome import work_of
from planners.search.query import Limits
from planners.search.registry import PLANNERS, plan
from planners.search.repair import REPAIR
from planners.solve import solve
from planners.world.authority.authority import faults
from planners.world.randomness import generator
from tests.planners.memories import memory_of_plans
from tests.worlds import box, problem_of, strewn

LONGEST_PLAN = 1_000  # states that are checked before anything is decided
OVERSHOOT = 1_000  # work of a call of a kernel, and of a controller that follows a plan to its end


@functools.cache
def memory_from(seed):
    plans = [plan("follow", strewn(seed + i, 25), generator(i)).plan for i in range(4)]
    return memory_of_plans(plans, np.arange(-1.0, 4.0))


def work(attempt):
    return work_of(attempt.collision_checks, attempt.expansions)


@pytest.mark.parametrize("assist", ["closed", "open", "repair", "random-repair"])
@given(
    planner=st.sampled_from(list(PLANNERS)),
    of=st.sampled_from([0, 50]),
    seed=st.integers(100, 200),
    count=st.sampled_from([20, 45, 70]),
)
@settings(max_examples=15, deadline=None)
def test_no_memory_makes_a_planner_work_much_more_or_fail(assist, planner, of, seed, count):
    problem, limits = strewn(seed, count), Limits(expansions=4_000)
    alone = solve(problem, planner, seed=seed, limits=limits)
    helped = solve(problem, planner, assist, 4, memory_from(of), seed, limits)
    assert helped.solved or not alone.solved
    checking = 4 * LONGEST_PLAN  # of the plans that are recalled
    budgets = REPAIR.work + LONGEST_PLAN + OVERSHOOT
    assert work(helped) <= (1 + SHARE) * work(alone) + checking + budgets
    if helped.plan is not None:
        assert faults(problem, helped.plan) == []
    again = solve(problem, planner, assist, 4, memory_from(of), seed, limits)
    assert (again.status, again.collision_checks, again.source) == (
        helped.status,
        helped.collision_checks,
        helped.source,
    )


@pytest.mark.parametrize("planner", ["gust", "follow"])
def test_where_a_planner_is_soon_done_a_bad_memory_changes_nothing(planner):
    memory = memory_from(0)
    walls = [box(*stored.states[at, :2], 0.4, 1.8, 1.8) for stored in memory.plans for at in (60, 130)]
    problem = problem_of(walls, "blocked here and there")
    alone = solve(problem, planner)
    assert work(alone) < PATIENCE
    helped = solve(problem, planner, "open", 4, memory)
    np.testing.assert_array_equal(helped.plan.states, alone.plan.states)
