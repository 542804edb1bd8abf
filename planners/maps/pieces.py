"""The occupied part of a map as convex pieces: exact rectangles, or fewer polygons within a tolerance."""

from __future__ import annotations

import numpy as np
import shapely

from planners.maps.occupancy_map import Cells, OccupancyMap
from planners.maps.rectangles import rectangles_of
from planners.world.geometry.polygons import joined_triangles

Shapes = np.ndarray[tuple[int, ...], np.dtype[np.object_]]


def pieces_of(world: OccupancyMap, tolerance_m: float = 0.0) -> Shapes:
    """Cover the occupied cells with convex shapely polygons ``[n]`` in grid metres.

    Without a tolerance they are the fewest rectangles that cover exactly these cells. With a tolerance, the
    outlines are simplified, with no point farther than that from the true outline (Douglas and Peucker 1973),
    and cut into convex pieces: a fifth as many for walls that run askew to the grid.
    """
    boxes = _boxes(world.occupied, world.resolution)
    if tolerance_m == 0.0:
        return boxes
    outlines = shapely.get_parts(shapely.simplify(shapely.union_all(boxes), tolerance_m))
    pieces = [piece for outline in outlines for piece in joined_triangles(outline)]
    return np.array([shapely.Polygon(piece) for piece in pieces], dtype=object)


def _boxes(occupied: Cells, resolution: float) -> Shapes:
    rectangles = rectangles_of(occupied)
    boxes: Shapes = shapely.box(
        resolution * rectangles.first_columns,
        resolution * rectangles.first_rows,
        resolution * rectangles.last_columns,
        resolution * rectangles.last_rows,
    )
    return boxes
