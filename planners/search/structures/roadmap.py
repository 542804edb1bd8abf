"""The roadmap of GUST and Follow: free points, the strips between them, and the shortest paths to the goal.

A strip is checked only if Dijkstra's search would use it, which gives the same paths with far fewer checks.
Batches of points are added until the start is connected.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.random import BitGenerator

from planners.search.guides.sampling import guided, in_bounds, uniform
from planners.search.query import NO_GUIDE, Guide, Query
from planners.search.structures.neighbours import Buckets, allocate_buckets, clear_buckets, nearest_k, put
from planners.world.arrays import Floats, Indices
from planners.world.geometry.clearance import clearance, strip_is_free
from planners.world.geometry.collision import Scene, box_is_free
from planners.world.jit import inlined, lean
from planners.world.vehicles.vehicle import Vehicle

BUCKET_M = 8.0  # nodes lie some 6 m apart
GOAL, START = 0, 1  # the first two nodes
# indices into Roadmap.counts
NODES, CHECKS, EDGES, QUEUED = range(4)
UNKNOWN, FREE, BLOCKED = range(3)
ANYWHERE = NO_GUIDE._replace(goal_probability=0.0)


class RoadmapSettings(NamedTuple):
    """How a roadmap is built (docs/planners.md). ``make speed`` measures that this batch and k are best."""

    batch: int = 100  # nodes drawn before each search for a path from the start
    neighbours: int = 8
    most_nodes: int = 3000
    body_length_scale: float = 1.5  # the body at a node must be free, with a little more room than it needs
    body_width_scale: float = 1.25
    clearance_exponent: float = 0.0  # edge cost: length / clearance^f; GUST 0, Follow 1
    clearance_limit_m: float = 5.0  # a larger clearance counts as this one
    guide_radius_m: float = 4.0  # guided nodes lie within this distance of a state of a recalled plan


class Roadmap(NamedTuple):
    """Nodes, edges, and the path from each node to the goal."""

    nodes: Floats  # [C, 2] metres
    clearances: Floats  # [C] metres to the nearest obstacle
    distances: Floats  # [C] d(q): cost of the path to the goal, infinite if there is none
    following: Indices  # [C] the next node of that path
    heads: Indices  # [C] first edge of a node, -1: none
    edge_next: Indices  # [E] the next edge of the same node; edges 2i and 2i + 1 are one in both directions
    edge_to: Indices  # [E] the node at the other end
    edge_state: Indices  # [E / 2] UNKNOWN, FREE, BLOCKED
    edge_length: Floats  # [E / 2] metres
    heap: Indices  # [C] binary heap of Dijkstra's search
    heap_index: Indices  # [C] where a node is in the heap, -1: not in it
    counts: Indices  # [4] NODES, CHECKS, EDGES, QUEUED
    sampled: Buckets  # all nodes
    connected: Buckets  # the nodes that reach the goal
    near_items: Indices  # [k] scratch
    near_distances: Floats  # [k] scratch


def allocate_roadmap(capacity: int, neighbours: int) -> Roadmap:
    """Buffers for ``capacity`` nodes with edges to ``neighbours`` others each."""
    nodes = np.empty((capacity, 2))
    edges = 2 * capacity * neighbours
    return Roadmap(
        nodes,
        np.empty(capacity),
        np.empty(capacity),
        np.empty(capacity, np.int64),
        np.empty(capacity, np.int64),
        np.empty(edges, np.int64),
        np.empty(edges, np.int64),
        np.empty(edges // 2, np.int64),
        np.empty(edges // 2),
        np.empty(capacity, np.int64),
        np.empty(capacity, np.int64),
        np.zeros(4, np.int64),
        allocate_buckets(),
        allocate_buckets(),
        np.empty(neighbours, np.int64),
        np.empty(neighbours),
    )


@lean
def add_node(roadmap: Roadmap, x: float, y: float, settings: RoadmapSettings, scene: Scene) -> None:
    """Add a node at (x, y), and edges to its nearest neighbours."""
    counts = roadmap.counts
    new = counts[NODES]
    counts[NODES] += 1
    roadmap.nodes[new, 0] = x
    roadmap.nodes[new, 1] = y
    roadmap.heads[new] = -1
    if settings.clearance_exponent > 0.0:
        roadmap.clearances[new] = clearance(x, y, settings.clearance_limit_m, scene)
    for k in range(nearest_k(roadmap.sampled, x, y, roadmap.near_items, roadmap.near_distances)):
        other = roadmap.near_items[k]
        edge = counts[EDGES]
        roadmap.edge_state[edge] = UNKNOWN
        roadmap.edge_length[edge] = roadmap.near_distances[k]
        roadmap.edge_to[2 * edge] = other
        roadmap.edge_next[2 * edge] = roadmap.heads[new]
        roadmap.heads[new] = 2 * edge
        roadmap.edge_to[2 * edge + 1] = new
        roadmap.edge_next[2 * edge + 1] = roadmap.heads[other]
        roadmap.heads[other] = 2 * edge + 1
        counts[EDGES] += 1
    put(roadmap.sampled, new, x, y)


@inlined
def sift_up(roadmap: Roadmap, index: int) -> None:
    """Move an entry of the heap towards the root until its parent is no farther from the goal."""
    heap = roadmap.heap
    node = heap[index]
    while index > 0:
        parent = (index - 1) // 2
        if roadmap.distances[heap[parent]] <= roadmap.distances[node]:
            break
        heap[index] = heap[parent]
        roadmap.heap_index[heap[index]] = index
        index = parent
    heap[index] = node
    roadmap.heap_index[node] = index


@inlined
def pop(roadmap: Roadmap) -> int:
    """Take the nearest node off the heap."""
    heap = roadmap.heap
    roadmap.counts[QUEUED] -= 1
    size = roadmap.counts[QUEUED]
    top = heap[0]
    roadmap.heap_index[top] = -1
    node = heap[size]
    index = 0
    while True:
        child = 2 * index + 1
        if child >= size:
            break
        if child + 1 < size and (roadmap.distances[heap[child + 1]] < roadmap.distances[heap[child]]):
            child += 1
        if roadmap.distances[heap[child]] >= roadmap.distances[node]:
            break
        heap[index] = heap[child]
        roadmap.heap_index[heap[index]] = index
        index = child
    heap[index] = node
    roadmap.heap_index[node] = index
    return int(top)


@lean
def search_from_goal(roadmap: Roadmap, settings: RoadmapSettings, vehicle: Vehicle, scene: Scene) -> None:
    """Dijkstra's search from the goal: d(q) and the next node of every node that reaches the goal."""
    count = roadmap.counts[NODES]
    for node in range(count):
        roadmap.distances[node] = math.inf
        roadmap.following[node] = -1
        roadmap.heap_index[node] = -1
    nodes = roadmap.nodes
    clear_buckets(roadmap.connected, scene.bounds, BUCKET_M)
    roadmap.distances[GOAL] = 0.0
    roadmap.heap[0] = GOAL
    roadmap.heap_index[GOAL] = 0
    roadmap.counts[QUEUED] = 1
    while roadmap.counts[QUEUED] > 0:
        node = pop(roadmap)
        put(roadmap.connected, node, nodes[node, 0], nodes[node, 1])
        edge = roadmap.heads[node]
        while edge >= 0:
            other = roadmap.edge_to[edge]
            cost = roadmap.edge_length[edge // 2]
            if settings.clearance_exponent > 0.0:
                room = max(min(roadmap.clearances[node], roadmap.clearances[other]), 1e-3)
                cost /= room**settings.clearance_exponent
            cost += roadmap.distances[node]
            if cost < roadmap.distances[other] and roadmap.edge_state[edge // 2] != BLOCKED:
                if roadmap.edge_state[edge // 2] == UNKNOWN:
                    free, checks = strip_is_free(
                        nodes[node, 0],
                        nodes[node, 1],
                        nodes[other, 0],
                        nodes[other, 1],
                        0.5 * vehicle.width,
                        scene,
                    )
                    roadmap.counts[CHECKS] += checks
                    roadmap.edge_state[edge // 2] = FREE if free else BLOCKED
                if roadmap.edge_state[edge // 2] == FREE:
                    roadmap.distances[other] = cost
                    roadmap.following[other] = node
                    if roadmap.heap_index[other] < 0:
                        roadmap.heap[roadmap.counts[QUEUED]] = other
                        roadmap.heap_index[other] = roadmap.counts[QUEUED]
                        roadmap.counts[QUEUED] += 1
                    sift_up(roadmap, roadmap.heap_index[other])
            edge = roadmap.edge_next[edge]


@lean
def grow_roadmap(
    roadmap: Roadmap,
    batch: int,
    goal: Floats,
    guide: Guide,
    settings: RoadmapSettings,
    vehicle: Vehicle,
    scene: Scene,
    rng: BitGenerator,
) -> None:
    """Draw ``batch`` nodes, keep the free ones, and search from the goal again.

    They lie near the guide's plans, in the goal disc, or anywhere; without plans they lie anywhere.
    """
    half_length = 0.5 * settings.body_length_scale * (vehicle.front + vehicle.rear)
    half_width = 0.5 * settings.body_width_scale * vehicle.width
    for _ in range(batch):
        if roadmap.counts[NODES] == roadmap.nodes.shape[0]:
            break
        if guide.probabilities.shape[0] > 0:
            x, y, _, _ = guided(
                guide, goal, scene.bounds, settings.guide_radius_m, settings.guide_radius_m, rng
            )
        else:
            x, y = in_bounds(scene.bounds, rng)
        heading = 2.0 * math.pi * uniform(rng)
        roadmap.counts[CHECKS] += 1
        cos = math.cos(heading)
        sin = math.sin(heading)
        if box_is_free((x, y, cos, sin, half_length, half_width), scene):
            add_node(roadmap, x, y, settings, scene)
    search_from_goal(roadmap, settings, vehicle, scene)


@lean
def build_roadmap(
    roadmap: Roadmap,
    start: Floats,
    goal: Floats,
    guide: Guide,
    settings: RoadmapSettings,
    vehicle: Vehicle,
    scene: Scene,
    rng: BitGenerator,
) -> bool:
    """Draw batches until the start reaches the goal. Returns False if ``most_nodes`` do not suffice.

    The nodes of the first batch lie where the guide says, those of later ones anywhere.
    """
    anywhere = Guide(guide.points[:0], guide.starts[:1], guide.probabilities[:0], 0.0, 0)
    roadmap.counts.fill(0)
    clear_buckets(roadmap.sampled, scene.bounds, BUCKET_M)
    add_node(roadmap, goal[0], goal[1], settings, scene)
    add_node(roadmap, start[0], start[1], settings, scene)
    grow_roadmap(roadmap, settings.batch, goal, guide, settings, vehicle, scene, rng)
    draws = settings.batch
    while roadmap.distances[START] == math.inf and draws < settings.most_nodes:
        grow_roadmap(roadmap, settings.batch, goal, anywhere, settings, vehicle, scene, rng)
        draws += settings.batch
    return bool(roadmap.distances[START] < math.inf)


def roadmap_guide(query: Query) -> Guide:
    """Return the guide near whose plans a query's roadmaps have their nodes, or ``ANYWHERE``."""
    return query.guide if query.guide is not None and query.guide.lead == 0 else ANYWHERE


@lean
def resample_path(roadmap: Roadmap, node: int, spacing_m: float, points: Floats) -> int:
    """Fill in ``points [m, 2]``, ``spacing_m`` apart on the path from ``node`` to the goal; how many."""
    nodes = roadmap.nodes
    points[0, 0] = nodes[node, 0]
    points[0, 1] = nodes[node, 1]
    filled = 1
    left = spacing_m  # metres until the next point
    while roadmap.following[node] >= 0 and filled < points.shape[0] - 1:
        after = roadmap.following[node]
        length = math.hypot(nodes[after, 0] - nodes[node, 0], nodes[after, 1] - nodes[node, 1])
        along = left
        while along <= length and filled < points.shape[0] - 1:
            share = along / length
            points[filled, 0] = nodes[node, 0] + share * (nodes[after, 0] - nodes[node, 0])
            points[filled, 1] = nodes[node, 1] + share * (nodes[after, 1] - nodes[node, 1])
            filled += 1
            along += spacing_m
        left = along - length
        node = after
    points[filled, 0] = nodes[GOAL, 0]
    points[filled, 1] = nodes[GOAL, 1]
    return filled + 1
