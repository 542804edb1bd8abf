"""What a planner returns."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final, NamedTuple

from planners.world.problem import Plan

CHECKS_AN_EXPANSION: Final = 5  # collision checks that take as long as all else in an expansion


def work_of(collision_checks: int, expansions: int) -> int:
    """Return what a search has cost, in collision checks. Decisions rest on this: no two clocks agree."""
    return collision_checks + CHECKS_AN_EXPANSION * expansions


class Status(StrEnum):
    """How an attempt ended. Failing to plan is data, not an error."""

    SOLVED = "solved"
    BUDGET_SPENT = "budget-spent"  # all expansions used up
    TIME_SPENT = "time-spent"
    START_BLOCKED = "start-blocked"
    GOAL_BLOCKED = "goal-blocked"
    INFEASIBLE = "infeasible"  # it is certain that no drive leads to the goal
    GOAL_ENCLOSED = "goal-enclosed"  # every drive out of the goal pose that was found ends near it


MEANINGS: Final = {
    Status.BUDGET_SPENT: "the search gave up, so there may be a plan or none",
    Status.TIME_SPENT: "its time was up, so there may be a plan or none",
    Status.START_BLOCKED: "at the start the vehicle meets an obstacle or the bounds",
    Status.GOAL_BLOCKED: "the middle of the goal is not free, or there is no room in the goal pose",
    Status.INFEASIBLE: "it is certain that no drive leads there",
    Status.GOAL_ENCLOSED: "every drive out of the goal pose that was found ends near it",
}  # of an attempt without a plan, for people


class Other(NamedTuple):
    """A drive that was found besides the plan."""

    plan: Plan
    joined: bool  # whether it ends with one of the query's endings


@dataclass(frozen=True, eq=False)
class Outcome:
    """One search: its plan, if any, and what it cost."""

    status: Status
    plan: Plan | None
    collision_checks: int
    expansions: int
    nodes: int
    roadmap_seconds: float
    search_seconds: float
    joined: bool = False  # whether the plan ends with one of the query's endings
    others: tuple[Other, ...] = ()  # drives of other kinds, if the query asks for them
    expected_s: float | None = None  # how long a drive should take, by what was known before
    winds: bool = False  # whether the way over cells is much longer than straight on, or leads through walls
