"""Answers are polished: never longer than the plan as it was found, and of no worse kind with a memory."""

import functools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.attempt import WITHOUT_MEMORY
from planners.optimisation import polish
from planners.search import anytime
from planners.search import search_and_polish as searching
from planners.search.registry import PLANNERS, plan
from planners.solve import improved, solve
from planners.world.authority.authority import faults
from planners.world.randomness import generator
from tests.planners.clock import ticks
from tests.planners.memories import blocked_everywhere, memory_of_plans, shared_memory
from tests.worlds import problem_of, strewn

first = functools.partial(solve, polished=False)  # the plan as it is found


@pytest.fixture
def memory():
    return shared_memory()


@pytest.mark.parametrize("assist", ["none", "closed"])
def test_an_improved_attempt_has_a_quicker_plan_and_took_longer(assist, memory, monkeypatch):
    monkeypatch.setattr(anytime, "working_clock", ticks())
    monkeypatch.setattr(polish, "working_clock", ticks())
    problem = strewn(4, 20)
    found = first(problem, "gust", assist, 5, memory)
    better = improved(found, problem, 0.1)
    assert better.duration_s < found.duration_s
    assert better.planning_seconds >= found.planning_seconds + 0.1
    assert better.expansions > found.expansions
    assert better.source in (found.source, "searched")
    assert faults(problem, better.plan) == []


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize("assist", ["none", "fresh", "closed", "repair"])
def test_an_answer_is_polished_and_takes_no_longer_than_the_first_plan_or_a_recalled_one(
    memory, planner, assist
):
    for problem in (strewn(4, 20), strewn(5, 30), blocked_everywhere()):
        attempt, found = (each(problem, planner, assist, 5, memory) for each in (solve, first))
        assert attempt.duration_s <= found.duration_s
        assert (attempt.hit, attempt.recalled, attempt.recall) == (found.hit, found.recalled, found.recall)
        assert (attempt.hit is None) == (assist in WITHOUT_MEMORY)
        assert found.hit or found.source != "recalled"
        assert faults(problem, attempt.plan) == []


@given(st.sampled_from(["gust", "lattice"]), st.integers(0, 10**6), st.integers(0, 30))
@settings(max_examples=25, deadline=None)
def test_with_a_memory_an_answer_takes_no_longer_than_the_plan_that_is_soon_found_without(
    planner, seed, boxes
):
    """The plans of the memory are Follow's, as they were found."""
    problem = strewn(seed, boxes)
    alone = first(problem, planner)
    attempt = solve(problem, planner, "closed", 5, shared_memory())
    if alone.solved and alone.expansions <= searching.AGAIN:
        assert attempt.duration_s <= alone.duration_s


def test_a_recalled_plan_of_a_worse_kind_is_not_what_is_polished():
    """The free plan leads around a wall that is not there."""
    around = plan("follow", blocked_everywhere(), generator(0)).plan
    memory, nothing_there = memory_of_plans([around], np.zeros(2)), problem_of([])
    recalled, alone = solve(nothing_there, "lattice", "closed", 5, memory), solve(nothing_there, "lattice")
    assert recalled.hit
    assert recalled.duration_s <= 1.01 * alone.duration_s
