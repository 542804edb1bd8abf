"""What planning returns in a robot's own process."""

from __future__ import annotations

from dataclasses import dataclass, field

from planners.attempt import Attempt
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import Vehicle

# What ``learn`` keeps: a problem in the canonical frame, the attempt that solved it, and who drives.
Found = tuple[Problem, Attempt, Vehicle]


@dataclass(frozen=True, eq=False)
class Answer:
    """The result of planning for one problem."""

    problem_id: str
    status: str  # "solved", or how planning failed (planners.search.outcome.Status)
    source: str | None  # "recalled", "repaired", "searched" or "kept"; None when not solved
    plan: Plan | None  # in the frame and units of the given problem; None when not solved
    planning_seconds: float  # from convex pieces in the canonical frame to the plan
    call_seconds: (
        float  # of the whole call, reading and checking the problem included, but not judging the plan
    )
    _found: tuple[Found, ...] = field(default=(), repr=False)  # nothing if the plan is the memory's
    near_current: bool | None = None  # whether the robot is near its current plan; None: none was given


@dataclass(frozen=True, eq=False)
class RouteAnswer:
    """The result of looking for a drive across a map."""

    status: str  # "solved" or "stuck"
    source: str | None  # "searched" if any local plan was, else "repaired", "recalled", "kept"; None: stuck
    plan: Plan | None  # in the map's frame and metres; None when stuck
    why: str | None  # one clause: why and where it is stuck, or that the time is up; None when solved
    local_plans: int  # how many were looked for
    planning_seconds: float  # of the whole search, in which the judge looks at each local plan
    _found: tuple[Found, ...] = field(default=(), repr=False)  # the local plans of the drive
    near_current: bool | None = None  # as of ``Answer``
