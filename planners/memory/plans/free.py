"""Whether a stored plan fits a problem: it begins at the start, ends in the goal disc, and is free between.

A plan of another heading is first turned rigidly about its first position. From a scene any plan is checked;
from a drawing, which is made much sooner than a scene, a plan as it is stored. Both give the same answer.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from planners.memory.plans.sweeps import PlanSweeps
from planners.world.arrays import Bounds, Flags, Floats, Integers, Point, Pose
from planners.world.geometry.collision import (
    Scene,
    box_is_free,
    box_is_inside,
    box_meets_piece,
    make_edges,
    piece_extent,
)
from planners.world.geometry.occupancy import ALL_CELLS, Bits, Drawing
from planners.world.jit import inlined, jit, lean
from planners.world.problem import BOUNDS, Plan, Problem
from planners.world.vehicles.reach import REACH_M

START_TOLERANCE = 1e-9  # metres and radians: what turning a problem into the canonical frame rounds away
NO_PLANS: Final = np.empty(0, np.int32)


class Ends(NamedTuple):
    """Where plans for a problem begin and end."""

    start: Pose
    goal: Point
    goal_radius: float  # metres


def ends_of(problem: Problem) -> Ends:
    """Return the ends of a problem."""
    return Ends(problem.start, problem.goal, problem.goal_radius)


def turned(stored: Plan, heading: float) -> Plan:
    """Turn a plan rigidly about its first position, so that it begins with ``heading`` (radians)."""
    angle = heading - stored.states[0, 2]
    if abs(angle) <= START_TOLERANCE:
        return stored
    cos, sin = math.cos(angle), math.sin(angle)
    states = stored.states.copy()
    offsets = states[:, :2] - states[0, :2]
    states[:, :2] = states[0, :2] + offsets @ np.array([[cos, sin], [-sin, cos]])
    states[:, 2] += angle
    return Plan(states, stored.controls, stored.dt)


@inlined
def turn_to_start(sweeps: PlanSweeps, i: int, ends: Ends) -> tuple[bool, float, float]:
    """Whether plan ``i`` begins at the start's position; cosine and sine of its turn to the start's heading.

    The sine is exactly 0 if the plan has that heading already.
    """
    x, y, heading = ends.start
    first = sweeps.first_poses[i]
    begins = abs(first[0] - x) <= START_TOLERANCE and abs(first[1] - y) <= START_TOLERANCE
    angle = heading - first[2]
    if abs(angle) <= START_TOLERANCE:
        return begins, 1.0, 0.0
    return begins, math.cos(angle), math.sin(angle)


@inlined
def _turned_point(sweeps: PlanSweeps, i: int, x: float, y: float, cos: float, sin: float) -> Point:
    """Where a point (x, y) of plan ``i`` lies after the plan's turn."""
    if sin == 0.0:
        return x, y
    px = sweeps.first_poses[i, 0]
    py = sweeps.first_poses[i, 1]
    return px + cos * (x - px) - sin * (y - py), py + sin * (x - px) + cos * (y - py)


@inlined
def _ends_at_goal(sweeps: PlanSweeps, i: int, cos: float, sin: float, ends: Ends) -> bool:
    last = sweeps.last_positions[i]
    x, y = _turned_point(sweeps, i, last[0], last[1], cos, sin)
    return math.hypot(x - ends.goal[0], y - ends.goal[1]) <= ends.goal_radius


@inlined
def _turned_box_is_free(sweeps: PlanSweeps, i: int, j: int, cos: float, sin: float, scene: Scene) -> bool:
    """Whether box ``j``, one of plan ``i``, is free after the plan's turn."""
    boxes = sweeps.boxes
    x, y = _turned_point(sweeps, i, boxes[j, 0], boxes[j, 1], cos, sin)
    box_cos = boxes[j, 2]
    box_sin = boxes[j, 3]
    if sin != 0.0:
        box_cos, box_sin = cos * box_cos - sin * box_sin, sin * box_cos + cos * box_sin
    return box_is_free((x, y, box_cos, box_sin, boxes[j, 4], boxes[j, 5]), scene)


@inlined
def sweep_is_free(sweeps: PlanSweeps, i: int, cos: float, sin: float, scene: Scene) -> tuple[bool, int]:
    """Whether plan ``i`` is free after a turn of that cosine and sine, and how many boxes were checked."""
    first = sweeps.starts[i]
    last = sweeps.starts[i + 1]
    for j in range(first, last):
        if not _turned_box_is_free(sweeps, i, j, cos, sin, scene):
            return False, j - first + 1
    return True, last - first


@jit
def free_plans(sweeps: PlanSweeps, scene: Scene) -> Flags:
    """Label vector ``[N]``: which plans are free, as they are stored, in a scene of the canonical frame."""
    free = np.empty(sweeps.starts.shape[0] - 1, np.bool_)
    for i in range(free.shape[0]):
        free[i], _ = sweep_is_free(sweeps, i, 1.0, 0.0, scene)
    return free


@lean
def plan_fits(sweeps: PlanSweeps, i: int, ends: Ends, scene: Scene) -> tuple[bool, int]:
    """Whether plan ``i`` fits a problem, and how many boxes were checked to know."""
    begins, cos, sin = turn_to_start(sweeps, i, ends)
    if not (begins and _ends_at_goal(sweeps, i, cos, sin, ends)):
        return False, 0
    return sweep_is_free(sweeps, i, cos, sin, scene)


