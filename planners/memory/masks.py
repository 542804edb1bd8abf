"""The cells that a plan sweeps, one bit each: ranking by counting bits, and proof that a plan is free.

A cell is set where any swept box of the plan meets it, as a cell of the occupancy grid is set where any
obstacle meets it. Where the two share no cell, the plan is free: no check is needed.
"""

from __future__ import annotations

import numpy as np

from planners.memory.labels import PlanSweeps
from planners.world.bodies import box_corners
from planners.world.occupancy import GRID, Grid, draw_occupancy
from planners.world.problem import BOUNDS

Masks = np.ndarray[tuple[int, ...], np.dtype[np.uint64]]

ROUNDING_M = 1e-6  # boxes are drawn that much larger, so that rounding never loses a cell
_EVERYWHERE = np.array([-np.inf, -np.inf, np.inf, np.inf])


def mask_of(grid: Grid) -> Masks:
    """The bits ``[64]`` of a grid ``[64, 64]``: bit c of word r is the cell in row r (y) and column c (x)."""
    return np.packbits(grid, axis=1, bitorder="little").view("<u8").astype(np.uint64).reshape(GRID)


def masks_of(sweeps: PlanSweeps) -> Masks:
    """The swept cells ``[N, 64]`` of N plans.

    A plan that leaves the window of the grid, where nothing is drawn, has all cells set: nothing is proved
    of it.
    """
    masks = np.empty((len(sweeps.starts) - 1, GRID), np.uint64)
    for i in range(len(masks)):
        corners = box_corners(sweeps.boxes[sweeps.starts[i] : sweeps.starts[i + 1]], ROUNDING_M)
        inside = np.all((corners > BOUNDS[:2]) & (corners < BOUNDS[2:]))
        starts = np.arange(0, len(corners) + 1, 4, dtype=np.int32)
        masks[i] = mask_of(draw_occupancy(corners, starts, _EVERYWHERE)) if inside else ~np.uint64(0)
    return masks
