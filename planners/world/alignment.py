"""Moves problems into the canonical frame by a rotation and a translation, and plans back out of it."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from planners.world.arrays import Bounds, Floats, Point
from planners.world.jit import inlined, jit, lean
from planners.world.problem import (
    CANONICAL_START,
    Arrival,
    Obstacles,
    Plan,
    Problem,
    obstacles_of,
)

SAME_ANGLE = 1e-9  # radians: a smaller turn moves nothing by as much as the last digit of a float32
SLIVER = 1e-4  # metres: thinner triangles are left out, since float32 would turn them inside out


class Alignment(NamedTuple):
    """The motion from a problem's own frame to the canonical one: turn about ``origin``, move it to 0."""

    origin: Point  # metres, own frame: the canonical start
    turn: float  # radians


def to_canonical(problem: Problem) -> tuple[Problem, Alignment]:
    """Move a problem so that its start is at (0, 0) and its goal on the diagonal, at any distance.

    If the turned bounds lie askew, the new bounds are the box around them, and the rest of the box becomes
    obstacles. Obstacles are rounded to float32, as everywhere.

    Args:
        problem: in any frame.

    Returns:
        The problem in the canonical frame, and the motion that brought it there.
    """
    (x, y, heading), goal = problem.start, problem.goal
    turn = math.atan2(goal[1] - y, goal[0] - x) - CANONICAL_START[2]
    turn = (turn + math.pi) % (2.0 * math.pi) - math.pi
    alignment = Alignment((x, y), 0.0 if abs(turn) < SAME_ANGLE else -turn)
    if alignment == Alignment((0.0, 0.0), 0.0):
        return problem, alignment
    cos, sin = math.cos(alignment.turn), math.sin(alignment.turn)
    obstacles, bounds = _moved(problem.obstacles, problem.bounds, alignment.origin, cos, sin)
    goal_x, goal_y = goal[0] - x, goal[1] - y
    moved = replace(
        problem,
        start=(0.0, 0.0, heading + alignment.turn),
        goal=(cos * goal_x - sin * goal_y, sin * goal_x + cos * goal_y),
        bounds=bounds,
        obstacles=obstacles,
        arrival=_turned_arrival(problem.arrival, alignment.turn),
        offset=(0.0, 0.0),
    )
    return moved, alignment


def _turned_arrival(arrival: Arrival | None, turn: float) -> Arrival | None:
    if arrival is None or arrival.heading is None:
        return arrival
    return arrival._replace(heading=arrival.heading + turn)


@jit
def _moved(
    obstacles: Obstacles, bounds: Bounds, origin: Point, cos: float, sin: float
) -> tuple[Obstacles, Bounds]:
    """Move ``origin`` to 0, turn about it, and round to float32: obstacles, and the box around the bounds.

    Triangles behind the obstacles cover what the box has more than the turned bounds.
    """
    count = obstacles.vertices.shape[0]
    pieces = obstacles.piece_starts.shape[0] - 1
    groups = obstacles.obstacle_starts.shape[0] - 1
    vertices = np.empty((count + 12, 2))
    piece_starts = np.empty(pieces + 5, np.int32)
    obstacle_starts = np.empty(groups + 5, np.int32)
    for i in range(count):
        x, y = _turned(obstacles.vertices[i, 0] - origin[0], obstacles.vertices[i, 1] - origin[1], cos, sin)
        vertices[i, 0] = np.float64(np.float32(x))
        vertices[i, 1] = np.float64(np.float32(y))
    for p in range(pieces + 1):
        piece_starts[p] = obstacles.piece_starts[p]
    for o in range(groups + 1):
        obstacle_starts[o] = obstacles.obstacle_starts[o]
    corners = np.empty((5, 2))
    for k in range(5):
        x, y = _turned(
            bounds[2 if k in (1, 2) else 0] - origin[0], bounds[3 if k in (2, 3) else 1] - origin[1], cos, sin
        )
        corners[k, 0] = x
        corners[k, 1] = y
    low_x, low_y = corners[:, 0].min(), corners[:, 1].min()
    high_x, high_y = corners[:, 0].max(), corners[:, 1].max()
    added = 0
    for k in range(4):
        along_x = corners[k + 1, 0] - corners[k, 0]
        along_y = corners[k + 1, 1] - corners[k, 1]
        if min(abs(along_x), abs(along_y)) > SLIVER:
            triangle = vertices[count + 3 * added : count + 3 * added + 3]
            triangle[0, 0] = corners[k, 0]
            triangle[0, 1] = corners[k, 1]
            triangle[1, 0] = high_x if along_y > 0.0 else low_x
            triangle[1, 1] = high_y if along_x < 0.0 else low_y
            triangle[2, 0] = corners[k + 1, 0]
            triangle[2, 1] = corners[k + 1, 1]
            added += 1
            piece_starts[pieces + added] = count + 3 * added
            obstacle_starts[groups + added] = pieces + added
    for i in range(count, count + 3 * added):
        vertices[i, 0] = np.float64(np.float32(vertices[i, 0]))
        vertices[i, 1] = np.float64(np.float32(vertices[i, 1]))
    turned = Obstacles(
        vertices[: count + 3 * added],
        piece_starts[: pieces + added + 1],
        obstacle_starts[: groups + added + 1],
    )
    return turned, (low_x, low_y, high_x, high_y)


