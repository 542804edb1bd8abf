"""Kinodynamic RRT (LaValle and Kuffner 2001) extends the vertex nearest to a random target towards it."""

from __future__ import annotations

from typing import NamedTuple

from numpy.random import BitGenerator

from planners.search.guides.sampling import guided
from planners.search.outcome import Outcome
from planners.search.query import NO_GUIDE, Guide, Query
from planners.search.search_loop import Grow, search
from planners.search.structures import tree as trees
from planners.search.structures.neighbours import nearest
from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene
from planners.world.jit import lean
from planners.world.vehicles.vehicle import Vehicle


class RrtSettings(NamedTuple):
    """Defaults of docs/planners.md. Without a guide the goal is drawn with ``NO_GUIDE.goal_probability``."""

    guide_near_m: float = 2.0
    guide_far_m: float = 4.0
    restart_after: int = 1000  # expansions
    extension: trees.Extension = trees.EXTENSION


RRT = RrtSettings()


@lean
def grow_rrt(
    tree: trees.Tree,
    goal: Floats,
    until: int,
    guide: Guide,
    no_lead: Floats,
    settings: RrtSettings,
    vehicle: Vehicle,
    scene: Scene,
    rng: BitGenerator,
) -> None:
    """Extend along the guide, or towards anywhere, until it is solved or there are ``until`` expansions."""
    counts = tree.counts
    while counts[trees.EXPANSIONS] < until and counts[trees.SIZE] < tree.states.shape[0]:
        from_x, from_y, x, y = guided(
            guide, goal, scene.bounds, settings.guide_near_m, settings.guide_far_m, rng
        )
        vertex = max(nearest(tree.buckets, from_x, from_y), 0)  # the root if all others are dead ends
        trees.extend(tree, vertex, x, y, goal, no_lead, 0.0, 0.0, settings.extension, vehicle, scene, rng)
        if counts[trees.GOAL_VERTEX] >= 0:
            return


def growing(query: Query, guide: Guide = NO_GUIDE, settings: RrtSettings = RRT) -> Grow:
    """How RRT grows a tree: along a guide, or towards anywhere. Other planners use it for a while, too."""
    bits = query.rng.bit_generator
    return lambda tree, goal, until: grow_rrt(
        tree, goal, until, guide, trees.NO_LEAD, settings, query.vehicle, query.scene, bits
    )


def along_guide(query: Query) -> Grow | None:
    """How a planner with a roadmap grows its tree along a guide first; None without a guide to go along."""
    guide = query.guide
    return None if guide is None or guide.lead == 0 else growing(query, guide)


def rrt(query: Query, settings: RrtSettings) -> Outcome:
    """Plan from the problem's start to its goal disc; a guide leads the tree along its paths."""
    guide = NO_GUIDE if query.guide is None else query.guide
    return search(
        query,
        settings.restart_after,
        lambda tree, goal, trial: None,
        growing(query, guide, settings),
    )
