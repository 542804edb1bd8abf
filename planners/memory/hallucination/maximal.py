"""Maximal: everything that the plan leaves free is an obstacle, so that only this plan's corridor is left."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from planners.memory.hallucination.method import DrawObstacles, Range, Sampler
from planners.memory.plans.experience import Experience
from planners.world.arrays import Floats, Integers
from planners.world.geometry.occupancy import CELL, GRID, Grid, draw_occupancy
from planners.world.jit import jit
from planners.world.problem import BOUNDS, Obstacles
from planners.world.vehicles.bodies import box_corners

SEAM_M: Final = 1e-3  # between two rectangles, so that they do not fill cells that they only touch
DISC_SIDES: Final = 16
_EVERYWHERE: Final = np.array([-np.inf, -np.inf, np.inf, np.inf])


@dataclass(frozen=True)
class Maximal:
    """Fill all cells of the occupancy grid that the dilated sweep does not meet (LfH, Xiao et al. 2021).

    The sweep consists of the plan's footprints, scaled and then widened on every side, and of a disc at each
    end. All four are drawn anew for each problem. Cells are 1 m wide, so walls may stand up to 1.4 m farther
    away.
    """

    clearance_m: Range = (0.0, 2.0)
    footprint_scale: Range = (1.0, 1.5)
    start_radius_m: Range = (0.0, 5.0)
    goal_radius_m: Range = (0.0, 5.0)  # beyond the goal disc's own

    def around(self, experience: Experience, rng: np.random.Generator) -> Sampler:
        """Prepare the plan's sweep."""
        boxes, problem = experience.boxes.reshape(-1, 6), experience.problem

        def sample(draw: DrawObstacles, rng: np.random.Generator) -> Obstacles:
            scaled = boxes.copy()
            scaled[:, 4:] *= rng.uniform(*self.footprint_scale)
            corners = box_corners(scaled, rng.uniform(*self.clearance_m))
            start = _disc(problem.start[0], problem.start[1], rng.uniform(*self.start_radius_m))
            goal = _disc(*problem.goal, problem.goal_radius + rng.uniform(*self.goal_radius_m))
            first = np.arange(0, len(corners) + 1, 4)
            discs = len(corners) + DISC_SIDES * np.arange(1, 3)
            pieces = np.concatenate([first, discs]).astype(np.int32)
            return filled(draw_occupancy(np.concatenate([corners, start, goal]), pieces, _EVERYWHERE))

        return sample


def _disc(x: float, y: float, radius: float) -> Floats:
    """A polygon ``[16, 2]`` around a disc."""
    angles = 2.0 * np.pi * np.arange(DISC_SIDES) / DISC_SIDES
    reach = radius / np.cos(np.pi / DISC_SIDES)
    return np.column_stack((x + reach * np.cos(angles), y + reach * np.sin(angles)))


@jit
def filled(free: Grid) -> Obstacles:
    """Cover the cells of ``free [64, 64]`` that are 0 with rectangles: runs of a row, extended upwards."""
    vertices = np.empty((4 * GRID * GRID, 2))
    done = free.copy()
    count = 0
    for row in range(GRID):
        column = 0
        while column < GRID:
            first = column
            while column < GRID and done[row, column] == 0:
                column += 1
            if column == first:
                column += 1
                continue
            top = row
            while top < GRID and not done[top, first:column].any():
                done[top, first:column] = 1
                top += 1
            for i in range(4):
                x = column * CELL - SEAM_M if i in (1, 2) else first * CELL
                y = top * CELL - SEAM_M if i >= 2 else row * CELL
                vertices[4 * count + i, 0] = np.float64(np.float32(BOUNDS[0] + x))
                vertices[4 * count + i, 1] = np.float64(np.float32(BOUNDS[1] + y))
            count += 1
    starts: Integers = np.arange(count + 1).astype(np.int32)
    return Obstacles(vertices[: 4 * count].copy(), 4 * starts, starts)