@inlined
def _turned(x: float, y: float, cos: float, sin: float) -> Point:
    return cos * x - sin * y, sin * x + cos * y


def mirrored(problem: Problem) -> Problem:
    """Mirror a canonical problem in its diagonal, which makes another one that is as hard."""
    (x, y, heading), goal = problem.start, problem.goal
    x_min, y_min, x_max, y_max = problem.bounds
    arrival = problem.arrival
    if arrival is not None:
        arrival = arrival._replace(
            heading=None if arrival.heading is None else 0.5 * math.pi - arrival.heading,
            hitches=tuple(-hitch for hitch in arrival.hitches),
        )
    return replace(
        problem,
        start=(y, x, 0.5 * math.pi - heading),
        start_motion=problem.start_motion[:1] + tuple(-each for each in problem.start_motion[1:]),
        arrival=arrival,
        goal=(goal[1], goal[0]),
        bounds=(y_min, x_min, y_max, x_max),
        obstacles=obstacles_of([[piece[:, ::-1] for piece in group] for group in _groups(problem)]),
    )


def from_canonical(plan: Plan, alignment: Alignment) -> Plan:
    """Move a plan back into the frame of its problem. Controls are the same in every frame."""
    cos, sin = math.cos(alignment.turn), math.sin(alignment.turn)
    states = plan.states.copy()
    _move_back(states, alignment.origin, alignment.turn, cos, sin)
    return Plan(states, plan.controls, plan.dt)


def in_canonical(plan: Plan, alignment: Alignment) -> Plan:
    """Move a plan from the frame of its problem into the canonical one, as ``to_canonical`` moved that."""
    cos, sin = math.cos(alignment.turn), math.sin(alignment.turn)
    x, y = alignment.origin
    moved = sin * y - cos * x, -sin * x - cos * y  # where the other frame's origin lies
    return from_canonical(plan, Alignment(moved, -alignment.turn))


@lean
def _move_back(states: Floats, origin: Point, turn: float, cos: float, sin: float) -> None:
    for i in range(states.shape[0]):
        x, y = _turned(states[i, 0], states[i, 1], cos, -sin)
        states[i, 0] = origin[0] + x
        states[i, 1] = origin[1] + y
        states[i, 2] -= turn


def scaled(plan: Plan, scale: float) -> Plan:
    """Multiply a plan's lengths by ``scale``: a vehicle that is as much larger drives it in the same time."""
    if scale == 1.0:
        return plan
    states, controls = plan.states.copy(), plan.controls.copy()
    states[:, [0, 1, 3]] *= scale  # x, y and speed of every vehicle; the others are angles
    controls[:, 0] *= scale  # acceleration
    return Plan(states, controls, plan.dt)


def shifted(plan: Plan, offset: Point) -> Plan:
    """Add ``offset``, x and y in metres, to where a plan leads."""
    if offset == (0.0, 0.0):
        return plan
    states = plan.states.copy()
    states[:, :2] += offset
    return Plan(states, plan.controls, plan.dt)


def to_file_frame(plan: Plan, problem: Problem) -> Plan:
    """Move a plan from the frame of its problem into that of the problem's file, in real metres."""
    return shifted(scaled(plan, problem.scale), problem.offset)


def to_problem_frame(plan: Plan, problem: Problem) -> Plan:
    """Move a plan from the frame of a problem's file, in real metres, into that of the problem."""
    near = shifted(plan, (-problem.offset[0], -problem.offset[1]))
    return scaled(near, 1.0 / problem.scale)


def _groups(problem: Problem) -> list[list[Floats]]:
    """List the obstacles, each as convex pieces ``[n, 2]``."""
    pieces = problem.obstacles.pieces()
    starts = problem.obstacles.obstacle_starts
    return [pieces[first:last] for first, last in pairwise(starts)]
