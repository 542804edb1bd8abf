"""What is occupied of a map as convex pieces: exact rectangles, or fewer polygons within a tolerance."""

from __future__ import annotations

import numpy as np
import shapely

from planners.maps.occupancy_map import Cells, OccupancyMap
from planners.maps.rectangles import rectangles_of
from planners.world.geometry.polygons import joined_triangles

Shapes = np.ndarray[tuple[int, ...], np.dtype[np.object_]]


def pieces_of(world: OccupancyMap, tolerance_m: float = 0.0) -> Shapes:
    """Convex shapely polygons ``[n]`` in grid metres that cover the occupied cells.

    Without tolerance the fewest rectangles, which cover exactly these. With one, the outlines are drawn with
    few corners, none of their points farther than it from the true outline (Douglas and Peucker 1973), then
    cut into convex pieces: for walls that run askew to the grid a fifth as many.
    """
    boxes = _boxes(world.occupied, world.resolution)
    if tolerance_m == 0.0:
        return boxes
    outlines = shapely.get_parts(shapely.simplify(shapely.union_all(boxes), tolerance_m))
    pieces = [piece for outline in outlines for piece in joined_triangles(outline)]
    return np.array([shapely.Polygon(piece) for piece in pieces], dtype=object)


def _boxes(occupied: Cells, resolution: float) -> Shapes:
    found = rectangles_of(occupied)
    boxes: Shapes = shapely.box(
        resolution * found.first_columns,
        resolution * found.first_rows,
        resolution * found.last_columns,
        resolution * found.last_rows,
    )
    return boxes
