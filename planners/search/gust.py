"""GUST (Plaku, T-RO 2015): a roadmap groups the tree's vertices and tells which group to extend."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.random import BitGenerator

from planners.search.guides.sampling import in_bounds, in_disc, uniform
from planners.search.outcome import Outcome
from planners.search.query import Guide, Query
from planners.search.rrt import along_guide, growing
from planners.search.search_loop import search
from planners.search.structures import tree as trees
from planners.search.structures.neighbours import nearest_for
from planners.search.structures.roadmap import CHECKS as ROADMAP_CHECKS
from planners.search.structures.roadmap import (
    Roadmap,
    RoadmapSettings,
    allocate_roadmap,
    build_roadmap,
    resample_path,
    roadmap_guide,
)
from planners.world.arrays import Floats, Indices
from planners.world.geometry.collision import Scene
from planners.world.jit import inlined, lean
from planners.world.trigonometry import length
from planners.world.vehicles.vehicle import Vehicle

SAMPLE = 32  # vertices of a group that may be chosen: a uniform sample of all that it ever had


class GustSettings(NamedTuple):
    """Defaults of docs/planners.md, GUST."""

    roadmap: RoadmapSettings = RoadmapSettings()
    distance_exponent: float = 8.0  # delta: how strongly groups near the goal are preferred
    selection_penalty: float = 0.9  # alpha
    guide_probability: float = 0.9  # that a target lies on the path ahead; else it is uniform
    guide_spacing_m: float = 5.0
    guide_steps: int = 6  # a target is U{1 .. this} points ahead
    guide_radius_m: float = 2.0
    restart_after: int = 500  # expansions; every second trial is grown by RRT
    extension: trees.Extension = trees.EXTENSION


class Groups(NamedTuple):
    """The tree's vertices grouped by their nearest roadmap node. Weights are logarithms: none underflows."""

    weights: Floats  # [C] logarithm of the weight of each node's group
    counts: Indices  # [C] vertices ever put into each group
    members: Indices  # [C, SAMPLE] a uniform sample of them
    active: Indices  # [C] nodes that have a group, in the order in which they got it
    size: Indices  # [1] how many those are
    ahead: Floats  # [8, 2] scratch: points on the path ahead of a group, metres


def allocate_groups(capacity: int) -> Groups:
    """Buffers for groups of ``capacity`` roadmap nodes."""
    return Groups(
        np.empty(capacity),
        np.empty(capacity, np.int64),
        np.empty((capacity, SAMPLE), np.int64),
        np.empty(capacity, np.int64),
        np.zeros(1, np.int64),
        np.empty((8, 2)),
    )


@lean
def clear_groups(groups: Groups) -> None:
    """Forget all groups."""
    groups.counts.fill(0)
    groups.size[0] = 0


@inlined
def keep(members: Indices, count: int, vertex: int, rng: BitGenerator) -> None:
    """Keep a uniform sample of all vertices so far: ``count``, and this one (algorithm R)."""
    index = count
    if count >= members.shape[0]:
        index = int(uniform(rng) * (count + 1))
    if index < members.shape[0]:
        members[index] = vertex


@lean
def join_groups(
    tree: trees.Tree,
    first: int,
    count: int,
    roadmap: Roadmap,
    groups: Groups,
    distance_exponent: float,
    rng: BitGenerator,
) -> None:
    """Put ``count`` vertices from ``first`` on into the groups of their nearest roadmap nodes."""
    node = -1
    far_m = 0.0  # up to here from (here_x, here_y) the node is certainly the nearest
    here_x = 0.0
    here_y = 0.0
    for vertex in range(first, first + count):
        x = tree.states[vertex, 0]
        y = tree.states[vertex, 1]
        if node < 0 or length(x - here_x, y - here_y) >= far_m:
            here_x = x
            here_y = y
            node, far_m = nearest_for(roadmap.connected, x, y)
        if groups.counts[node] == 0:
            groups.active[groups.size[0]] = node
            groups.size[0] += 1
            groups.weights[node] = -distance_exponent * math.log(max(roadmap.distances[node], 1e-3))
        keep(groups.members[node], groups.counts[node], vertex, rng)
        groups.counts[node] += 1


@inlined
def heaviest(groups: Groups) -> int:
    """The node whose group weighs most."""
    best = groups.active[0]
    for i in range(1, groups.size[0]):
        if groups.weights[groups.active[i]] > groups.weights[best]:
            best = groups.active[i]
    return int(best)


