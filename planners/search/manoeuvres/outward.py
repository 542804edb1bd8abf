"""Grows a goal tree from the goal outwards, until a word of turns leads from the start to one of its nodes.

Where it is tight around the goal, few ways lead out, and most of what goes on leads away. From outside many
ways seem to lead in, and nearly all of them end at an obstacle.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from planners.search.connection.pose_table import seconds_from
from planners.search.manoeuvres.arcs import FINE_LOOKS, STRIDE, at_pace, stride_along, stride_in, stride_of
from planners.search.manoeuvres.driving import Drive
from planners.search.manoeuvres.endings import add_endings
from planners.search.manoeuvres.meeting import meet
from planners.search.manoeuvres.near_meetings import note_near
from planners.search.manoeuvres.pose_tree import (
    CHECKS,
    LAST,
    SIZE,
    PoseTree,
    add_node,
    cell_of,
    mark_place,
    node_near,
    region_of,
    seconds_after,
)
from planners.search.manoeuvres.shots import OtherEnd, shoot_between, shoot_with_trailers
from planners.search.manoeuvres.ways import dearest_kept
from planners.search.structures.cost_to_go import metres_to_go
from planners.search.structures.frontier import is_empty, pop, push, reach, was_reached
from planners.world.arrays import Floats, Integers, Pose
from planners.world.geometry.collision import Scene, state_is_free
from planners.world.jit import inlined, lean
from planners.world.trigonometry import sincos
from planners.world.vehicles.dynamics import State, load, tightest_bend, turning_speed
from planners.world.vehicles.vehicle import FIRST_HITCH, CarWithTrailers, Vehicle

KNOWN: Final = 0.2  # share of its time that a known ending counts, so that it is tried first
FEW: Final = 4  # nodes that were opened in a region beyond those that an estimate counts
GEARS: Final = (1.0, -1.0)
EXPANSIONS_A_TURN: Final = 64  # of both trees together
NO_BEND: Final = math.nan


class Outward(NamedTuple):
    """How a tree grows. Lengths are in those of the first body."""

    # Shares of the tightest bend; as many for all vehicles, which then run the same compiled code.
    bends: tuple[float, float, float, float, float] = (1.0, NO_BEND, 0.0, NO_BEND, -1.0)
    stride: float = 1.0  # share of ``stride_of`` from one look to the next
    marks: tuple[float, ...] = (3.0, 8.0, 15.0, 30.0, 50.0, 80.0)  # times ``STRIDE``: where arcs may end
    cell: float = 0.05  # side of a cell
    headings: int = 96  # cells of headings, ``MOST_HEADINGS`` at most
    greed: float = 1.5  # weight of the time that is left to the other end
    crowding: float = 0.0  # seconds by which a node counts as farther for each opened in its region
    worst: bool = False  # with trailers that of the first or last body, whichever is longer, not the mean


@lean
def room_around(states: Floats, outgoing: Vehicle, vehicle: Vehicle, scene: Scene) -> float:
    """The share that is free of the tightest arcs and straight ways from ``states[0]``, a length each."""
    bend_limit = tightest_bend(turning_speed(vehicle), vehicle)
    free = 0.0
    whole = 0.0
    for gear in GEARS:
        stride_m = stride_of(gear, outgoing)
        if stride_m <= 0.0:
            continue
        for share in (1.0, 0.0, -1.0):
            state = load(states, 0, vehicle)
            stride = stride_in(state, gear, share * bend_limit, stride_m, outgoing)
            metres = 0.0
            more = stride_m
            while metres < vehicle.front + vehicle.rear and more == stride_m:
                state, more, _ = stride_along(state, stride, outgoing, scene)
                metres += more
            free += metres
            whole += vehicle.front + vehicle.rear
    return free / whole


@inlined
def _last_body(state: State, vehicle: CarWithTrailers) -> Pose:
    """The pose of the last trailer."""
    x, y, heading = state[0], state[1], state[2]
    for k in range(len(vehicle.trailers)):
        heading -= state[FIRST_HITCH + k]
        sin, cos = sincos(heading)
        x -= vehicle.trailers[k].hitch_length * cos
        y -= vehicle.trailers[k].hitch_length * sin
    return x, y, heading


@inlined
def _seconds_of_body(root: Pose, pose: Pose, known: OtherEnd, vehicle: Vehicle) -> float:
    """The time between a pose of a body and its ``root`` at the other end, if nothing is in the way."""
    if not known.from_goal:
        root, pose = pose, root
    return float(seconds_from(root[0], root[1], root[2], pose, known.table, vehicle.max_speed))


@inlined
def _least_seconds_left(state: State, known: OtherEnd, vehicle: Vehicle) -> float:
    """The time between a state and the other end, if nothing is in the way."""
    root = known.root[0, 0], known.root[0, 1], known.root[0, 2]
    return _seconds_of_body(root, (state[0], state[1], state[2]), known, vehicle)


@inlined
def _seconds_left(state: State, known: OtherEnd, settings: Outward, vehicle: Vehicle) -> float:
    """The same, with the last trailer and with what is in the way of a point."""
    turns = _least_seconds_left(state, known, vehicle)
    if len(state) > FIRST_HITCH:  # decided when compiling
        root = load(known.root, 0, vehicle)
        there, here = _last_body(root, vehicle), _last_body(state, vehicle)  # type: ignore[arg-type]  # the state of a car is shorter
        last = _seconds_of_body(there, here, known, vehicle)
        turns = max(turns, last) if settings.worst else 0.5 * (turns + last)
    return max(turns, metres_to_go(state[0], state[1], known.go) / vehicle.max_speed)


@inlined
def _let_wait(
    tree: PoseTree,
    node: int,
    state: State,
    estimate: float,
    longest: int,
    settings: Outward,
    vehicle: Vehicle,
) -> None:
    """Let a node wait, the longer the more nodes of its region were opened that ``estimate`` does not count.

    Else a search that leads nowhere goes on among thousands of states that hardly differ.
    """
    opened = tree.opened[region_of(state, tree, vehicle)]
    more = settings.crowding * settings.greed * (opened - tree.crowds[node])
    tree.crowds[node] = opened
    push(tree.frontier, estimate + more, node, longest)


@lean
def begin_outward(
    tree: PoseTree, known: OtherEnd, nodes: Integers, settings: Outward, vehicle: Vehicle, scene: Scene
) -> None:
    """Let the stops of known endings wait that are free; ``nodes [K]`` is filled in with their numbers."""
    add_endings(tree, known.endings, nodes, vehicle, scene)
    mark_place(tree, 0, known.origin, vehicle)
    for k in range(nodes.shape[0]):
        if nodes[k] >= 0:
            mark_place(tree, nodes[k], known.origin, vehicle)
            state = load(tree.states, nodes[k], vehicle)
            left = _seconds_left(state, known, settings, vehicle)
            estimate = KNOWN * tree.seconds[nodes[k]] + settings.greed * left
            _let_wait(tree, nodes[k], state, estimate, 1, settings, vehicle)


@lean
def open_node(
    tree: PoseTree,
    other: PoseTree,
    node: int,
    further: bool,
    known: OtherEnd,
    settings: Outward,
    outgoing: Vehicle,
    vehicle: Vehicle,
    scene: Scene,
) -> None:
    """Let the ends of all arcs out of a node wait; ``further``: also of its own arc, driven on.

    ``outgoing`` is the vehicle as it drives out of the root: out of a goal its speeds have other signs.
    """
    bend_limit = tightest_bend(turning_speed(vehicle), vehicle)
    size = vehicle.front + vehicle.rear
    for gear in GEARS:
        stride_m = settings.stride * stride_of(gear, outgoing)
        if stride_m <= 0.0:
            continue
        for share in settings.bends:
            if math.isnan(share):
                continue
            bend = share * bend_limit
            if node > 0 and bend == tree.bends[node] and (gear * tree.metres[node] < 0.0 or not further):
                continue  # back where it came from, or on where its parent has been
            state = load(tree.states, node, vehicle)
            tree.counts[CHECKS] += 1
            if not state_is_free(at_pace(state, 0.0, bend, vehicle), vehicle, scene):
                continue  # where the wheels cannot be turned
            stride = stride_in(state, gear, bend, stride_m, outgoing)
            metres = 0.0
            before = 0.0
            mark = 0
            while mark < len(settings.marks):
                state, free, checks = stride_along(state, stride, outgoing, scene)
                tree.counts[CHECKS] += checks
                metres += free
                ended = free < stride_m
                if ended or metres >= settings.marks[mark] * STRIDE * size - 1e-9:
                    mark += 1
                    if metres - before >= 2.0 * stride_m / FINE_LOOKS and not (
                        ended and vehicle.min_speed > 0.0
                    ):
                        longest = mark == len(settings.marks) and not ended
                        way = gear * metres
                        _wait(
                            tree, other, node, state, bend, way, longest, known, settings, outgoing, vehicle
                        )
                    before = metres
                if ended:
                    break


@inlined
def _wait(
    tree: PoseTree,
    other: PoseTree,
    node: int,
    state: State,
    bend: float,
    metres: float,
    longest: bool,
    known: OtherEnd,
    settings: Outward,
    outgoing: Vehicle,
    vehicle: Vehicle,
) -> None:
    cell = settings.cell * (vehicle.front + vehicle.rear)
    if tree.counts[SIZE] == tree.parents.shape[0] or was_reached(
        tree.frontier, cell_of(state, metres, tree, cell, settings.headings, vehicle)
    ):
        return
    seconds, extra = seconds_after(tree, node, bend, metres, outgoing, vehicle)
    left = _seconds_left(state, known, settings, vehicle)
    estimate = seconds + settings.greed * left
    new = add_node(tree, node, state, bend, metres, seconds, extra)
    if len(state) > FIRST_HITCH:  # decided when compiling
        mark_place(tree, new, known.origin, vehicle)
        near = node_near(other, state, known.origin, vehicle)
        if near >= 0:
            estimate = min(estimate, seconds + other.seconds[near])
    _let_wait(tree, new, state, estimate, 1 if longest else 0, settings, vehicle)


@lean
def grow_outward(
    tree: PoseTree,
    other: PoseTree,
    most: int,
    known: OtherEnd,
    goal: Floats,
    drive: Drive,
    settings: Outward,
    outgoing: Vehicle,
    vehicle: Vehicle,
    scene: Scene,
) -> tuple[bool, int]:
    """Open the node with the least estimate until solved, nothing is left, or ``most`` expansions.

    With trailers the tree may meet an ``other`` one, which grows from the other end.

    Returns whether ``drive`` leads to the goal now, and how many expansions there were.
    """
    expansions = 0
    cell = settings.cell * (vehicle.front + vehicle.rear)
    while expansions < most and not is_empty(tree.frontier):
        estimate = tree.frontier.estimates[0]
        node, longest = pop(tree.frontier)
        state = load(tree.states, node, vehicle)
        region = region_of(state, tree, vehicle)
        if settings.crowding > 0.0 and tree.opened[region] - tree.crowds[node] >= FEW:
            _let_wait(tree, node, state, estimate, longest, settings, vehicle)
            continue
        key = cell_of(state, tree.metres[node], tree, cell, settings.headings, vehicle)
        if was_reached(tree.frontier, key):
            continue
        least = tree.seconds[node] + tree.extras[node] + _least_seconds_left(state, known, vehicle)
        if least >= dearest_kept(drive.ways):
            continue  # no way over it is worth driving
        reach(tree.frontier, key)
        expansions += 1
        tree.counts[LAST] = node
        tree.opened[region] += 1
        if len(state) > FIRST_HITCH:  # decided when compiling
            near = node_near(other, state, known.origin, vehicle)
            if near >= 0:
                last, first = (near, node) if known.from_goal else (node, near)
                before, after = (other, tree) if known.from_goal else (tree, other)
                if meet(before, last, after, first, known.endings, goal, drive, vehicle, scene):
                    return True, expansions
                note_near(drive.near, before, last, after, first, vehicle)
            if known.from_goal and shoot_with_trailers(other, tree, node, known, goal, drive, vehicle, scene):
                return True, expansions
        elif shoot_between(tree, node, other, known, goal, drive, vehicle, scene):
            return True, expansions
        open_node(tree, other, node, longest == 1, known, settings, outgoing, vehicle, scene)
    return False, expansions


@lean
def grow_trees(
    tree: PoseTree,
    other: PoseTree,
    most: int,
    both: bool,
    needs_both: bool,
    known: OtherEnd,
    known_there: OtherEnd,
    goal: Floats,
    drive: Drive,
    settings: Outward,
    outgoing: Vehicle,
    leaving: Vehicle,
    vehicle: Vehicle,
    scene: Scene,
) -> tuple[bool, int, bool]:
    """Grow a tree; if ``both`` grow, the ``other`` one out of the other end as well, first in each turn.

    It is one call, because to hand all of this over from Python takes as long as some expansions.

    Args:
        tree: out of the goal, or out of the start; ``known`` and ``outgoing`` are for it.
        other: out of the other end; ``known_there`` and ``leaving`` are for it.
        most: expansions of both.
        both: whether both grow.
        needs_both: whether to end where the other cannot grow.
        known: what the tree knows of the other end.
        known_there: what the other tree knows of the end of this one.
        goal: that of ``goal_of``.
        drive: buffers.
        settings: how they grow.
        outgoing: the vehicle as it drives out of the root of the tree.
        leaving: the vehicle as it drives out of the root of the other one.
        vehicle: the vehicle itself.
        scene: what must not be met.

    Returns:
        Whether ``drive`` leads to the goal now, how many expansions there were, and whether it ended because
        the other tree could not grow.
    """
    found = ended = False
    used = 0
    while used < most and not found and not ended:
        share = min(EXPANSIONS_A_TURN, most - used)
        began = used
        if both:
            found, used_there = grow_outward(
                other, tree, share // 2, known_there, goal, drive, settings, leaving, vehicle, scene
            )
            used += used_there
            ended = needs_both and used_there < share // 2
        if not found:
            found, used_here = grow_outward(
                tree, other, began + share - used, known, goal, drive, settings, outgoing, vehicle, scene
            )
            used += used_here
        if used == began:
            break
    return found, used, ended
