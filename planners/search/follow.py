"""Follow (Plaku, Plaku and Simari, Robotica 2018): the tree closely follows a lead path over a roadmap."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.random import BitGenerator

from planners.search import gust
from planners.search.guides.sampling import in_disc, uniform
from planners.search.gust import GustSettings
from planners.search.outcome import Outcome
from planners.search.query import Guide, Query
from planners.search.rrt import along_guide, growing
from planners.search.search_loop import search
from planners.search.structures.roadmap import (
    Roadmap,
    RoadmapSettings,
    allocate_roadmap,
    resample_path,
    roadmap_guide,
)
from planners.search.structures.tree import EXPANSIONS, GOAL_VERTEX, SIZE, Tree, extend
from planners.world.arrays import Floats, Indices
from planners.world.geometry.collision import Scene
from planners.world.jit import lean
from planners.world.vehicles.vehicle import Vehicle

LONGEST_LEAD = 256  # waypoints
# indices into Lead.marks
LENGTH, SINCE_FOLLOW, SINCE_GROUP = range(3)


class FollowSettings(NamedTuple):
    """Defaults of docs/planners.md, Follow. An edge of the roadmap costs length / clearance.

    Distances, patience and penalty are published for a car of 2.25 m/s (3 m, 2 m, 150, 100, 0.95). At 4 m/s
    the values here take half the time.
    """

    gust: GustSettings = GustSettings(
        roadmap=RoadmapSettings(batch=60, neighbours=12, clearance_exponent=1.0)
    )
    spacing_m: float = 5.0  # R: between waypoints, and the radius of the tube around the lead
    passing_m: float = 5.0  # within this distance a waypoint counts as passed
    near_radius_m: float = 2.0  # targets lie around the next waypoint, within this radius ...
    far_radius_m: float = 3.0  # ... or, as often, within this one
    progress_base: float = 4.0  # the weight of a group is this to the power of its waypoint
    selection_penalty: float = 0.9
    patience: int = 100  # iterations without a new follow group, after which a new lead may be drawn
    group_patience: int = 100  # iterations without a new GUST group, after which GUST explores ...
    explorations: int = 20  # ... for so many expansions


class Lead(NamedTuple):
    """The path that is followed, and the groups of vertices by their next waypoint."""

    points: Floats  # [LONGEST_LEAD, 2] metres
    weights: Floats  # [LONGEST_LEAD] logarithms
    counts: Indices  # [LONGEST_LEAD] vertices ever put into each group
    members: Indices  # [LONGEST_LEAD, SAMPLE] a uniform sample of them
    marks: Indices  # [3] LENGTH of the path, iterations SINCE_FOLLOW and SINCE_GROUP were new


def allocate_lead() -> Lead:
    """Buffers for a lead path."""
    return Lead(
        np.empty((LONGEST_LEAD, 2)),
        np.empty(LONGEST_LEAD),
        np.empty(LONGEST_LEAD, np.int64),
        np.empty((LONGEST_LEAD, gust.SAMPLE), np.int64),
        np.zeros(3, np.int64),
    )


@lean
def _join_lead(tree: Tree, vertex: int, lead: Lead, progress_base: float, rng: BitGenerator) -> None:
    waypoint = tree.waypoints[vertex]
    if lead.counts[waypoint] == 0:
        lead.weights[waypoint] = waypoint * math.log(progress_base)
        lead.marks[SINCE_FOLLOW] = 0
    gust.keep(lead.members[waypoint], lead.counts[waypoint], vertex, rng)
    lead.counts[waypoint] += 1


@lean
def _new_lead(
    tree: Tree,
    node: int,
    roadmap: Roadmap,
    groups: gust.Groups,
    lead: Lead,
    settings: FollowSettings,
    rng: BitGenerator,
) -> None:
    """Follow the roadmap's path from ``node`` from now on, beginning with the vertices of its group."""
    lead.marks[LENGTH] = resample_path(roadmap, node, settings.spacing_m, lead.points)
    lead.counts.fill(0)
    for k in range(min(groups.counts[node], gust.SAMPLE)):
        vertex = groups.members[node, k]
        tree.waypoints[vertex] = 0
        _join_lead(tree, vertex, lead, settings.progress_base, rng)
    lead.marks[SINCE_FOLLOW] = 0


