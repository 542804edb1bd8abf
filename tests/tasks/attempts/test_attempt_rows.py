"""What a row says of its plan is what the authority said, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import pytest

from planners.attempt import Attempt
from planners.solve import solve
from planners.world.classes.problem_classes import problem_class
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import CAR
from tasks.attempts.attempt_rows import attempt_row, same_outcome
from tasks.attempts.judged_attempts import PlanFaultError, check_attempt, judged_attempt

PROBLEM = problem_class("curves", "easy").draw(5, 0)


def wrong(attempt: Attempt) -> Attempt:
    """The attempt with a plan that begins elsewhere."""
    assert attempt.plan is not None
    return replace(attempt, plan=replace(attempt.plan, states=attempt.plan.states + 1.0))


def verified(problem: Problem, attempt: Attempt) -> object:
    return attempt_row(judged_attempt(problem, attempt, set(), CAR), None, None, CAR)["verified"]


def test_a_row_says_what_the_authority_said() -> None:
    attempt = solve(PROBLEM, "follow")
    assert attempt_row(attempt, None, None, CAR)["verified"] is None  # nobody asked
    assert verified(PROBLEM, attempt) is True
    assert verified(PROBLEM, wrong(attempt)) is False
    assert verified(PROBLEM, replace(attempt, plan=None, solved=False)) is None


def test_a_refused_plan_stops_whoever_made_it_whatever_was_accepted_before() -> None:
    attempt, accepted = solve(PROBLEM, "follow"), set[bytes]()
    assert check_attempt(PROBLEM, attempt, accepted, CAR).verified
    assert len(accepted) == 1
    with pytest.raises(PlanFaultError, match=PROBLEM.id):
        check_attempt(PROBLEM, wrong(attempt), accepted, CAR)
    assert judged_attempt(PROBLEM, attempt, accepted, CAR).verified


def test_a_row_that_lies_about_its_plan_does_not_agree_with_the_attempt_made_again() -> None:
    attempt = check_attempt(PROBLEM, solve(PROBLEM, "follow"), set(), CAR)
    row = attempt_row(attempt, None, None, CAR)
    assert same_outcome(attempt, row, CAR)
    assert not same_outcome(judged_attempt(PROBLEM, wrong(attempt), set(), CAR), row, CAR)
    assert not same_outcome(attempt, {**row, "verified": False}, CAR)
    assert attempt.length_m is not None
    assert not same_outcome(attempt, {**row, "length_m": 1e-6 + attempt.length_m}, CAR)
    scaled = replace(attempt, length_m=0.25 * attempt.length_m)
    assert same_outcome(scaled, row, CAR)  # as rows were written before lengths were in real metres
