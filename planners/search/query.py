"""What a planner is asked: the problem, what may guide it, when it gives up, and the buffers it may use."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from planners.world.arrays import Floats, Integers
from planners.world.driving_cost import cost_of
from planners.world.geometry.collision import Scene
from planners.world.geometry.occupancy import Bits
from planners.world.problem import Plan, Problem, start_state, starting_at
from planners.world.vehicles.vehicle import CAR, Vehicle
from planners.world.workspace import Workspace


class Guide(NamedTuple):
    """Paths to sample around: path i with probability b_i, else the goal, else anywhere.

    A tree grows *along* a path, from near a point of it towards one of the ``lead`` points that follow. If
    ``lead`` is 0 it grows towards what is near a point, and roadmaps have their nodes there (paper, III-D).
    """

    points: Floats  # [M, 2] metres: the points of all paths, one path after another
    starts: Integers  # [k + 1] path i owns points[starts[i] : starts[i + 1]]
    probabilities: Floats  # [k] b_1 > ... > b_k
    goal_probability: float  # what remains to 1 is b_other
    lead: int  # how many points ahead a target lies at most; 0: near the point itself


class Endings(NamedTuple):
    """Parts of plans between two stops, each in the frame of the pose in which its plan ends."""

    states: Floats  # [N, S] of all parts, one after another
    controls: Floats  # [N, 2] from each state to the next; that of a part's last state counts for nothing
    starts: Integers  # [K + 1] part k owns states[starts[k] : starts[k + 1]]
    follows: Integers  # [K] the part that comes after it, always one before in this order; -1: the goal


POSE_EXPANSIONS = 60_000
NO_GUIDE = Guide(np.empty((0, 2)), np.zeros(1, np.int32), np.empty(0), 0.1, 0)


@dataclass(frozen=True)
class Limits:
    """When to give up. Expansions decide the result; seconds only guard against a machine's bad day.

    Where a vehicle's drives cost more than time, what is searched two or three times has the expansions as
    often; what takes longer than expected is improved with as many again at most.
    """

    expansions: int = 20_000
    nodes: int = 400_000  # tree vertices at once
    seconds: float = 30.0
    bound_s: float = math.inf  # only plans that cost less than this count as solutions
    further: int = 0  # expansions at least for drives of other kinds after a first to a pose
    # whether another planner, or a way by the place of a pose, may be tried as well (``search_and_polish``)
    second: bool = True


def usual_limits(problem: Problem, seconds: float | None = None) -> Limits:
    """The limits if none are given: a pose is worth more, since with trailers it may take some seconds.

    Args:
        problem: what is asked.
        seconds: after which planning has to end; None: as usual.
    """
    expansions = POSE_EXPANSIONS if problem.asks_for_pose else Limits.expansions
    return Limits(expansions=expansions, seconds=Limits.seconds if seconds is None else seconds)


@dataclass(frozen=True, eq=False)
class Query:
    """One problem for a planner."""

    problem: Problem
    rng: np.random.Generator
    scene: Scene  # the problem's obstacles, ready for collision checks
    workspace: Workspace
    guide: Guide | None = None
    limits: Limits = field(default_factory=Limits)
    vehicle: Vehicle = CAR
    prefix: Plan | None = None  # a free drive from the problem's start, from which the search goes on
    occupied: Bits | None = None  # [64] the cells that are not free, if they are drawn
    knows_way: bool = False  # whether the workspace holds the distances to the goal over these cells already
    is_tight: bool | None = None  # whether there is little room around the goal, if that is known already
    # what else is tried while the search goes on: told of its work so far, it may return a plan that ends it
    beside: Callable[[int], Plan | None] | None = None
    endings: Endings | None = None  # known ways into a pose at rest, for searches of manoeuvres
    others: bool = False  # whether drives of other kinds than the first are wanted, where they are found soon


def prefix_of(query: Query) -> Plan:
    """The drive from which a search goes on: the prefix, or the start alone."""
    if query.prefix is not None:
        return query.prefix
    return Plan(start_state(query.problem, query.vehicle)[np.newaxis], np.empty((0, 2)), query.vehicle.dt)


def after_prefix(query: Query) -> Query:
    """The query as it is asked where its prefix ends."""
    if query.prefix is None:
        return query
    problem = starting_at(query.problem, query.prefix.states[-1])
    limits = replace(query.limits, bound_s=query.limits.bound_s - cost_of(query.prefix, query.vehicle))
    return replace(query, problem=problem, limits=limits, prefix=None)
