"""Whether a problem's free space is that of what it was made from: kernels beside shapely."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import shapely

from planners.maps.occupancy_map import Cells
from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene, box_is_free, scene_of
from planners.world.jit import jit
from planners.world.problem import Problem

HALF_LENGTH, HALF_WIDTH = 1.0, 0.45  # metres: about the car
EDGE_M = 1e-3  # how far an outline may be moved by rounding


def cells_shape(
    occupied: Cells, resolution: float, left: float = 0.0, bottom: float = 0.0
) -> shapely.Geometry:
    """Occupied cells, row 0 the lowest, as one prepared shape made of the runs of each row."""
    edges = np.diff(np.pad(occupied, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    (rows, begins), (_, ends) = np.nonzero(edges == 1), np.nonzero(edges == -1)
    x, y, x_end = left + begins * resolution, bottom + rows * resolution, left + ends * resolution
    shape = shapely.union_all(shapely.box(x, y, x_end, y + resolution))
    shapely.prepare(shape)
    return shape


@jit
def boxes_are_free(boxes: Floats, half_length: float, half_width: float, scene: Scene) -> Cells:
    """Whether each box ``[n, 4]`` (centre, cosine and sine) is free."""
    free = np.empty(len(boxes), np.bool_)
    for i in range(len(boxes)):
        box = (boxes[i, 0], boxes[i, 1], boxes[i, 2], boxes[i, 3], half_length, half_width)
        free[i] = box_is_free(box, scene)
    return free


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
    turns = rng.uniform(-math.pi, math.pi, count)
    boxes = np.column_stack((rng.uniform(low, high, (count, 2)), np.cos(turns), np.sin(turns)))
    free = boxes_are_free(boxes, HALF_LENGTH, HALF_WIDTH, scene_of(problem))

    def met(among: Floats, margin: float) -> int:
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [HALF_LENGTH + margin, HALF_WIDTH + margin]
        cos, sin = among[:, 2], among[:, 3]
        turned = corners @ np.stack((np.stack((cos, sin), -1), np.stack((-sin, cos), -1)), 1)
        points = to_source((turned + among[:, np.newaxis, :2]).reshape(-1, 2)).reshape(-1, 4, 2)
        return int(shapely.intersects(shape, shapely.polygons(points)).sum())

    return met(boxes[free], -EDGE_M) + int((~free).sum()) - met(boxes[~free], EDGE_M)
