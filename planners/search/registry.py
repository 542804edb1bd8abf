"""The planners by name. docs/architecture.md says what a new one needs."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from planners.search.follow import FollowSettings, follow
from planners.search.gust import GustSettings, gust
from planners.search.lattice import LatticeSettings, lattice
from planners.search.outcome import Outcome
from planners.search.query import Guide, Limits, Query, usual_limits
from planners.search.rrt import RrtSettings, rrt
from planners.world.geometry.collision import Scene, scene_of
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import CAR, Vehicle
from planners.world.workspace import Workspace

PLANNERS: dict[str, Callable[[Query], Outcome]] = {
    "rrt": partial(rrt, settings=RrtSettings()),
    "gust": partial(gust, settings=GustSettings()),
    "follow": partial(follow, settings=FollowSettings()),
    "lattice": partial(lattice, settings=LatticeSettings()),
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

    The arguments are the fields of ``Query``. Scene, limits and workspace are made if they are not given.
    """
    ready = scene_of(problem) if scene is None else scene
    buffers, most = workspace or Workspace(), limits or usual_limits(problem)
    return PLANNERS[name](Query(problem, rng, ready, buffers, guide, most, vehicle, prefix))
