"""The signed distance to the nearest obstacle or bound, exact at the nodes of a grid, a cubic spline between.

It is positive in free space, and negative inside obstacles and beyond the bounds. The spline is twice
continuously differentiable, as an interior-point method needs it, but rounds off corners.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import casadi as ca
import numpy as np
import shapely
from scipy import ndimage

from planners.world.arrays import Floats, Point
from planners.world.jit import jit
from planners.world.problem import Problem
from planners.world.vehicles.bodies import footprints
from planners.world.vehicles.vehicle import Vehicle

CELL_M = 0.25  # half of a thin wall: the spline's error stays below what discs add to a footprint
PADDING_M = 2.0  # beyond the bounds, where a trajectory may be before it is feasible


class ClearanceField(NamedTuple):
    """A cubic spline over a grid of distances."""

    corner: Point  # of node (0, 0)
    cell_m: float
    distances: Floats  # [columns, rows] metres, at the nodes
    coefficients: Floats  # [columns, rows] of the spline's basis functions

    def symbolic(self) -> ca.Function:
        """Return a function from a ``point [2]`` to its signed distance, in metres."""
        point = ca.MX.sym("point", 2)
        knots = [
            (low + self.cell_m * (np.arange(count + 4) - 2)).tolist()
            for low, count in zip(self.corner, self.coefficients.shape, strict=True)
        ]
        spline = ca.bspline(point, ca.DM(self.coefficients.ravel(order="F")), knots, [3, 3], 1)
        return ca.Function("clearance", [point], [spline])


def clearance_field(problem: Problem, cell_m: float = CELL_M) -> ClearanceField:
    """Compute the clearance field of a problem on nodes ``cell_m`` metres apart."""
    x_min, y_min, x_max, y_max = problem.bounds
    xs, ys = (
        low - PADDING_M + cell_m * np.arange(math.ceil((high - low + 2.0 * PADDING_M) / cell_m) + 1.0)
        for low, high in ((x_min, x_max), (y_min, y_max))
    )
    distances = signed_distances(xs, ys, _outline(problem), np.array(problem.bounds))
    return ClearanceField(
        (float(xs[0]), float(ys[0])), cell_m, distances, ndimage.spline_filter(distances, 3, mode="mirror")
    )


def least_clearance(problem: Problem, states: Floats, vehicle: Vehicle) -> float:
    """Compute the exact least clearance, in metres, of the footprints at ``states [T, S]``."""
    corners = footprints(states, vehicle)
    bodies = shapely.polygons(corners.reshape(-1, *corners.shape[-2:]))
    around = shapely.union(_union(problem), shapely.box(*problem.bounds).exterior)
    return float(shapely.distance(bodies, around).min())


def _union(problem: Problem) -> shapely.Geometry:
    return shapely.union_all(np.array([shapely.Polygon(piece) for piece in problem.obstacles.pieces()]))


def _outline(problem: Problem) -> Floats:
    """Edges ``[E, 4]`` (x, y, next x, next y) of the union of all obstacles, without seams between pieces."""
    rings = [shapely.get_coordinates(ring) for ring in shapely.get_parts(shapely.boundary(_union(problem)))]
    edges = [np.hstack((ring[:-1], ring[1:])) for ring in rings]
    return np.concatenate(edges) if edges else np.empty((0, 4))


@jit
def signed_distances(xs: Floats, ys: Floats, edges: Floats, bounds: Floats) -> Floats:
    """Distances ``[len(xs), len(ys)]`` to closed outlines ``edges [E, 4]`` and the ``bounds [4]``, in metres.

    A point is inside if a ray from it crosses an odd number of edges.
    """
    distances = np.empty((xs.shape[0], ys.shape[0]))
    for i in range(xs.shape[0]):
        x = xs[i]
        for j in range(ys.shape[0]):
            y = ys[j]
            nearest = math.inf
            inside = False
            for e in range(edges.shape[0]):
                ax = edges[e, 0]
                ay = edges[e, 1]
                ex = edges[e, 2] - ax
                ey = edges[e, 3] - ay
                dx = x - ax
                dy = y - ay
                along = min(max((ex * dx + ey * dy) / (ex * ex + ey * ey), 0.0), 1.0)
                gap_x = dx - along * ex
                gap_y = dy - along * ey
                nearest = min(nearest, gap_x * gap_x + gap_y * gap_y)
                if (ay > y) != (edges[e, 3] > y) and x < ax + dy * ex / ey:
                    inside = not inside
            signed = -math.sqrt(nearest) if inside else math.sqrt(nearest)
            to_bounds = min(min(x - bounds[0], bounds[2] - x), min(y - bounds[1], bounds[3] - y))
            distances[i, j] = min(signed, to_bounds)
    return distances