@lean
def first_fitting(order: Integers, sweeps: PlanSweeps, ends: Ends, scene: Scene) -> tuple[int, int]:
    """The first plan of ``order [k]`` that fits a problem (-1: none), and how many boxes were checked."""
    checks = 0
    for i in order:
        fits, checked = plan_fits(sweeps, i, ends, scene)
        checks += checked
        if fits:
            return i, checks
    return -1, checks


@inlined
def _inside(boxes: Floats, first: int, last: int, bounds: Bounds) -> bool:
    for j in range(first, last):
        box = (boxes[j, 0], boxes[j, 1], boxes[j, 2], boxes[j, 3], boxes[j, 4], boxes[j, 5])
        if not box_is_inside(box, bounds):
            return False
    return True


@inlined
def _piece_meets(
    boxes: Floats, first_box: int, last_box: int, vertices: Floats, first: int, last: int, edges: Floats
) -> tuple[bool, int]:
    """Whether any of the boxes meets a convex piece, and on how many that was tried."""
    x_min, y_min, x_max, y_max = piece_extent(vertices, first, last)
    x_min -= REACH_M
    y_min -= REACH_M
    x_max += REACH_M
    y_max += REACH_M
    checks = 0
    for j in range(first_box, last_box):
        x = boxes[j, 0]
        y = boxes[j, 1]
        if x < x_min or x > x_max or y < y_min or y > y_max:
            continue
        if checks == 0:
            make_edges(vertices, first, last, edges, 0)
        checks += 1
        box = (x, y, boxes[j, 2], boxes[j, 3], boxes[j, 4], boxes[j, 5])
        if box_meets_piece(box, 0, last - first, edges):
            return True, checks
    return False, checks


@lean
def _first_drawn(
    order: Integers,
    sweeps: PlanSweeps,
    masks: Bits,
    drawing: Drawing,
    vertices: Floats,
    piece_starts: Integers,
    edges: Floats,
    bounds: Bounds,
    ends: Ends,
    blocking: int,
) -> tuple[int, int, int]:
    """The first plan of ``order`` that fits (-1: none), how many boxes were tried, and what blocked the last.

    The piece that blocked another plan, ``blocking``, is tried first: it mostly blocks the next one, too.
    """
    narrow = bounds[0] > BOUNDS[0] or bounds[1] > BOUNDS[1] or bounds[2] < BOUNDS[2] or bounds[3] < BOUNDS[3]
    checks = 0
    pieces = piece_starts.shape[0] - 1
    for i in order:
        begins, cos, sin = turn_to_start(sweeps, i, ends)
        if not (begins and sin == 0.0 and _ends_at_goal(sweeps, i, cos, sin, ends)):
            continue
        first_box = sweeps.starts[i]
        last_box = sweeps.starts[i + 1]
        outside = masks[i, 0] == ALL_CELLS  # the plan leaves the window, so its cells say nothing
        free = not (outside or narrow) or _inside(sweeps.boxes, first_box, last_box, bounds)
        for turn in range(pieces):
            if not free:
                break
            p = blocking if turn == 0 else turn - 1 if turn <= blocking else turn
            near = outside
            for row in range(drawing.rows[p, 0], drawing.rows[p, 1] + 1):
                near |= masks[i, row] & drawing.pieces[p, row] != np.uint64(0)
            if near:
                meets, tried = _piece_meets(
                    sweeps.boxes, first_box, last_box, vertices, piece_starts[p], piece_starts[p + 1], edges
                )
                checks += tried
                if meets:
                    free = False
                    blocking = p
        if free:
            return i, checks, blocking
    return -1, checks, blocking


@lean
def _first_fitting_drawn(
    order: Integers,
    decisive: Integers,
    sweeps: PlanSweeps,
    masks: Bits,
    drawing: Drawing,
    vertices: Floats,
    piece_starts: Integers,
    edges: Floats,
    bounds: Bounds,
    ends: Ends,
) -> tuple[int, int]:
    plan, checks, blocking = _first_drawn(
        decisive, sweeps, masks, drawing, vertices, piece_starts, edges, bounds, ends, 0
    )
    if plan < 0 and decisive.shape[0] > 0:
        return plan, checks
    plan, more, _ = _first_drawn(
        order, sweeps, masks, drawing, vertices, piece_starts, edges, bounds, ends, blocking
    )
    return plan, checks + more


def first_fitting_drawn(
    order: Integers,
    sweeps: PlanSweeps,
    masks: Bits,
    drawing: Drawing,
    problem: Problem,
    decisive: Integers = NO_PLANS,
) -> tuple[int, int]:
    """Find the first plan that fits a problem as it is stored, from the problem's drawing.

    Only an obstacle that shares a cell with a plan can meet it, and is tried on the boxes beside it.

    Args:
        order: ``[k]`` the plans to try, in this order.
        sweeps: the swept boxes of all N plans.
        masks: ``[N, 64]`` the cells that each plan sweeps.
        drawing: of the problem.
        problem: what the plan is to fit.
        decisive: ``[m]`` plans to try before; if there are some and none of them fits, no other is tried.

    Returns:
        The plan, -1 if none fits, and how many times a box was tried on an obstacle.
    """
    vertices, piece_starts, _ = problem.obstacles
    edges = np.empty((len(vertices), 5))
    return _first_fitting_drawn(
        *(order, decisive, sweeps, masks, drawing, vertices, piece_starts, edges, problem.bounds),
        ends_of(problem),
    )