@lean
def _grow(
    tree: Tree,
    goal: Floats,
    until: int,
    roadmap: Roadmap,
    groups: gust.Groups,
    lead: Lead,
    settings: FollowSettings,
    exploring: GustSettings,
    vehicle: Vehicle,
    scene: Scene,
    rng: BitGenerator,
) -> None:
    counts = tree.counts
    marks = lead.marks
    base = settings.gust
    while counts[EXPANSIONS] < until and counts[SIZE] < tree.states.shape[0]:
        groups_before = groups.size[0]
        if marks[SINCE_GROUP] >= settings.group_patience:
            last = min(counts[EXPANSIONS] + settings.explorations, until)
            gust.grow_gust(tree, goal, last, roadmap, groups, exploring, vehicle, scene, rng)
            if counts[GOAL_VERTEX] >= 0:
                return
            marks[SINCE_GROUP] = 0
            continue
        stuck = marks[SINCE_FOLLOW]
        if stuck > settings.patience and uniform(rng) < 0.5 * 2.0 ** (stuck / settings.patience - 1.0):
            node = gust.heaviest(groups)
            groups.weights[node] += math.log(base.selection_penalty)
            _new_lead(tree, node, roadmap, groups, lead, settings, rng)
        waypoint = 0
        best = -math.inf
        for i in range(marks[LENGTH]):
            if lead.counts[i] > 0 and lead.weights[i] > best:
                best = lead.weights[i]
                waypoint = i
        lead.weights[waypoint] += math.log(settings.selection_penalty)
        radius = settings.near_radius_m if uniform(rng) < 0.5 else settings.far_radius_m
        x, y = in_disc(lead.points[waypoint, 0], lead.points[waypoint, 1], radius, rng)
        vertex = gust.choose_member(tree, lead.members[waypoint], lead.counts[waypoint], x, y, vehicle, rng)
        first = counts[SIZE]
        marks[SINCE_FOLLOW] += 1
        marks[SINCE_GROUP] += 1
        added = extend(
            tree,
            vertex,
            x,
            y,
            goal,
            lead.points[: marks[LENGTH]],
            settings.spacing_m,
            settings.passing_m,
            base.extension,
            vehicle,
            scene,
            rng,
        )
        if counts[GOAL_VERTEX] >= 0:
            return
        for new in range(first, first + added):
            _join_lead(tree, new, lead, settings.progress_base, rng)
        gust.join_groups(tree, first, added, roadmap, groups, base.distance_exponent, rng)
        if groups.size[0] > groups_before:
            marks[SINCE_GROUP] = 0


@lean
def _begin(
    tree: Tree,
    goal: Floats,
    guide: Guide,
    roadmap: Roadmap,
    groups: gust.Groups,
    lead: Lead,
    settings: FollowSettings,
    vehicle: Vehicle,
    scene: Scene,
    rng: BitGenerator,
) -> None:
    """Begin as GUST does, and choose a first lead."""
    gust.begin_gust(tree, goal, guide, roadmap, groups, settings.gust, vehicle, scene, rng)
    lead.marks.fill(0)
    _new_lead(tree, gust.heaviest(groups), roadmap, groups, lead, settings, rng)


def follow(query: Query, settings: FollowSettings) -> Outcome:
    """Plan from the problem's start to its goal disc; a guide leads the tree or places nodes."""
    on_roadmap = settings.gust.roadmap
    roadmap = query.workspace.buffers(allocate_roadmap, on_roadmap.most_nodes, on_roadmap.neighbours)
    groups = query.workspace.buffers(gust.allocate_groups, on_roadmap.most_nodes)
    lead = query.workspace.buffers(allocate_lead)
    vehicle, scene, rng = query.vehicle, query.scene, query.rng.bit_generator
    exploring = settings.gust._replace(guide_probability=0.0)
    near = roadmap_guide(query)

    def prepare(tree: Tree, goal: Floats, trial: int) -> None:
        begun = settings._replace(gust=gust.larger(settings.gust, trial))
        _begin(tree, goal, near, roadmap, groups, lead, begun, vehicle, scene, rng)

    def grow(tree: Tree, goal: Floats, until: int) -> None:
        _grow(tree, goal, until, roadmap, groups, lead, settings, exploring, vehicle, scene, rng)

    explore, along = growing(query), along_guide(query)
    return search(query, settings.gust.restart_after, prepare, grow, explore, along)
