"""Drives from the start to a node of a goal tree, and from there to the goal."""

from __future__ import annotations

from planners.search.manoeuvres.driving import (
    SMALLEST,
    Drive,
    append,
    begin,
    connection_is_free,
    drive_arc,
    drive_word,
    turn_wheels,
)
from planners.search.manoeuvres.pose_tree import PoseTree, list_links
from planners.search.query import Endings
from planners.search.structures import tree as trees
from planners.world.arrays import Floats
from planners.world.driving_cost import extra_along, gear_of
from planners.world.geometry.collision import Scene
from planners.world.goal import reaches
from planners.world.jit import lean
from planners.world.vehicles.dynamics import admissible, load, step, store
from planners.world.vehicles.vehicle import Vehicle


@lean
def drive_to_goal(
    drive: Drive,
    before: PoseTree,
    last: int,
    tree: PoseTree,
    node: int,
    word: int,
    endings: Endings,
    goal: Floats,
    vehicle: Vehicle,
    scene: Scene,
) -> bool:
    """Drive from the start over arcs, then over a word to a node, and from there over arcs to the goal.

    The first arcs lead to node ``last`` of ``before``, the tree out of the start. Returns whether that leads
    to the goal, and nothing is in the way. The drive lies in ``drive`` then.
    """
    begin(drive, before.states)
    if not (_drive_out(drive, before, last, vehicle, scene) and drive_word(drive, word, vehicle, scene)):
        return False
    return _drive_in(drive, tree, node, endings, goal, vehicle, scene)


@lean
def _drive_out(drive: Drive, before: PoseTree, last: int, vehicle: Vehicle, scene: Scene) -> bool:
    """Drive over the arcs of the tree out of the start to a node."""
    chain = drive.join.chain
    links = list_links(before, last, chain)
    if links < 0:
        return False
    metres = 0.0
    for k in range(links):
        link = chain[k]
        metres += before.metres[link]
        if (
            k + 1 < links
            and before.bends[chain[k + 1]] == before.bends[link]
            and before.metres[chain[k + 1]] * metres > 0.0
        ):
            continue  # the next arc goes on
        gear = gear_of(metres)
        if not drive_arc(drive, gear, before.bends[link], abs(metres), vehicle, scene):
            return False
        metres = 0.0
    return True


@lean
def drive_arcs_to_goal(
    drive: Drive,
    before: PoseTree,
    links: int,
    tree: PoseTree,
    node: int,
    endings: Endings,
    goal: Floats,
    vehicle: Vehicle,
    scene: Scene,
) -> bool:
    """Drive from the start over the arcs of ``drive.join`` to a node, and from there to the goal.

    Before these arcs those of the first ``links`` nodes of ``drive.join.chain`` are driven, of the tree
    ``before`` that grew out of the start. Returns the same as ``drive_to_goal``.
    """
    begin(drive, before.states)
    for k in range(links):
        link = drive.join.chain[k]
        gear = gear_of(before.metres[link])
        if not drive_arc(drive, gear, before.bends[link], abs(before.metres[link]), vehicle, scene):
            return False
    arcs = drive.join.arcs
    for k in range(drive.join.counts[0]):
        if arcs[2, k] > SMALLEST and not drive_arc(drive, arcs[0, k], arcs[1, k], arcs[2, k], vehicle, scene):
            return False
    return _drive_in(drive, tree, node, endings, goal, vehicle, scene)


@lean
def _drive_known(drive: Drive, endings: Endings, part: int, vehicle: Vehicle, scene: Scene) -> bool:
    """Drive a part of the known endings by its controls."""
    c = drive.connection
    first = endings.starts[part]
    steps = endings.starts[part + 1] - 1 - first
    turning = turn_wheels(drive, endings.states[first, 4], vehicle)
    if turning < 0 or turning + steps > c.controls.shape[0]:
        return False
    state = load(c.states, turning, vehicle)
    for i in range(steps):
        acceleration = endings.controls[first + i, 0]
        second = endings.controls[first + i, 1]
        acceleration, second = admissible(state, acceleration, second, vehicle)
        c.controls[turning + i, 0] = acceleration
        c.controls[turning + i, 1] = second
        state = step(state, acceleration, second, vehicle)
        store(c.states, turning + i + 1, state)
    return bool(connection_is_free(drive, turning + steps, vehicle, scene) and append(drive, turning + steps))


@lean
def _drive_in(
    drive: Drive, tree: PoseTree, node: int, endings: Endings, goal: Floats, vehicle: Vehicle, scene: Scene
) -> bool:
    """Drive on over the tree's arcs from a node to the goal."""
    while node > 0:
        if tree.known[node] >= 0:
            if not _drive_known(drive, endings, tree.known[node], vehicle, scene):
                return False
            drive.counts[2] += 1
            node = tree.parents[node]
            continue
        gear = gear_of(-tree.metres[node])
        bend = tree.bends[node]
        metres = abs(tree.metres[node])
        node = tree.parents[node]
        while tree.known[node] < 0 and tree.bends[node] == bend and gear * tree.metres[node] < 0.0:
            metres += abs(tree.metres[node])
            node = tree.parents[node]
        if not drive_arc(drive, gear, bend, metres, vehicle, scene):
            return False
    return reaches(load(drive.states, drive.counts[0], vehicle), goal)


@lean
def add_to_tree(drive: Drive, tree: trees.Tree, states: Floats, controls: Floats, vehicle: Vehicle) -> bool:
    """Add a drive to the goal to the root of a tree, unless it costs too much or has no room.

    What is driven before it, over ``states [n + 1, S]`` by ``controls [n, 2]``, comes first.
    """
    length = drive.counts[0]
    steps = controls.shape[0] + length
    counts = tree.counts
    extra = extra_along(states, 0.0, vehicle)
    extra += extra_along(drive.states[: length + 1], states[-1, 3], vehicle)
    if steps * vehicle.dt + extra >= tree.bound[0] or counts[trees.SIZE] + steps > tree.states.shape[0]:
        return False
    last = trees.add_drive(tree, 0, states[1:], controls, vehicle)
    last = trees.add_drive(tree, last, drive.states[1 : length + 1], drive.controls[:length], vehicle)
    counts[trees.GOAL_VERTEX] = last
    return True
