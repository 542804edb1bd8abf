"""Kinodynamic RRT (LaValle and Kuffner 2001): the vertex nearest to a random target is extended to it."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from planners.search.guides.sampling import guided
from planners.search.outcome import NO_GUIDE, Guide, Limits, Outcome
from planners.search.search_loop import attempt
from planners.search.structures.neighbours import nearest
from planners.search.structures.tree import (
    EXPANSIONS,
    EXTENSION,
    GOAL_VERTEX,
    NO_LEAD,
    SIZE,
    Extension,
    Tree,
    extend,
)
from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene, scene_of
from planners.world.jit import lean
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import CAR, Vehicle


class RrtSettings(NamedTuple):
    """docs/planners.md; without a guide the goal is drawn with ``NO_GUIDE.goal_probability``."""

    guide_near_m: float = 2.0
    guide_far_m: float = 4.0
    guide_lead: int = 16  # points of the guide, a metre apart: how far ahead the target lies
    restart_after: int = 1000  # expansions
    extension: Extension = EXTENSION


@lean
def grow_rrt(
    tree: Tree,
    goal: Floats,
    until: int,
    guide: Guide,
    no_lead: Floats,
    settings: RrtSettings,
    vehicle: Vehicle,
    scene: Scene,
    rng: np.random.Generator,
) -> None:
    """Extend along the guide, or towards anywhere, until solved or ``until`` expansions."""
    counts = tree.counts
    while counts[EXPANSIONS] < until and counts[SIZE] < tree.states.shape[0]:
        from_x, from_y, x, y = guided(
            guide, goal, scene.bounds, settings.guide_near_m, settings.guide_far_m, settings.guide_lead, rng
        )
        vertex = max(nearest(tree.buckets, from_x, from_y), 0)  # the root, where all others are dead ends
        extend(tree, vertex, x, y, goal, no_lead, 0.0, 0.0, settings.extension, vehicle, scene, rng)
        if counts[GOAL_VERTEX] >= 0:
            return


def towards_anywhere(
    vehicle: Vehicle, scene: Scene, rng: np.random.Generator
) -> Callable[[Tree, Floats, int], None]:
    """How any planner grows its tree without looking where, as ``attempt`` wants it."""
    settings = RrtSettings()
    return lambda tree, goal, until: grow_rrt(
        tree, goal, until, NO_GUIDE, NO_LEAD, settings, vehicle, scene, rng
    )


def along_guide(
    guide: Guide | None, vehicle: Vehicle, scene: Scene, rng: np.random.Generator
) -> Callable[[Tree, Floats, int], None] | None:
    """How any planner grows its tree along a guide, as ``attempt`` wants it; None without a guide."""
    if guide is None:
        return None
    settings = RrtSettings()
    return lambda tree, goal, until: grow_rrt(
        tree, goal, until, guide, NO_LEAD, settings, vehicle, scene, rng
    )


def rrt(
    problem: Problem,
    settings: RrtSettings,
    rng: np.random.Generator,
    guide: Guide | None = None,
    scene: Scene | None = None,
    limits: Limits | None = None,
    vehicle: Vehicle = CAR,
    prefix: Plan | None = None,
) -> Outcome:
    """Plan from the problem's start to its goal disc; a guide leads the tree along its ways."""
    ready = scene_of(problem) if scene is None else scene
    guiding = NO_GUIDE if guide is None else guide
    return attempt(
        problem,
        ready,
        limits or Limits(),
        vehicle,
        prefix,
        settings.restart_after,
        lambda tree, goal, trial: None,
        lambda tree, goal, until: grow_rrt(
            tree, goal, until, guiding, NO_LEAD, settings, vehicle, ready, rng
        ),
    )
