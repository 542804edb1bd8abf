"""Whether a stored plan answers a problem: exact, straight from the drawing, with nothing to build first.

Only obstacles that share a cell with the plan can meet it, and each is tried on the boxes beside it. The
answer is that of ``labels.plan_answers``, which needs the scene: some times as long to make as this takes.
"""

from __future__ import annotations

import numpy as np

from planners.memory.plans.sweeps import PlanSweeps, plan_joins
from planners.world.arrays import Floats, Integers
from planners.world.geometry.collision import REACH_M, box_meets_piece, make_edges, piece_extent
from planners.world.geometry.occupancy import ALL_CELLS, Bits, Drawing
from planners.world.jit import inlined, lean
from planners.world.problem import BOUNDS, Problem


@inlined
def _inside(boxes: Floats, first: int, last: int, bounds: tuple[float, float, float, float]) -> bool:
    for j in range(first, last):
        cos = abs(boxes[j, 2])
        sin = abs(boxes[j, 3])
        extent_x = boxes[j, 4] * cos + boxes[j, 5] * sin
        extent_y = boxes[j, 4] * sin + boxes[j, 5] * cos
        if (
            boxes[j, 0] - extent_x < bounds[0]
            or boxes[j, 0] + extent_x > bounds[2]
            or boxes[j, 1] - extent_y < bounds[1]
            or boxes[j, 1] + extent_y > bounds[3]
        ):
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
        if box_meets_piece(x, y, boxes[j, 2], boxes[j, 3], boxes[j, 4], boxes[j, 5], 0, last - first, edges):
            return True, checks
    return False, checks


@lean
def _first_free(
    order: Integers,
    sweeps: PlanSweeps,
    masks: Bits,
    drawing: Drawing,
    vertices: Floats,
    piece_starts: Integers,
    edges: Floats,
    bounds: tuple[float, float, float, float],
    start: tuple[float, float, float],
    goal: tuple[float, float],
    goal_radius: float,
) -> tuple[int, int]:
    narrow = bounds[0] > BOUNDS[0] or bounds[1] > BOUNDS[1] or bounds[2] < BOUNDS[2] or bounds[3] < BOUNDS[3]
    checks = 0
    for i in order:
        if not plan_joins(sweeps, i, start, goal, goal_radius):
            continue
        first_box = sweeps.starts[i]
        last_box = sweeps.starts[i + 1]
        outside = masks[i, 0] == ALL_CELLS  # it leaves the window: its cells say nothing
        free = not (outside or narrow) or _inside(sweeps.boxes, first_box, last_box, bounds)
        for p in range(piece_starts.shape[0] - 1):
            if not free:
                break
            near = outside
            for row in range(drawing.rows[p, 0], drawing.rows[p, 1] + 1):
                near |= masks[i, row] & drawing.pieces[p, row] != np.uint64(0)
            if near:
                meets, tried = _piece_meets(
                    sweeps.boxes, first_box, last_box, vertices, piece_starts[p], piece_starts[p + 1], edges
                )
                checks += tried
                free = not meets
        if free:
            return i, checks
    return -1, checks


def first_free(
    order: Integers, sweeps: PlanSweeps, masks: Bits, drawing: Drawing, problem: Problem
) -> tuple[int, int]:
    """The first plan of ``order`` that answers a drawn problem as it was stored (-1: none).

    Also how many times a box was tried on an obstacle to know. ``masks [N, 64]`` are the plans' cells.
    """
    vertices, piece_starts, _ = problem.obstacles
    edges = np.empty((len(vertices), 5))
    return _first_free(
        order,
        sweeps,
        masks,
        drawing,
        vertices,
        piece_starts,
        edges,
        problem.bounds,
        problem.start,
        problem.goal,
        problem.goal_radius,
    )
