"""Draws the occupancy grids and label vectors of many problems at once: an encoder learns from them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from planners.memory.plans.free import free_plans
from planners.memory.plans.sweeps import PlanSweeps
from planners.world.arrays import Flags, Floats, Integers
from planners.world.geometry.collision import build_scene
from planners.world.geometry.occupancy import GRID, Grid, draw_occupancy
from planners.world.jit import jit
from planners.world.problem import Problem


class Labelled(NamedTuple):
    """The grids of n problems, and which of N plans are free in each."""

    grids: Grid  # uint8 [n, 512] occupancy grids, packed as by ``occupancy.pack``
    free: Flags  # [n, N]


def label_problems(problems: Sequence[Problem], sweeps: PlanSweeps) -> Labelled:
    """Draw the grid and the label vector of each of n canonical problems."""
    corners = np.cumsum([0] + [len(problem.obstacles.vertices) for problem in problems], dtype=np.int32)
    pieces = np.cumsum([0] + [len(problem.obstacles.piece_starts) for problem in problems], dtype=np.int32)
    grids = np.empty((len(problems), GRID, GRID), np.uint8)
    free = np.empty((len(problems), len(sweeps.starts) - 1), np.bool_)
    if problems:
        _label(
            np.concatenate([problem.obstacles.vertices for problem in problems]),
            corners,
            np.concatenate([problem.obstacles.piece_starts for problem in problems]),
            pieces,
            np.array([problem.bounds for problem in problems]),
            sweeps,
            grids,
            free,
        )
    return Labelled(np.packbits(grids.reshape(len(problems), GRID * GRID), axis=1), free)


@jit
def _label(
    vertices: Floats,
    corners: Integers,
    piece_starts: Integers,
    pieces: Integers,
    bounds: Floats,
    sweeps: PlanSweeps,
    grids: Grid,
    free: Flags,
) -> None:
    """Fill in ``grids`` and ``free``. Problem i owns vertices[corners[i] : corners[i + 1]], and so on."""
    for i in range(bounds.shape[0]):
        shape = vertices[corners[i] : corners[i + 1]]
        starts = piece_starts[pieces[i] : pieces[i + 1]]
        grid = draw_occupancy(shape, starts, bounds[i])
        for row in range(GRID):
            for column in range(GRID):
                grids[i, row, column] = grid[row, column]
        labels = free_plans(sweeps, build_scene(shape, starts, bounds[i]))
        for j in range(labels.shape[0]):
            free[i, j] = labels[j]
