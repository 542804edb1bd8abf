"""Places where two trees all but meet: what the arcs there cannot close, optimisation may.

With trailers there are many more states than nodes, so trees seldom have the same one. Where their first
bodies stand alike and their hitches differ, a few corrected arcs mostly do not lead from one to the other, or
hit something. Moved as a whole, the way over such a place is often a drive.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from planners.search.manoeuvres.arcs import lay_arc
from planners.search.manoeuvres.pose_tree import PLACE, PoseTree, list_links
from planners.world.arrays import Floats, Indices
from planners.world.driving_cost import gear_of
from planners.world.jit import lean
from planners.world.vehicles.dynamics import load, store
from planners.world.vehicles.vehicle import FIRST_HITCH, Vehicle

MOST: Final = 64  # of them are remembered, by a search that mends
SAME_PLACE: Final = (
    PLACE  # lengths of the first body: of those that are nearer to one another only one is remembered
)
SIZE: Final = 0  # index into NearMeetings.counts


class NearMeetings(NamedTuple):
    """Where trees all but met, since they began."""

    lasts: Indices  # [N] the node of the tree out of the start
    nodes: Indices  # [N] the node of the tree out of the goal
    off: Floats  # [N] by how much hitches differ in all, in radians
    tried: Indices  # [N] 1 if optimisation has had its try, else 0
    counts: Indices  # [1] how many there are


def allocate_near_meetings(most: int = MOST) -> NearMeetings:
    """Buffers for ``most``; there are none yet."""
    whole = [np.zeros(most, np.int64) for _ in range(3)]
    return NearMeetings(whole[0], whole[1], np.zeros(most), whole[2], np.zeros(1, np.int64))


def forget_near(near: NearMeetings) -> None:
    """There are none: the trees begin anew."""
    near.counts.fill(0)


@lean
def note_near(
    near: NearMeetings, before: PoseTree, last: int, tree: PoseTree, node: int, vehicle: Vehicle
) -> None:
    """Remember that node ``last`` of a tree out of the start is near a ``node`` of one out of the goal.

    Of several in about the same place, whatever their headings, the one is kept whose hitches differ least,
    unless one was tried there.
    """
    here = load(before.states, last, vehicle)
    there = load(tree.states, node, vehicle)
    off = 0.0
    for k in range(FIRST_HITCH, len(here)):
        off += abs(here[k] - there[k])
    apart = SAME_PLACE * (vehicle.front + vehicle.rear)
    at = -1
    for i in range(near.counts[SIZE]):
        state = load(before.states, near.lasts[i], vehicle)
        if math.hypot(state[0] - here[0], state[1] - here[1]) < apart:
            if near.tried[i] == 1 or near.off[i] <= off:
                return
            at = i
            break
    if at < 0:
        if near.counts[SIZE] == near.lasts.shape[0]:
            return
        at = near.counts[SIZE]
        near.counts[SIZE] += 1
    near.lasts[at] = last
    near.nodes[at] = node
    near.off[at] = off
    near.tried[at] = 0


@lean
def lay_way(
    way: Floats, chain: Indices, before: PoseTree, last: int, tree: PoseTree, node: int, vehicle: Vehicle
) -> int:
    """Lay the way from the start to node ``last``, and on from ``node`` to the goal.

    Args:
        way: ``[N, S]`` to be filled in with states, whose speeds only say in which gear they are driven.
        chain: ``[L]`` scratch.
        before: the tree out of the start; neither has known endings.
        last: its node.
        tree: the tree out of the goal.
        node: its node, near ``last``.
        vehicle: what is driven.

    Returns:
        How many states there are; 0 if there is no room.
    """
    links = list_links(before, last, chain)
    if links < 0:
        return 0
    at = 0
    for k in range(links):
        link = chain[k]
        state = load(before.states, before.parents[link], vehicle)
        gear = gear_of(before.metres[link])
        at = lay_arc(way, at, state, gear, before.bends[link], abs(before.metres[link]), 0.0, vehicle)
        if at < 0:
            return 0
    turn = 0.0
    if at > 0:
        off = (way[at - 1, 2] - tree.states[node, 2]) / (2.0 * math.pi)
        turn = 2.0 * math.pi * math.floor(off + 0.5)
    while node > 0:
        state = load(tree.states, node, vehicle)
        gear = gear_of(-tree.metres[node])
        at = lay_arc(way, at, state, gear, tree.bends[node], abs(tree.metres[node]), turn, vehicle)
        if at < 0:
            return 0
        node = tree.parents[node]
    if at == 0:
        return 0
    store(way, 0, load(before.states, 0, vehicle))
    way[at - 1, 3] = 0.0
    return at
