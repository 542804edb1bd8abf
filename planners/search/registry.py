"""The planners by name. A new one is a file and a line here."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from planners.search.follow import FollowSettings, follow
from planners.search.gust import GustSettings, gust
from planners.search.outcome import Guide, Limits, Outcome
from planners.search.rrt import RrtSettings, rrt
from planners.world.geometry.collision import Scene
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import CAR, Vehicle

Planner = Callable[..., Outcome]

PLANNERS: dict[str, Planner] = {
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
) -> Outcome:
    """Solve ``problem`` with the planner called ``name``, with its default settings.

    ``prefix``: a free drive from the problem's start, which the search goes on from.
    """
    return PLANNERS[name](
        problem, rng=rng, guide=guide, scene=scene, limits=limits, vehicle=vehicle, prefix=prefix
    )
