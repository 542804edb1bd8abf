"""Tries words of turns from the start to a node of a goal tree, and drives the first that is free."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from planners.search.connection.candidates import (
    list_connections,
    list_words_between,
    next_word,
    word_seconds,
)
from planners.search.connection.connection import Connection, first_pose, radius_at
from planners.search.connection.outline import outline_is_free
from planners.search.connection.words import PARTS
from planners.search.manoeuvres.arcs import stride_along, stride_in, stride_of
from planners.search.manoeuvres.arriving import drive_arcs_to_goal, drive_to_goal
from planners.search.manoeuvres.driving import Drive
from planners.search.manoeuvres.joining import arcs_are_free, close, take_word, trailers_are_off
from planners.search.manoeuvres.pose_tree import CHECKS, LAST, PoseTree
from planners.search.manoeuvres.ways import word_is_worth
from planners.search.query import Endings
from planners.search.structures.cost_to_go import CostToGo
from planners.world.arrays import Floats
from planners.world.driving_cost import gear_of
from planners.world.geometry.collision import Scene
from planners.world.jit import inlined, lean
from planners.world.vehicles.dynamics import load, tightest_bend, turning_speed
from planners.world.vehicles.vehicle import Vehicle

OUTLINES: Final = 12  # words of a shot that are glanced at
CLOSED: Final = 2  # and corrected, where there are trailers
MOST_OFF: Final = 0.3  # radians: hitches that are farther off than this are not corrected


class OtherEnd(NamedTuple):
    """What a tree knows of the end that it grows towards: the start, or for one out of the start the goal."""

    root: Floats  # [1, S] the state there, out of which the other tree grows
    go: CostToGo  # the way there around obstacles
    table: Floats  # that of ``seconds_to_pose``
    endings: Endings  # of known plans
    radius: float  # of words, in metres, with which trailers keep straight enough
    origin: Floats  # [2] metres, from which places are counted
    from_goal: bool  # whether the tree grows out of the goal, so towards the start


@lean
def word_is_free(
    c: Connection, number: int, top: float, vehicle: Vehicle, scene: Scene, tree: PoseTree
) -> bool:
    """Whether the way of a word from ``c.states[0]`` is free."""
    word = c.words[number]
    state = load(c.states, 0, vehicle)
    radius = radius_at(top, vehicle)
    x, y, heading = first_pose(state, top, vehicle)
    if not outline_is_free(word, radius, x, y, heading, vehicle, scene):
        return False
    state = (x, y, heading) + state[3:]  # noqa: RUF005 Numba fails where the variable changes later
    bend_limit = tightest_bend(top, vehicle)
    for k in range(PARTS):
        metres = radius * abs(word[PARTS + k])
        if metres == 0.0:
            continue
        gear = gear_of(word[PARTS + k])
        count = math.ceil(metres / stride_of(gear, vehicle))
        stride = stride_in(state, gear, word[k] * bend_limit, metres / count, vehicle)
        for _ in range(count):
            state, free, checks = stride_along(state, stride, vehicle, scene)
            tree.counts[CHECKS] += checks
            if free < stride.metres:
                return False
    return True


@inlined
def _shoot_alone(
    before: PoseTree,
    last: int,
    tree: PoseTree,
    node: int,
    known: OtherEnd,
    goal: Floats,
    drive: Drive,
    vehicle: Vehicle,
    scene: Scene,
) -> bool:
    """Try words from node ``last`` of the tree out of the start to a node of the tree out of the goal."""
    c = drive.connection
    for k in range(c.states.shape[1]):
        c.states[0, k] = before.states[last, k]
    target = drive.target
    target[0] = tree.states[node, 0]
    target[1] = tree.states[node, 1]
    target[3] = tree.states[node, 2]
    top = turning_speed(vehicle)
    radius = radius_at(top, vehicle)
    count = list_connections(c, before.metres[last], target, top, vehicle)
    for _ in range(OUTLINES):
        word = next_word(c, count, math.inf)
        if word < 0:
            return False
        if not word_is_worth(drive.ways, before, last, c.words[word], radius, tree, node, vehicle):
            continue
        if word_is_free(c, word, top, vehicle, scene, tree):
            arrives = drive_to_goal(
                drive, before, last, tree, node, word, known.endings, goal, vehicle, scene
            )
            tree.counts[CHECKS] += drive.counts[1]
            return bool(arrives)
    return False


@lean
def shoot_with_trailers(
    before: PoseTree,
    tree: PoseTree,
    node: int,
    known: OtherEnd,
    goal: Floats,
    drive: Drive,
    vehicle: Vehicle,
    scene: Scene,
) -> bool:
    """Try words from the start to a node, corrected so that the trailers stand as they do there."""
    c = drive.connection
    x, y, heading = known.root[0, 0], known.root[0, 1], known.root[0, 2]
    there = (tree.states[node, 0], tree.states[node, 1], tree.states[node, 2])
    if known.root[0, 3] != 0.0 and not vehicle.first_order:
        return False
    radius = known.radius
    count = list_words_between((x, y, heading), there, radius, c.words, vehicle)
    for i in range(count):
        c.seconds[i] = word_seconds(
            c.words[i], radius, 0.0, 0.0, 0.0, drive.target, turning_speed(vehicle), vehicle
        )
    for k in range(tree.states.shape[1]):
        drive.join.ends[1, k] = tree.states[node, k]
    closed = 0
    for _ in range(OUTLINES):
        word = next_word(c, count, math.inf)
        if word < 0 or closed == CLOSED:
            return False
        if not word_is_worth(drive.ways, before, 0, c.words[word], radius, tree, node, vehicle):
            continue
        if not outline_is_free(c.words[word], radius, x, y, heading, vehicle, scene):
            continue
        take_word(drive.join, c.words[word], radius, vehicle)
        if trailers_are_off(known.root, drive.join, MOST_OFF, vehicle):
            continue
        closed += 1
        if not close(known.root, drive.join, vehicle):
            continue
        free, checks = arcs_are_free(known.root, drive.join, vehicle, scene)
        tree.counts[CHECKS] += checks
        if free and drive_arcs_to_goal(drive, before, 0, tree, node, known.endings, goal, vehicle, scene):
            return True
    return False


@lean
def shoot_between(
    tree: PoseTree,
    node: int,
    other: PoseTree,
    known: OtherEnd,
    goal: Floats,
    drive: Drive,
    vehicle: Vehicle,
    scene: Scene,
) -> bool:
    """Shoot between a node of one tree and the other tree: its root, and the node that it opened last."""
    before, after = (other, tree) if known.from_goal else (tree, other)
    for opened in (0, other.counts[LAST]):
        last, first = (opened, node) if known.from_goal else (node, opened)
        if _shoot_alone(before, last, after, first, known, goal, drive, vehicle, scene):
            return True
        if other.counts[LAST] == 0:
            break
    return False