@lean
def choose_member(
    tree: trees.Tree, members: Indices, count: int, x: float, y: float, vehicle: Vehicle, rng: BitGenerator
) -> int:
    """Choose a vertex, preferably one that was reached soon and can reach (x, y) soon.

    Its probability is proportional to 1 / (time from the root + distance / max(0.01 v_max, v)).
    """
    candidates = min(count, members.shape[0])
    total = 0.0
    chosen = members[0]
    for k in range(candidates):
        vertex = members[k]
        if tree.spent[vertex]:
            continue
        distance = length(tree.states[vertex, 0] - x, tree.states[vertex, 1] - y)
        speed = max(0.01 * vehicle.max_speed, tree.states[vertex, 3])
        weight = 1.0 / (tree.depths[vertex] * vehicle.dt + distance / speed + 1e-9)
        total += weight
        if uniform(rng) * total < weight:  # so each is kept in proportion to its weight, in one pass
            chosen = vertex
    return int(chosen)


@lean
def grow_gust(
    tree: trees.Tree,
    goal: Floats,
    until: int,
    roadmap: Roadmap,
    groups: Groups,
    settings: GustSettings,
    vehicle: Vehicle,
    scene: Scene,
    rng: BitGenerator,
) -> None:
    """Extend the heaviest group until solved or ``until`` expansions."""
    no_lead = groups.ahead[:0]
    counts = tree.counts
    while counts[trees.EXPANSIONS] < until and counts[trees.SIZE] < tree.states.shape[0]:
        node = heaviest(groups)
        groups.weights[node] += math.log(settings.selection_penalty)
        if uniform(rng) < settings.guide_probability:
            ahead = 1 + int(uniform(rng) * settings.guide_steps)
            filled = resample_path(roadmap, node, settings.guide_spacing_m, groups.ahead[: ahead + 2])
            point = groups.ahead[min(ahead, filled - 1)]
            x, y = in_disc(point[0], point[1], settings.guide_radius_m, rng)
        else:
            x, y = in_bounds(scene.bounds, rng)
        vertex = choose_member(tree, groups.members[node], groups.counts[node], x, y, vehicle, rng)
        first = counts[trees.SIZE]
        added = trees.extend(
            tree, vertex, x, y, goal, no_lead, 0.0, 0.0, settings.extension, vehicle, scene, rng
        )
        if counts[trees.GOAL_VERTEX] >= 0:
            return
        join_groups(tree, first, added, roadmap, groups, settings.distance_exponent, rng)


@lean
def begin_gust(
    tree: trees.Tree,
    goal: Floats,
    guide: Guide,
    roadmap: Roadmap,
    groups: Groups,
    settings: GustSettings,
    vehicle: Vehicle,
    scene: Scene,
    rng: BitGenerator,
) -> None:
    """Build the roadmap, near the plans of a guide, and group the vertices that the tree has already."""
    build_roadmap(roadmap, tree.states[0], goal, guide, settings.roadmap, vehicle, scene, rng)
    tree.counts[trees.CHECKS] += roadmap.counts[ROADMAP_CHECKS]
    clear_groups(groups)
    join_groups(tree, 0, tree.counts[trees.SIZE], roadmap, groups, settings.distance_exponent, rng)


def larger(settings: GustSettings, trial: int) -> GustSettings:
    """Double the roadmap with each ``trial``, because the last one did not lead to the goal."""
    roadmap = settings.roadmap
    batch = min(roadmap.batch * 2**trial, roadmap.most_nodes)
    return settings._replace(roadmap=roadmap._replace(batch=batch)) if trial else settings


def gust(query: Query, settings: GustSettings) -> Outcome:
    """Plan from the problem's start to its goal disc; a guide leads the tree or places nodes."""
    sizes = settings.roadmap.most_nodes, settings.roadmap.neighbours
    roadmap = query.workspace.buffers(allocate_roadmap, *sizes)
    groups = query.workspace.buffers(allocate_groups, settings.roadmap.most_nodes)
    vehicle, scene, rng = query.vehicle, query.scene, query.rng.bit_generator
    near = roadmap_guide(query)

    def prepare(tree: trees.Tree, goal: Floats, trial: int) -> None:
        begin_gust(tree, goal, near, roadmap, groups, larger(settings, trial), vehicle, scene, rng)

    def grow(tree: trees.Tree, goal: Floats, until: int) -> None:
        grow_gust(tree, goal, until, roadmap, groups, settings, vehicle, scene, rng)

    explore, along = growing(query), along_guide(query)
    return search(query, settings.restart_after, prepare, grow, explore, along)
