"""Joins two trees, one out of the start and one out of the goal, where a node of each has the same place."""

from __future__ import annotations

from typing import Final

from planners.search.manoeuvres.arriving import drive_arcs_to_goal
from planners.search.manoeuvres.driving import Drive
from planners.search.manoeuvres.joining import ARCS, BEFORE, MOST_ARCS, arcs_are_free, close
from planners.search.manoeuvres.pose_tree import CHECKS, PoseTree, list_links
from planners.search.manoeuvres.ways import meeting_is_worth
from planners.search.query import Endings
from planners.world.arrays import Floats
from planners.world.driving_cost import gear_of
from planners.world.geometry.collision import Scene
from planners.world.jit import lean
from planners.world.vehicles.vehicle import Vehicle

BENT: Final = MOST_ARCS // 2  # arcs before the meeting that are corrected, and after it


@lean
def meet(
    before: PoseTree,
    last: int,
    tree: PoseTree,
    node: int,
    endings: Endings,
    goal: Floats,
    drive: Drive,
    vehicle: Vehicle,
    scene: Scene,
) -> bool:
    """Correct the arcs to ``last`` and on from ``node`` so that they fit; drive them, and to the goal.

    Args:
        before: the tree out of the start.
        last: its node.
        tree: the tree out of the goal.
        node: its node, near ``last``.
        endings: what is known, which may lead on from ``node``.
        goal: that of ``goal_of``.
        drive: to be filled in.
        vehicle: what is driven.
        scene: what must not be met.

    Returns:
        Whether that leads to the goal, nothing is in the way, and it is worth it.
    """
    if not meeting_is_worth(drive.ways, before, last, tree, node, vehicle):
        return False
    join = drive.join
    links = list_links(before, last, join.chain)
    if links < 0:
        return False
    straight = max(links - BENT, 0)
    base = join.chain[straight - 1] if straight > 0 else 0
    for k in range(join.base.shape[1]):
        join.base[0, k] = before.states[base, k]
    join.counts[ARCS] = join.counts[BEFORE] = links - straight
    for k in range(links - straight):
        each = join.chain[straight + k]
        join.arcs[0, k] = gear_of(before.metres[each])
        join.arcs[1, k] = before.bends[each]
        join.arcs[2, k] = abs(before.metres[each])
    while join.counts[ARCS] < links - straight + BENT and node > 0 and tree.known[node] < 0:
        k = join.counts[ARCS]
        join.arcs[0, k] = gear_of(-tree.metres[node])
        join.arcs[1, k] = tree.bends[node]
        join.arcs[2, k] = abs(tree.metres[node])
        join.counts[ARCS] += 1
        node = tree.parents[node]
    for k in range(join.base.shape[1]):
        join.ends[1, k] = tree.states[node, k]
    if not close(join.base, join, vehicle):
        return False
    join.counts[BEFORE] = join.counts[ARCS]  # once more, exactly as it is driven
    if not close(join.base, join, vehicle):
        return False
    free, checks = arcs_are_free(join.base, join, vehicle, scene)
    tree.counts[CHECKS] += checks
    return free and bool(
        drive_arcs_to_goal(drive, before, straight, tree, node, endings, goal, vehicle, scene)
    )
