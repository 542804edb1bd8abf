"""Moves problems into the canonical frame by a rotation and a translation, and plans back out of it."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from planners.world.arrays import Floats, Point
from planners.world.problem import (
    CANONICAL_DISTANCE,
    CANONICAL_START,
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
    """Move a problem so that its start is at (0, 0) and its goal on the diagonal.

    If the turned bounds lie askew, the new bounds are the box around them, and the rest of the box becomes
    obstacles. Obstacles are rounded to float32, as everywhere.

    Args:
        problem: in any frame.

    Returns:
        The problem in the canonical frame, and the motion that brought it there.

    Raises:
        ValueError: Start and goal are not 50 sqrt(2) m apart, within the goal radius.
    """
    (x, y, heading), goal = problem.start, problem.goal
    distance = math.dist((x, y), goal)
    if not abs(distance - CANONICAL_DISTANCE) <= problem.goal_radius:
        raise ValueError(
            f"Problem {problem.id}: start and goal are {distance:.2f} m apart, expected"
            f" {CANONICAL_DISTANCE:.2f} m within the goal radius {problem.goal_radius:g} m;"
            " cut longer ways into a chain of local goals."
        )
    turn = math.atan2(goal[1] - y, goal[0] - x) - CANONICAL_START[2]
    turn = (turn + math.pi) % (2.0 * math.pi) - math.pi
    alignment = Alignment((x, y), 0.0 if abs(turn) < SAME_ANGLE else -turn)
    if alignment == Alignment((0.0, 0.0), 0.0):
        return problem, alignment
    x_min, y_min, x_max, y_max = problem.bounds
    corners = _turned(np.array([[x_min, y_min], [x_max, y_min], [x_max, y_max], [x_min, y_max]]), alignment)
    low, high = corners.min(axis=0), corners.max(axis=0)
    cut_off = _cut_off(corners, low, high) if alignment.turn != 0.0 else []
    goal_x, goal_y = _turned(np.array([goal]), alignment)[0]
    return replace(
        problem,
        start=(0.0, 0.0, heading + alignment.turn),
        goal=(float(goal_x), float(goal_y)),
        bounds=(float(low[0]), float(low[1]), float(high[0]), float(high[1])),
        obstacles=_joined(_turned(problem.obstacles.vertices, alignment), problem.obstacles, cut_off),
    ), alignment


def mirrored(problem: Problem) -> Problem:
    """Mirror a canonical problem in its diagonal, which makes another one that is as hard."""
    (x, y, heading), goal = problem.start, problem.goal
    x_min, y_min, x_max, y_max = problem.bounds
    return replace(
        problem,
        start=(y, x, 0.5 * math.pi - heading),
        goal=(goal[1], goal[0]),
        bounds=(y_min, x_min, y_max, x_max),
        obstacles=obstacles_of([[piece[:, ::-1] for piece in group] for group in _groups(problem)]),
    )


def from_canonical(plan: Plan, alignment: Alignment) -> Plan:
    """Move a plan back into the frame of its problem. Controls are the same in every frame."""
    cos, sin = math.cos(-alignment.turn), math.sin(-alignment.turn)
    states = plan.states.copy()
    states[:, 0] = alignment.origin[0] + cos * plan.states[:, 0] - sin * plan.states[:, 1]
    states[:, 1] = alignment.origin[1] + sin * plan.states[:, 0] + cos * plan.states[:, 1]
    states[:, 2] -= alignment.turn
    return Plan(states, plan.controls, plan.dt)


def scaled(plan: Plan, scale: float) -> Plan:
    """Multiply a plan's lengths by ``scale``: a vehicle that is as much larger drives it in the same time."""
    if scale == 1.0:
        return plan
    states, controls = plan.states.copy(), plan.controls.copy()
    states[:, [0, 1, 3]] *= scale  # x, y and speed of every vehicle; the others are angles
    controls[:, 0] *= scale  # acceleration
    return Plan(states, controls, plan.dt)


def _turned(points: Floats, alignment: Alignment) -> Floats:
    """Turn points ``[n, 2]`` (metres) of the problem's own frame into the canonical frame."""
    cos, sin = math.cos(alignment.turn), math.sin(alignment.turn)
    turned: Floats = (points - alignment.origin) @ np.array([[cos, sin], [-sin, cos]])
    return turned


def _joined(vertices: Floats, obstacles: Obstacles, triangles: list[Floats]) -> Obstacles:
    """The same obstacles with other vertices ``[V, 2]``, and triangles ``[3, 2]`` behind them, in float32."""
    more = obstacles_of([[triangle] for triangle in triangles])
    _, piece_starts, obstacle_starts = obstacles
    return Obstacles(
        np.concatenate((vertices.astype(np.float32).astype(np.float64), more.vertices)),
        np.concatenate((piece_starts, piece_starts[-1] + more.piece_starts[1:])),
        np.concatenate((obstacle_starts, obstacle_starts[-1] + more.obstacle_starts[1:])),
    )


def _groups(problem: Problem) -> list[list[Floats]]:
    """List the obstacles, each as convex pieces ``[n, 2]``."""
    pieces = problem.obstacles.pieces()
    starts = problem.obstacles.obstacle_starts
    return [pieces[first:last] for first, last in pairwise(starts)]


def _cut_off(corners: Floats, low: Floats, high: Floats) -> list[Floats]:
    """Cover the box from ``low`` to ``high`` around the turned rectangle with triangles ``[3, 2]``."""
    triangles = []
    for begin, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        edge = end - begin
        outward = np.array([edge[1], -edge[0]])
        triangle = np.array([begin, np.where(outward > 0.0, high, low), end])
        if np.abs(edge).min() > SLIVER:
            triangles.append(triangle)
    return triangles
