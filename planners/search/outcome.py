"""What a planner returns."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from planners.world.problem import Plan


class Status(StrEnum):
    """How an attempt ended. Failing to plan is data, not an error."""

    SOLVED = "solved"
    BUDGET_SPENT = "budget-spent"  # all expansions used up
    TIME_SPENT = "time-spent"
    START_BLOCKED = "start-blocked"
    GOAL_BLOCKED = "goal-blocked"


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
