"""What the last search left in the buffers of a workspace: its tree and its roadmap, to look at."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planners.search.follow import FollowSettings
from planners.search.gust import GustSettings
from planners.search.query import Limits
from planners.search.structures.roadmap import BLOCKED, EDGES, FREE, NODES, allocate_roadmap
from planners.search.structures.tree import SIZE, allocate_tree
from planners.world.arrays import Floats, Indices
from planners.world.vehicles.vehicle import Vehicle, state_size
from planners.world.workspace import Workspace


class Trace(NamedTuple):
    """A tree of states."""

    positions: Floats  # [n, 2] metres
    parents: Indices  # [n] -1: the root


class Roads(NamedTuple):
    """A roadmap."""

    nodes: Floats  # [n, 2] metres
    free: Indices  # [e, 2] ends of the strips that are known to be free
    unknown: Indices  # [u, 2] ends of the strips that were never checked


def last_tree(workspace: Workspace, limits: Limits, vehicle: Vehicle) -> Trace:
    """Copy the tree of the last search in a workspace with these limits and this vehicle.

    After restarts it is the tree of the last trial.
    """
    tree = workspace.buffers(allocate_tree, limits.nodes, state_size(vehicle))
    size = int(tree.counts[SIZE])
    parents = tree.parents[:size].copy()
    parents[parents >= size] = -1
    return Trace(tree.states[:size, :2].copy(), parents)


def last_roadmap(workspace: Workspace, planner: str) -> Roads | None:
    """Copy the roadmap of the last search in a workspace by a planner; None if it makes no roadmaps."""
    settings = {"gust": GustSettings().roadmap, "follow": FollowSettings().gust.roadmap}.get(planner)
    if settings is None:
        return None
    roadmap = workspace.buffers(allocate_roadmap, settings.most_nodes, settings.neighbours)
    nodes, edges = int(roadmap.counts[NODES]), int(roadmap.counts[EDGES])
    ends = np.stack([roadmap.edge_to[: 2 * edges : 2], roadmap.edge_to[1 : 2 * edges : 2]], axis=1)
    state = roadmap.edge_state[:edges]
    unknown = ends[(state != FREE) & (state != BLOCKED)]
    return Roads(roadmap.nodes[:nodes].copy(), ends[state == FREE].copy(), unknown.copy())
