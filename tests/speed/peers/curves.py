"""What others find, arcs and Reeds-Shepp curves: driven from rest to rest, and polished as our plans are."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from planners.optimisation.polish import polish
from planners.search.connection.connection import radius_at
from planners.search.connection.words import MOST_WORDS, PARTS, list_words
from planners.search.manoeuvres.arcs import stride_along, stride_in, stride_of
from planners.search.manoeuvres.driving import SMALLEST, Drive, allocate_drive, begin, drive_arc
from planners.world.arrays import Floats, Pose
from planners.world.geometry.collision import Scene
from planners.world.goal import goal_of, reaches
from planners.world.jit import lean
from planners.world.problem import Plan, Problem, start_state
from planners.world.trigonometry import sincos, wrapped
from planners.world.vehicles.dynamics import State, load, tightest_bend, turning_speed
from planners.world.vehicles.vehicle import Car, Vehicle, state_size
from planners.world.workspace import Workspace

ARCS: Final = 1 << 10


class Curves(NamedTuple):
    """Buffers."""

    words: Floats  # [MOST_WORDS, 2 PARTS]
    arcs: Floats  # [3, ARCS] gear, bend, metres
    drive: Drive


def allocate_curves(state_size: int) -> Curves:
    """Buffers for states of ``state_size`` numbers."""
    return Curves(np.zeros((MOST_WORDS, 2 * PARTS)), np.zeros((3, ARCS)), allocate_drive(state_size))


@lean
def add_curve(
    curves: Curves, state: State, count: int, goal: Pose, vehicle: Vehicle, scene: Scene
) -> tuple[int, State]:
    """Add the shortest curve from a state to a pose behind ``count`` arcs.

    Returns how many arcs there are then, -1 if the curve is blocked, and where it ends.
    """
    radius = radius_at(turning_speed(vehicle), vehicle)
    sin, cos = sincos(state[2])
    dx = (goal[0] - state[0]) / radius
    dy = (goal[1] - state[1]) / radius
    turn = wrapped(goal[2] - state[2])
    words = list_words(dx * cos + dy * sin, dy * cos - dx * sin, turn, curves.words)
    best = -1
    shortest = math.inf
    for i in range(words):
        metres = 0.0
        for k in range(PARTS):
            metres += abs(curves.words[i, PARTS + k])
        if metres < shortest:
            best, shortest = i, metres
    if best < 0 or count + PARTS > ARCS:
        return -1, state
    limit = tightest_bend(turning_speed(vehicle), vehicle)
    for k in range(PARTS):
        metres = radius * abs(curves.words[best, PARTS + k])
        if metres <= SMALLEST:
            continue
        gear = 1.0 if curves.words[best, PARTS + k] > 0.0 else -1.0
        bend = limit * curves.words[best, k]
        strides = math.ceil(metres / stride_of(gear, vehicle))
        stride = stride_in(state, gear, bend, metres / strides, vehicle)
        for _ in range(strides):
            state, free, _ = stride_along(state, stride, vehicle, scene)
            if free < stride.metres:
                return -1, state
        curves.arcs[0, count] = gear
        curves.arcs[1, count] = bend
        curves.arcs[2, count] = metres
        count += 1
    return count, state


@lean
def drive_arcs(
    curves: Curves, start: Floats, count: int, goal: Floats, vehicle: Vehicle, scene: Scene
) -> bool:
    """Drive the first ``count`` arcs; whether that leads to the goal, and nothing is in the way."""
    begin(curves.drive, start)
    for k in range(count):
        gear, bend, metres = curves.arcs[0, k], curves.arcs[1, k], curves.arcs[2, k]
        if not drive_arc(curves.drive, gear, bend, metres, vehicle, scene):
            return False
    return bool(reaches(load(curves.drive.states, curves.drive.counts[0], vehicle), goal))


def driven(curves: Curves, problem: Problem, vehicle: Car, scene: Scene, workspace: Workspace) -> Plan:
    """The drive that the buffers hold, polished as our plans are."""
    steps = int(curves.drive.counts[0])
    states, controls = curves.drive.states[: steps + 1].copy(), curves.drive.controls[:steps].copy()
    plan = Plan(states, controls, vehicle.dt)
    return polish(problem, plan, vehicle, scene, workspace).plan or plan


def driven_over(
    poses: Sequence[Pose], problem: Problem, vehicle: Car, scene: Scene, workspace: Workspace
) -> Plan | None:
    """Drive the shortest curves from pose to pose, beginning at the start; None if they are blocked."""
    curves = workspace.buffers(allocate_curves, state_size(vehicle))
    start = start_state(problem, vehicle)
    state, count = tuple(start.tolist()), 0
    for pose in poses[1:]:
        count, state = add_curve(curves, state, count, pose, vehicle, scene)
        if count < 0:
            return None
    if not drive_arcs(curves, start[np.newaxis], count, goal_of(problem, vehicle), vehicle, scene):
        return None
    return driven(curves, problem, vehicle, scene, workspace)
