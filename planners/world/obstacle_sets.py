"""Kernels that copy single obstacles into a new set."""

from __future__ import annotations

import math

import numpy as np

from planners.world.jit import jit
from planners.world.problem import Obstacles


@jit
def new_obstacles(some: Obstacles, others: Obstacles) -> Obstacles:
    """An empty set with room for all obstacles of two sets."""
    return Obstacles(
        np.empty((some.vertices.shape[0] + others.vertices.shape[0], 2)),
        np.zeros(some.piece_starts.shape[0] + others.piece_starts.shape[0], np.int32),
        np.zeros(some.obstacle_starts.shape[0] + others.obstacle_starts.shape[0], np.int32),
    )


@jit
def take_obstacle(source: Obstacles, o: int, target: Obstacles, count: int) -> None:
    """Write obstacle ``o`` of ``source`` as number ``count`` of ``target``, over what was there."""
    moved_obstacle(source, o, 0.0, 0.0, 0.0, target, count)


@jit
def moved_obstacle(
    source: Obstacles, o: int, dx: float, dy: float, turn: float, target: Obstacles, count: int
) -> None:
    """Like ``take_obstacle``, but moved by (dx, dy) metres and turned by ``turn`` radians about its centre.

    The centre is the mean of the vertices. Coordinates are rounded to float32, as in all obstacles.
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
def first_obstacles(obstacles: Obstacles, count: int) -> Obstacles:
    """Copy the first ``count`` obstacles."""
    pieces = obstacles.obstacle_starts[count]
    return Obstacles(
        obstacles.vertices[: obstacles.piece_starts[pieces]].copy(),
        obstacles.piece_starts[: pieces + 1].copy(),
        obstacles.obstacle_starts[: count + 1].copy(),
    )
