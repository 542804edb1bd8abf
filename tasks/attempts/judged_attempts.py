"""The independent check of attempts' plans."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from planners.attempt import Attempt
from planners.world.authority.authority import faults
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import Vehicle
from tasks.settings.errors import RunError

if TYPE_CHECKING:  # pandas takes a fifth of a second to import, and making rows does not need it
    import pandas as pd


class PlanFaultError(RunError):
    """A plan of a solved problem is faulty, which is a bug and never data."""


def check_attempt(problem: Problem, attempt: Attempt, accepted: set[bytes], vehicle: Vehicle) -> Attempt:
    """Have the authority judge the plan of an attempt, and raise an error if it is faulty.

    Args:
        problem: what was attempted.
        attempt: the attempt.
        accepted: plans for this problem that the authority has accepted; this one is added.
        vehicle: the vehicle that drives.

    Returns:
        the attempt with the authority's answer in ``verified``.

    Raises:
        PlanFaultError: the plan does not solve the problem.
    """
    judged = judged_attempt(problem, attempt, accepted, vehicle)
    if judged.verified is False and attempt.plan is not None:
        planner = f"{attempt.planner}, {attempt.assist} {attempt.top_k}, seed {attempt.seed}"
        check_plan(problem, attempt.plan, planner, vehicle)
    return judged


def check_plan(problem: Problem, plan: Plan, planner: str, vehicle: Vehicle) -> None:
    """Have the authority judge a plan, and raise an error if it is faulty.

    Args:
        problem: what the plan is for.
        plan: the plan.
        planner: the planner that made it, for the error.
        vehicle: the vehicle that drives.

    Raises:
        PlanFaultError: the plan does not solve the problem.
    """
    for fault in faults(problem, plan, vehicle):
        raise PlanFaultError(f"{problem.id} solved by {planner}: {fault}")


def judged_attempt(problem: Problem, attempt: Attempt, accepted: set[bytes], vehicle: Vehicle) -> Attempt:
    """Like ``check_attempt``, but a plan that the authority refuses raises nothing."""
    if attempt.plan is None:
        return attempt
    plan = attempt.plan.states.tobytes() + attempt.plan.controls.tobytes()
    right = plan in accepted or not faults(problem, attempt.plan, vehicle)
    if right:
        accepted.add(plan)
    return replace(attempt, verified=right)


def is_unaccepted(attempts: pd.DataFrame) -> pd.Series[bool]:
    """Where ``attempts`` count as solved with plans that the authority did not accept.

    Rows of before ``verified`` and ``polished`` were kept say nothing of that, and pass.
    """
    are_older = attempts[["verified", "polished"]].isna().all(axis=1)
    return attempts["solved"] & ~attempts["verified"].eq(True) & ~are_older
