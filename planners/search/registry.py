"""The planners by name. A new one is a file and a line here."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from planners.search.follow import FollowSettings, follow
from planners.search.gust import GustSettings, gust
from planners.search.outcome import Outcome
from planners.search.query import Guide, Limits, Query
from planners.search.rrt import RrtSettings, rrt
from planners.world.geometry.collision import Scene, scene_of
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import CAR, Vehicle
from planners.world.workspace import Workspace

PLANNERS: dict[str, Callable[[Query], Outcome]] = {
    "rrt": partial(rrt, settings=RrtSettings()),
    "gust": partial(gust, settings=GustSettings()),
    "follow": partial(follow, settings=FollowSettings()),
}


def plan(
    name: str,
    problem: Problem,
    rng: np.random.Generator,
    guide: Guide | None = None,
    scene: Scene | None = None,
    limits: Limits | None = None,
    vehicle: Vehicle = CAR,
    prefix: Plan | None = None,
    workspace: Workspace | None = None,
) -> Outcome:
    """Solve a problem with one of the ``PLANNERS`` and its default settings.

    Args:
        name: of the planner.
        problem: what to solve.
        rng: the source of all random choices.
        guide: paths that the search is to look along first.
        scene: ``scene_of(problem)``, if the caller has it already.
        limits: when to give up; by default those of ``Limits``.
        vehicle: what is to be driven.
        prefix: a free drive from the problem's start, from which the search goes on.
        workspace: the caller's buffers; by default new ones.

    """
    ready = scene_of(problem) if scene is None else scene
    query = Query(problem, rng, ready, workspace or Workspace(), guide, limits or Limits(), vehicle, prefix)
    return PLANNERS[name](query)
