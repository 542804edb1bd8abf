"""Keep improving a plan: search again and again for one that takes less time than the best so far.

Each search has a cost bound below which nothing but a better plan fits, and a random stream of its own
(AO-x, Hauser and Zhou, T-RO 2016, with any of the planners as x).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import NamedTuple

from planners.search.guides.guidance import guidance
from planners.search.query import Limits, Query
from planners.search.registry import PLANNERS
from planners.world.geometry.collision import Scene, scene_of
from planners.world.problem import Plan, Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, Vehicle
from planners.world.workspace import Workspace

FIRST_EXPANSIONS = 250  # of the first search; a few times what a planner mostly needs for a plan
GROWTH = 1.5  # a search in vain may mean that it was too short: the next is this much longer
LEAST_GAIN = 0.01  # share of the duration that a new plan must save


class Improvement(NamedTuple):
    """One better plan: after how much work, and how long it takes to drive."""

    seconds: float  # since improving began
    expansions: int
    duration_s: float


@dataclass(frozen=True, eq=False)
class Improved:
    """The best plan that was found, and how it came about."""

    plan: Plan | None
    history: Sequence[Improvement]  # durations strictly decrease; begins with the plan that was there, if any
    seconds: float
    collision_checks: int
    expansions: int
    nodes: int


def improve(
    name: str,
    problem: Problem,
    known: Plan | None = None,
    *,
    seconds: float = math.inf,
    expansions: int | None = None,
    seed: int = 0,
    scene: Scene | None = None,
    vehicle: Vehicle = CAR,
    workspace: Workspace | None = None,
) -> Improved:
    """Improve a ``known`` plan (or find one) with the planner called ``name`` until a limit is reached.

    A limit in ``expansions`` gives the same result for the same seed on any machine, one in ``seconds`` does
    not. Each second search is guided along the best plan. Raises ValueError where there is no limit.
    """
    if not math.isfinite(seconds) and expansions is None:
        raise ValueError("improving never ends by itself: give it seconds or expansions")
    began = perf_counter()
    ready = scene_of(problem) if scene is None else scene
    buffers = workspace or Workspace()
    most = math.inf if expansions is None else expansions
    best = known
    history = [] if known is None else [Improvement(0.0, 0, known.duration_s)]
    spent = searches = checks = nodes = 0
    budget = float(FIRST_EXPANSIONS)
    while spent < most and (left := seconds - (perf_counter() - began)) > 0.0:
        limits = Limits(
            expansions=int(min(budget, most - spent)),
            seconds=min(left, Limits.seconds),
            bound_s=math.inf if best is None else (1.0 - LEAST_GAIN) * best.duration_s,
        )
        guide = guidance([best.states]) if best is not None and searches % 2 else None
        rng = generator(seed, "improve", problem.id, name, searches)
        found = PLANNERS[name](Query(problem, rng, ready, buffers, guide, limits, vehicle))
        searches += 1
        checks += found.collision_checks
        nodes += found.nodes
        spent += max(found.expansions, 1)  # a blocked end costs no expansion, and must end as well
        if found.plan is not None:
            best = found.plan
            history.append(Improvement(perf_counter() - began, spent, best.duration_s))
        else:
            budget *= GROWTH
    return Improved(best, tuple(history), perf_counter() - began, checks, spent, nodes)
