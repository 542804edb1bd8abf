"""What a planner returns, what may guide it, and when it gives up."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from planners.world.arrays import Floats, Integers
from planners.world.problem import Plan


class Status(StrEnum):
    """How an attempt ended. Failing to plan is data, not an error."""

    SOLVED = "solved"
    BUDGET_SPENT = "budget-spent"  # all expansions used up
    TIME_SPENT = "time-spent"
    START_BLOCKED = "start-blocked"
    GOAL_BLOCKED = "goal-blocked"


class Guide(NamedTuple):
    """Ways to sample around: way i with probability b_i, else the goal, else anywhere."""

    points: Floats  # [M, 2] metres, some a metre apart, of all guiding ways one after another
    starts: Integers  # [k + 1] way i owns points[starts[i] : starts[i + 1]]
    probabilities: Floats  # [k] b_1 > ... > b_k
    goal_probability: float
    # what remains to 1 is b_other


NO_GUIDE = Guide(np.empty((0, 2)), np.zeros(1, np.int32), np.empty(0), 0.1)


@dataclass(frozen=True)
class Limits:
    """When to give up. Expansions decide the result; seconds only guard against a machine's bad day."""

    expansions: int = 20_000
    nodes: int = 400_000  # tree vertices at once
    seconds: float = 30.0
    bound_s: float = math.inf  # only plans that take less time than this count as solutions


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
