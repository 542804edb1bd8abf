"""Kernels that place single obstacles in a new set, and check whether they meet swept boxes."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planners.memory.plans.experience import Experience
from planners.world.arrays import Floats
from planners.world.geometry.collision import box_meets_piece, make_edges, piece_extent
from planners.world.jit import jit
from planners.world.obstacle_sets import first_obstacles, new_obstacles, take_obstacle
from planners.world.problem import Obstacles
from planners.world.trigonometry import length


class Corridor(NamedTuple):
    """The space that must stay free for a plan."""

    boxes: Floats  # [T, B, 6] its swept boxes in driving order, columns as in PlanSweeps
    stride_m: float  # their largest stride (``largest_stride``)
    goal: Floats  # [1, 1, 6] the square around the goal disc, as a box


def corridor_of(experience: Experience) -> Corridor:
    """Return the corridor of an experience's plan."""
    (x, y), radius = experience.problem.goal, experience.problem.goal_radius
    goal = np.array([[[x, y, 1.0, 0.0, radius, radius]]])
    return Corridor(experience.boxes, largest_stride(experience.boxes), goal)


@jit
def largest_stride(boxes: Floats) -> float:
    """The most, in metres, that a gap in x or y shrinks between successive states of boxes ``[T, B, 6]``."""
    largest = 0.0
    for t in range(1, boxes.shape[0]):
        for b in range(boxes.shape[1]):
            way_x = abs(boxes[t, b, 0] - boxes[t - 1, b, 0])
            way_y = abs(boxes[t, b, 1] - boxes[t - 1, b, 1])
            growth = abs(boxes[t, b, 4] - boxes[t - 1, b, 4]) + abs(boxes[t, b, 5] - boxes[t - 1, b, 5])
            largest = max(largest, max(way_x, way_y) + growth)
    return largest


@jit
def obstacle_meets(obstacles: Obstacles, o: int, boxes: Floats, widened_m: float, stride_m: float) -> bool:
    """Whether obstacle ``o`` meets any of ``boxes [T, B, 6]`` (as in PlanSweeps), widened on every side.

    ``stride_m`` is their largest stride: states at which no body can be near yet are skipped. For boxes in no
    order it is infinite.
    """
    first_piece = obstacles.obstacle_starts[o]
    last_piece = obstacles.obstacle_starts[o + 1]
    first = obstacles.piece_starts[first_piece]
    last = obstacles.piece_starts[last_piece]
    edges = np.empty((last - first, 5))
    for p in range(first_piece, last_piece):
        vertices = obstacles.vertices[obstacles.piece_starts[p] : obstacles.piece_starts[p + 1]]
        count = vertices.shape[0]
        make_edges(vertices, 0, count, edges, 0)
        x_min, y_min, x_max, y_max = piece_extent(vertices, 0, count)
        t = 0
        while t < boxes.shape[0]:
            skipped = boxes.shape[0]
            for b in range(boxes.shape[1]):
                x = boxes[t, b, 0]
                y = boxes[t, b, 1]
                half_length = boxes[t, b, 4] + widened_m
                half_width = boxes[t, b, 5] + widened_m
                gap = max(x_min - x, x - x_max, y_min - y, y - y_max) - length(half_length, half_width)
                if gap > 0.0:
                    skipped = min(skipped, int(gap / stride_m))
                    continue
                skipped = 0
                box = (x, y, boxes[t, b, 2], boxes[t, b, 3], half_length, half_width)
                if box_meets_piece(box, 0, count, edges):
                    return True
            t += 1 + skipped
    return False


@jit
def meets_corridor(obstacles: Obstacles, o: int, corridor: Corridor, widened_m: float) -> bool:
    """Whether obstacle ``o`` meets a plan's sweep, widened on every side, or the square around the goal."""
    return obstacle_meets(obstacles, o, corridor.boxes, widened_m, corridor.stride_m) or obstacle_meets(
        obstacles, o, corridor.goal, 0.0, math.inf
    )


@jit
def add_clear(source: Obstacles, corridor: Corridor, widened_m: float, target: Obstacles, count: int) -> int:
    """Add the obstacles of ``source`` that are clear of a corridor to the first ``count`` of ``target``.

    Returns how many there are then.
    """
    for o in range(source.obstacle_starts.shape[0] - 1):
        take_obstacle(source, o, target, count)
        if not meets_corridor(target, count, corridor, widened_m):
            count += 1
    return count


@jit
def obstacles_near(obstacles: Obstacles, corridor: Corridor, near_m: float) -> Obstacles:
    """Copy the obstacles that meet a plan's sweep widened by ``near_m`` on every side."""
    result = new_obstacles(obstacles, obstacles)
    count = 0
    for o in range(obstacles.obstacle_starts.shape[0] - 1):
        take_obstacle(obstacles, o, result, count)
        if obstacle_meets(result, count, corridor.boxes, near_m, corridor.stride_m):
            count += 1
    return first_obstacles(result, count)


@jit
def clear_of(x: float, y: float, boxes: Floats, enough_m: float) -> float:
    """Distance in metres from a point to the nearest of ``boxes [S, 6]``; 0 inside a box.

    Distances below ``enough_m`` need not be exact: then any distance up to it may be returned.
    """
    nearest = math.inf
    for j in range(boxes.shape[0]):
        dx = x - boxes[j, 0]
        dy = y - boxes[j, 1]
        u = abs(dx * boxes[j, 2] + dy * boxes[j, 3]) - boxes[j, 4]
        w = abs(dy * boxes[j, 2] - dx * boxes[j, 3]) - boxes[j, 5]
        nearest = min(nearest, length(max(u, 0.0), max(w, 0.0)))
        if nearest <= enough_m:
            break
    return nearest


@jit
def with_clear(placed: Obstacles, fresh: Obstacles, corridor: Corridor, near_m: float) -> Obstacles:
    """Join ``placed`` and those of ``fresh`` that are clear of a corridor widened by ``near_m``."""
    result = new_obstacles(placed, fresh)
    count = placed.obstacle_starts.shape[0] - 1
    for o in range(count):
        take_obstacle(placed, o, result, o)
    return first_obstacles(result, add_clear(fresh, corridor, near_m, result, count))
