"""Ends of plans that are known: ways into a goal pose from the places before it where the vehicle stood."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np

from planners.search.manoeuvres.pose_tree import CHECKS, NODES, SIZE, PoseTree, add_known_node
from planners.search.query import Endings
from planners.world.arrays import Floats, Indices, Integers
from planners.world.driving_cost import STANDING, extra_cost
from planners.world.geometry.collision import Scene, state_is_free
from planners.world.jit import inlined, lean
from planners.world.problem import Plan
from planners.world.trigonometry import sincos
from planners.world.vehicles.dynamics import State, load
from planners.world.vehicles.vehicle import Vehicle, length_of_trailers, state_size

FARTHEST: Final = 4.0  # from the goal, in the length of vehicle and trailers: where an ending begins


def endings_of(plans: Iterable[tuple[Floats, Floats]], vehicle: Vehicle) -> Endings:
    """Take the parts between stops from the ends of plans.

    Each is given as its ``states [T, S]`` and ``controls [T - 1, 2]``. Without a stop at the end: left out.
    """
    size = vehicle.front + vehicle.rear + length_of_trailers(vehicle)
    states, controls, starts, follows = [], [], [0], []
    for drive, steering in plans:
        stands = np.abs(drive[:, 3]) < STANDING
        if not stands[-1]:
            continue
        local = in_frame_of_end(drive)
        begins = last_of_stops(drive)
        after = -1
        end = len(drive) - 1
        for begin in begins[::-1]:
            if np.hypot(*local[begin, :2]) > FARTHEST * size:
                break
            states.append(local[begin : end + 1])
            controls.append(np.vstack((steering[begin:end], np.zeros((1, 2)))))
            starts.append(starts[-1] + end + 1 - begin)
            follows.append(after)
            after = len(follows) - 1
            end = begin
    if not states:
        return no_endings(state_size(vehicle))
    return Endings(
        np.vstack(states), np.vstack(controls), np.array(starts, np.int32), np.array(follows, np.int32)
    )


def last_of_stops(drive: Floats) -> Indices:
    """The numbers of those states ``[T, S]`` of a drive that are the last of a stop."""
    stands = np.abs(drive[:, 3]) < STANDING
    return np.flatnonzero(stands[:-1] & ~stands[1:])


def worth_storing(found: Plan, polished: Plan | None, vehicle: Vehicle) -> list[Plan]:
    """The polished plan, and beside it the one that was found first if it has stops, which polish melts away.

    At these stops others can join it.
    """
    if polished is None:
        return [found]
    stops = endings_of([(found.states, found.controls)], vehicle).follows  # of which the start is one
    return [polished, found] if len(stops) > 1 else [polished]


def no_endings(size: int) -> Endings:
    """Nothing is known of states of ``size`` numbers."""
    return Endings(np.empty((0, size)), np.empty((0, 2)), np.zeros(1, np.int32), np.empty(0, np.int32))


def in_frame_of_end(drive: Floats) -> Floats:
    """The states ``[T, S]`` of a drive in the frame of its last pose."""
    x, y, heading = drive[-1, :3]
    cos, sin = np.cos(heading), np.sin(heading)
    local = drive.copy()
    dx, dy = drive[:, 0] - x, drive[:, 1] - y
    local[:, 0] = cos * dx + sin * dy
    local[:, 1] = cos * dy - sin * dx
    local[:, 2] -= heading
    return np.ascontiguousarray(local)


@inlined
def _placed(endings: Endings, i: int, tree: PoseTree, vehicle: Vehicle) -> State:
    """A state of an ending at the root of a tree."""
    state = load(endings.states, i, vehicle)
    sin, cos = sincos(tree.states[0, 2])
    x = tree.states[0, 0] + cos * state[0] - sin * state[1]
    y = tree.states[0, 1] + sin * state[0] + cos * state[1]
    return (x, y, state[2] + tree.states[0, 2], *state[3:])


@lean
def add_endings(tree: PoseTree, endings: Endings, nodes: Integers, vehicle: Vehicle, scene: Scene) -> None:
    """Add the stops from which what is known leads freely to the goal; ``nodes [K]``: numbers, or -1."""
    for k in range(endings.follows.shape[0]):
        nodes[k] = -1
        if tree.counts[SIZE] == NODES:
            continue
        parent = 0
        if endings.follows[k] >= 0:
            parent = nodes[endings.follows[k]]
            if parent < 0:
                continue
        first = endings.starts[k]
        free = True
        i = endings.starts[k + 1] - 1
        while free and i >= first:
            tree.counts[CHECKS] += 1
            free = state_is_free(_placed(endings, i, tree, vehicle), vehicle, scene)
            i -= 1
        if free:
            metres = 0.0
            for j in range(first, endings.starts[k + 1] - 1):
                metres -= 0.5 * vehicle.dt * (endings.states[j, 3] + endings.states[j + 1, 3])
            seconds = vehicle.dt * (endings.starts[k + 1] - 1 - first)
            extra = tree.extras[parent] + extra_cost(-tree.metres[parent], -metres, seconds, vehicle)
            seconds = tree.seconds[parent] + seconds
            bend = endings.states[first, 4]
            nodes[k] = add_known_node(
                tree, parent, _placed(endings, first, tree, vehicle), bend, metres, seconds, extra, k
            )
