"""Whether a problem's free space is that of what it was made from: kernels beside shapely."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import shapely

from planners.maps.occupancy_map import Cells
from planners.world.collision import box_is_free, scene_of
from planners.world.problem import Floats, Problem

HALF_LENGTH, HALF_WIDTH = 1.0, 0.45  # metres: about the car
EDGE_M = 1e-3  # how far an outline may be moved by rounding


def cells_shape(
    occupied: Cells, resolution: float, left: float = 0.0, bottom: float = 0.0
) -> shapely.Geometry:
    """Occupied cells, row 0 the lowest, as one prepared shape made cell by cell."""
    rows, columns = np.nonzero(occupied)
    x, y = left + columns * resolution, bottom + rows * resolution
    shape = shapely.union_all(shapely.box(x, y, x + resolution, y + resolution))
    shapely.prepare(shape)
    return shape


def disagreements(
    problem: Problem,
    shape: shapely.Geometry,
    count: int,
    to_source: Callable[[Floats], Floats] = lambda points: points,
) -> int:
    """How many of ``count`` random footprints are free to the kernel but not truly, or the reverse.

    ``shape`` is what is truly occupied, in the frame that ``to_source`` brings points ``[n, 2]`` to.
    """
    rng = np.random.default_rng(len(problem.obstacles.vertices))
    reach = math.hypot(HALF_LENGTH, HALF_WIDTH)
    low, high = np.array(problem.bounds[:2]) + reach, np.array(problem.bounds[2:]) - reach
    places, turns = rng.uniform(low, high, (count, 2)), rng.uniform(-math.pi, math.pi, count)
    cos, sin = np.cos(turns), np.sin(turns)
    scene = scene_of(problem)
    free = np.array(
        [
            box_is_free(x, y, c, s, HALF_LENGTH, HALF_WIDTH, scene)
            for (x, y), c, s in zip(places.tolist(), cos.tolist(), sin.tolist(), strict=True)
        ]
    )

    def meets(margin: float) -> Cells:
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [HALF_LENGTH + margin, HALF_WIDTH + margin]
        turned = corners @ np.stack((np.stack((cos, sin), -1), np.stack((-sin, cos), -1)), 1)
        points = to_source((turned + places[:, np.newaxis]).reshape(-1, 2)).reshape(-1, 4, 2)
        met: Cells = shapely.intersects(shape, shapely.polygons(points))
        return met

    return int((free & meets(-EDGE_M)).sum() + (~free & ~meets(EDGE_M)).sum())
