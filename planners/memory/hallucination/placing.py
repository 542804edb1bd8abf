"""Kernels that put single obstacles into a set being made, and tell whether they meet swept boxes."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planners.memory.plans.experience import Experience
from planners.world.arrays import Floats
from planners.world.geometry.collision import box_meets_piece, make_edges, piece_extent
from planners.world.jit import jit
from planners.world.problem import Obstacles
from planners.world.trigonometry import length


class Corridor(NamedTuple):
    """What must stay free for a plan."""

    boxes: Floats  # [T, B, 6] its swept boxes in driving order, columns as in PlanSweeps
    stride_m: float  # their largest stride
    goal: Floats  # [1, 1, 6] the square around the goal disc, as a box


def corridor_of(experience: Experience) -> Corridor:
    """The corridor of an experience's plan."""
    (x, y), radius = experience.problem.goal, experience.problem.goal_radius
    goal = np.array([[[x, y, 1.0, 0.0, radius, radius]]])
    return Corridor(experience.boxes, largest_stride(experience.boxes), goal)


@jit
def take_obstacle(source: Obstacles, o: int, target: Obstacles, count: int) -> None:
    """Write obstacle ``o`` of ``source`` as number ``count`` of ``target``, in place of what was there."""
    moved_obstacle(source, o, 0.0, 0.0, 0.0, target, count)


@jit
def moved_obstacle(
    source: Obstacles, o: int, dx: float, dy: float, turn: float, target: Obstacles, count: int
) -> None:
    """Like ``take_obstacle``, moved by (dx, dy) metres and turned by ``turn`` radians about its centre.

    The centre is the mean of its vertices. Coordinates are rounded to float32, as everywhere in Obstacles.
    """
    first_piece = source.obstacle_starts[o]
    last_piece = source.obstacle_starts[o + 1]
    first = source.piece_starts[first_piece]
    last = source.piece_starts[last_piece]
    centre_x = 0.0
    centre_y = 0.0
    for i in range(first, last):
        centre_x += source.vertices[i, 0] / (last - first)
        centre_y += source.vertices[i, 1] / (last - first)
    still = dx == 0.0 and dy == 0.0 and turn == 0.0
    cos = math.cos(turn)
    sin = math.sin(turn)
    piece = target.obstacle_starts[count]
    end = target.piece_starts[piece]
    for i in range(first, last):
        x = source.vertices[i, 0]
        y = source.vertices[i, 1]
        if not still:
            u = x - centre_x
            w = y - centre_y
            x = np.float64(np.float32(centre_x + dx + cos * u - sin * w))
            y = np.float64(np.float32(centre_y + dy + sin * u + cos * w))
        target.vertices[end + i - first, 0] = x
        target.vertices[end + i - first, 1] = y
    for p in range(first_piece, last_piece):
        target.piece_starts[piece + p - first_piece + 1] = end + source.piece_starts[p + 1] - first
    target.obstacle_starts[count + 1] = piece + last_piece - first_piece


@jit
def largest_stride(boxes: Floats) -> float:
    """The most, in metres, by which a gap in x or y can shrink between states of ``boxes [T, B, 6]``."""
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

    ``stride_m`` is their largest stride, infinite for boxes in no order: states at which no body can have
    come near since the last look are skipped.
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
                cos = boxes[t, b, 2]
                sin = boxes[t, b, 3]
                if box_meets_piece(x, y, cos, sin, half_length, half_width, 0, count, edges):
                    return True
            t += 1 + skipped
    return False


@jit
def meets_corridor(obstacles: Obstacles, o: int, corridor: Corridor, widened_m: float) -> bool:
    """Whether obstacle ``o`` meets a plan's sweep, widened on every side, or the square around its goal."""
    return obstacle_meets(obstacles, o, corridor.boxes, widened_m, corridor.stride_m) or obstacle_meets(
        obstacles, o, corridor.goal, 0.0, math.inf
    )


@jit
def new_obstacles(some: Obstacles, others: Obstacles) -> Obstacles:
    """Room for all of two sets of obstacles; none is there yet."""
    return Obstacles(
        np.empty((some.vertices.shape[0] + others.vertices.shape[0], 2)),
        np.zeros(some.piece_starts.shape[0] + others.piece_starts.shape[0], np.int32),
        np.zeros(some.obstacle_starts.shape[0] + others.obstacle_starts.shape[0], np.int32),
    )


@jit
def add_clear(source: Obstacles, corridor: Corridor, widened_m: float, target: Obstacles, count: int) -> int:
    """Put the obstacles of ``source`` that are clear of a corridor behind the first ``count`` of ``target``.

    Returns how many there are then.
    """
    for o in range(source.obstacle_starts.shape[0] - 1):
        take_obstacle(source, o, target, count)
        if not meets_corridor(target, count, corridor, widened_m):
            count += 1
    return count


@jit
def first_obstacles(obstacles: Obstacles, count: int) -> Obstacles:
    """The first ``count`` obstacles, in arrays of their own."""
    pieces = obstacles.obstacle_starts[count]
    return Obstacles(
        obstacles.vertices[: obstacles.piece_starts[pieces]].copy(),
        obstacles.piece_starts[: pieces + 1].copy(),
        obstacles.obstacle_starts[: count + 1].copy(),
    )


@jit
def obstacles_near(obstacles: Obstacles, corridor: Corridor, near_m: float) -> Obstacles:
    """The obstacles that meet a plan's sweep widened by ``near_m`` on every side."""
    result = new_obstacles(obstacles, obstacles)
    count = 0
    for o in range(obstacles.obstacle_starts.shape[0] - 1):
        take_obstacle(obstacles, o, result, count)
        if obstacle_meets(result, count, corridor.boxes, near_m, corridor.stride_m):
            count += 1
    return first_obstacles(result, count)


@jit
def clear_of(x: float, y: float, boxes: Floats, enough_m: float) -> float:
    """Distance in metres from a point to the nearest of ``boxes [S, 6]``; 0 in one.

    From ``enough_m`` down the exact distance no longer matters: some distance up to it is returned.
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
    """All of ``placed``, and of a fresh draw what is clear of a corridor widened by ``near_m``."""
    result = new_obstacles(placed, fresh)
    count = placed.obstacle_starts.shape[0] - 1
    for o in range(count):
        take_obstacle(placed, o, result, o)
    return first_obstacles(result, add_clear(fresh, corridor, near_m, result, count))
