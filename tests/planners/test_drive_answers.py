"""Answers by whole stored drives: they are right, mostly need no search, and are never worse beside one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from planners import drive_answers
from planners import solve as solving
from planners.attempt import DRIVES
from planners.explanation import drive_found
from planners.memory.library.drives import placed_drive
from planners.memory.library.plan_library import PlanLibrary, gathered_library
from planners.memory_answers import MemoryAnswer
from planners.optimisation.polish import Polished, polish_guesses
from planners.ranked_plans import ranked_plans
from planners.search.free_goal import aimed_view
from planners.search.outcome import Outcome, Status
from planners.search.query import Limits, Query
from planners.solve import solve
from planners.world.alignment import shifted, to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.families import family
from planners.world.compiling import working_clock
from planners.world.goal import HEADING, X, Y, goal_of
from planners.world.problem import Plan, Problem
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, Vehicle
from planners.world.workspace import Workspace

WORKSPACE = Workspace()


def drawn(name: str, difficulty: str, seed: int, number: int, vehicle: Vehicle = CAR) -> Problem:
    return to_canonical(family(name, difficulty, vehicle).draw(seed, number))[0]


def library_of(name: str, difficulty: str, plans: int, vehicle: Vehicle = CAR) -> PlanLibrary:
    problems = [drawn(name, difficulty, 5, number, vehicle) for number in range(plans)]
    answers = [
        (each.id, solve(each, "lattice", vehicle=vehicle, workspace=WORKSPACE).plan) for each in problems
    ]
    return gathered_library(name, vehicle, [(name, plan) for name, plan in answers if plan is not None])


@pytest.fixture(scope="module")
def slots() -> PlanLibrary:
    return library_of("parallel", "hard", 40)


def test_new_slots_are_answered_by_drives_into_others(slots: PlanLibrary) -> None:
    moved = 0
    for number in range(20):
        problem = drawn("parallel", "hard", 6, number)
        found = solve(problem, "lattice", "join", 1, slots, workspace=WORKSPACE)
        assert found.plan is not None
        assert faults(problem, found.plan) == []
        if found.recall == DRIVES:
            moved += 1
            assert found.source in ("repaired", "searched")
            assert (found.expansions == 0) == (found.source == "repaired" and found.search_seconds == 0.0)
    assert moved >= 15


def test_drives_are_recalled_without_a_search_in_any_frame(slots: PlanLibrary) -> None:
    recalled = 0
    for number in range(10):
        problem = replace(family("parallel", "hard", CAR).draw(6, number), offset=(3000.0, 0.0))
        for each in ranked_plans(slots, problem, 5, WORKSPACE):
            assert each.free
            near = shifted(each.plan, (-3000.0, 0.0))
            assert faults(problem, near) == []
            recalled += each.number in range(len(slots.plans))
    assert recalled >= 8


def test_if_a_drive_is_long_the_answer_is_never_longer_than_without_a_memory(
    slots: PlanLibrary, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(drive_answers, "LONG", 0.0)
    monkeypatch.setattr(drive_answers, "UNUSUAL", 0.0)
    moved = 0
    for number in range(12):
        problem = drawn("parallel", "hard", 7, number)
        alone = solve(problem, "lattice", workspace=WORKSPACE)
        both = solve(problem, "lattice", "join", 1, slots, workspace=WORKSPACE)
        assert alone.duration_s is not None
        assert both.duration_s is not None
        assert both.recall != DRIVES or both.duration_s <= alone.duration_s
        moved += both.recall == DRIVES
    assert moved >= 6


def test_the_longer_a_drive_takes_the_more_others_are_tried_and_the_quickest_is_kept(
    slots: PlanLibrary, monkeypatch: pytest.MonkeyPatch
) -> None:
    pairs: list[int] = []

    def counted(problem: Problem, guesses: Sequence[Plan], *around: Any) -> tuple[int, Polished]:
        pairs[-1] += 1
        return polish_guesses(problem, guesses, *around)

    monkeypatch.setattr(drive_answers, "polish_guesses", counted)
    for number in range(6):
        view = aimed_view(drawn("parallel", "hard", 10, number), CAR, WORKSPACE)
        seconds: list[float] = []
        for square_seconds in (math.inf, 20.0, 0.0):
            pairs.append(0)
            monkeypatch.setattr(drive_answers, "SQUARE_SECONDS", square_seconds)
            found = drive_answers.drive_answer(slots, view, CAR, math.inf)
            seconds.append(math.inf if found.plan is None else found.plan.duration_s)
            assert found.plan is None or faults(view.problem, found.plan) == []
            worth = seconds[-1] ** 2 / square_seconds if square_seconds else math.inf
            assert pairs[-1] >= min(worth, 4)
        assert seconds == sorted(seconds, reverse=True)
        assert pairs[-1] == 4


@pytest.mark.parametrize("motion", [(0.8, 0.1), (-0.5, -0.2)])
def test_a_drive_may_begin_in_motion(slots: PlanLibrary, motion: tuple[float, float]) -> None:
    found = 0
    for number in range(8):
        problem = replace(drawn("parallel", "hard", 8, number), start_motion=motion)
        attempt = solve(problem, "lattice", "join", 1, slots, workspace=WORKSPACE)
        if attempt.plan is not None:
            assert faults(problem, attempt.plan) == []
            found += attempt.recall == DRIVES
    assert found >= 2


def test_drives_picked_blindly_answer_less(slots: PlanLibrary) -> None:
    counts = {}
    for assist in ("join", "random-join"):
        attempts = [
            solve(drawn("parallel", "hard", 9, number), "lattice", assist, 1, slots, workspace=WORKSPACE)
            for number in range(10)
        ]
        counts[assist] = sum(each.source == "repaired" for each in attempts)
    assert counts["random-join"] <= counts["join"]


def test_trains_turn_round_as_others_did() -> None:
    library = library_of("yard", "easy", 4, CAR_1_TRAILER)
    moved = 0
    for number in range(4):
        problem = drawn("yard", "easy", 6, number, CAR_1_TRAILER)
        found = solve(problem, "lattice", "join", 1, library, vehicle=CAR_1_TRAILER, workspace=WORKSPACE)
        assert found.plan is not None
        assert faults(problem, found.plan, CAR_1_TRAILER) == []
        moved += found.recall == DRIVES
    assert moved >= 2


def test_who_needs_no_polish_gets_no_drive(slots: PlanLibrary) -> None:
    problem = drawn("parallel", "hard", 6, 0)
    found = solve(problem, "lattice", "join", 1, slots, workspace=WORKSPACE, polished=False)
    assert found.recall != DRIVES


def test_what_is_only_recalled_moves_no_drive(slots: PlanLibrary) -> None:
    found = solve(drawn("parallel", "hard", 6, 0), "lattice", "closed", 1, slots, workspace=WORKSPACE)
    assert found.recall != DRIVES


def test_the_drive_that_was_moved_is_found_again(slots: PlanLibrary) -> None:
    problem = drawn("parallel", "hard", 6, 1)
    attempt = solve(problem, "lattice", "repair", 1, slots, workspace=WORKSPACE)
    drive = drive_found(problem, attempt, slots, CAR)
    assert attempt.plan is not None
    assert drive is not None
    assert drive.answer.plan is not None
    assert attempt.recalled == (drive.answer.number,)
    assert slots.questions[drive.answer.number].startswith("parallel")
    assert attempt.source != "repaired" or (drive.answer.plan.controls == attempt.plan.controls).all()


def test_a_drive_is_put_to_a_goal_as_it_was_driven_or_as_in_a_mirror(slots: PlanLibrary) -> None:
    goal = goal_of(drawn("parallel", "hard", 6, 1), CAR)
    for drive, number in enumerate(slots.drives.plans):
        stored = slots.plans[number]
        for entry, side in ((drive, 1.0), (-1 - drive, -1.0)):
            put = placed_drive(slots.drives, entry, goal, CAR.dt)
            np.testing.assert_allclose(put.states[-1, :3], goal[[X, Y, HEADING]], atol=1e-9)
            again = simulate(put.states[0], stored.controls * (1.0, side), CAR)
            np.testing.assert_allclose(put.states, again, atol=1e-6)


def test_what_the_memory_takes_is_taken_off_the_search(
    slots: PlanLibrary, monkeypatch: pytest.MonkeyPatch
) -> None:
    left: list[float] = []

    def slow(*given: object, **named: object) -> MemoryAnswer:
        began = working_clock()
        while working_clock() < began + 0.2:
            pass
        return MemoryAnswer()

    def searched(planner: str, query: Query, *_: object) -> tuple[Outcome, None]:
        left.append(query.limits.seconds)
        return Outcome(Status.BUDGET_SPENT, None, 0, 0, 0, 0.0, 0.0), None

    monkeypatch.setattr(solving, "answer_from", slow)
    monkeypatch.setattr(solving, "search_and_polish", searched)
    for seconds, most in ((0.5, 0.3), (0.1, 0.0)):
        problem, limits = drawn("parallel", "hard", 6, 0), Limits(seconds=seconds)
        solve(problem, "lattice", "join", 1, slots, limits=limits, workspace=WORKSPACE)
        assert 0.0 <= left[-1] <= most
