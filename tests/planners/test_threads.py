"""Threads that plan at the same time, each with a workspace of its own."""

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields

import pytest

from planners.attempt import Attempt
from planners.search.registry import PLANNERS
from planners.solve import ASSISTS, solve
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.workspace import Workspace
from tests.planners.memories import memory_of

SAME = [field.name for field in fields(Attempt) if field.name != "plan" and "seconds" not in field.name]


@pytest.fixture(scope="module")
def memory():
    return memory_of(problem_class("trap").draw(5, index) for index in range(12))


def row_of(attempt):
    """All of an attempt but its times."""
    plan = attempt.plan and (attempt.plan.states.tobytes(), attempt.plan.controls.tobytes())
    return [getattr(attempt, name) for name in SAME], plan


def rows_of(numbers, memory):
    """Attempts at the problems with these numbers, by each planner and assist in turn, in one workspace."""
    names = [(planner, assist) for planner in PLANNERS for assist in ASSISTS]
    workspace, rows = Workspace(), []
    for number in numbers:
        problem = problem_class(CLASSES[number % 3], "standard").draw(6, number)
        planner, assist = names[number % len(names)]
        rows.append(row_of(solve(problem, planner, assist, 3, memory, workspace=workspace)))
    return rows


def one_after_the_other(parts, memory):
    return [rows_of(part, memory) for part in parts]


def at_once(parts, memory):
    with ThreadPoolExecutor(len(parts)) as threads:
        return list(threads.map(lambda part: rows_of(part, memory), parts))


def test_two_threads_at_once_get_the_rows_of_one(memory):
    parts = [range(0, 48, 2), range(1, 48, 2)]
    assert at_once(parts, memory) == one_after_the_other(parts, memory)


@pytest.mark.slow
def test_two_threads_at_once_take_less_time_than_turns(memory):
    parts, seconds, rows = [range(1000), range(1000, 2000)], [], []
    for how in (one_after_the_other, at_once):
        began = time.perf_counter()
        rows.append(how(parts, memory))
        seconds.append(time.perf_counter() - began)
    print(f"1,000 problems in each of two threads: in turn {seconds[0]:.2f} s, at once {seconds[1]:.2f} s")
    assert rows[0] == rows[1]
    assert seconds[1] < 0.9 * seconds[0]
