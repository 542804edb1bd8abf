"""Makes local problems of a map: what surrounds a pose, moved into the canonical frame."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely
from scipy import sparse
from scipy.sparse import csgraph

from planners.maps.occupancy_map import OccupancyMap
from planners.maps.pieces import Shapes, pieces_of
from planners.world.arrays import Floats, Indices
from planners.world.problem import BOUNDS, CANONICAL_GOAL, CANONICAL_START, GOAL_RADIUS, Obstacles, Problem

WINDOW: Final = BOUNDS[2] - BOUNDS[0]  # canonical metres a side
SPECK: Final = 1e-6  # square metres: a window leaves out what it cuts smaller than this


@dataclass(frozen=True, eq=False)
class Surroundings:
    """A map's pieces and where they touch each other, in search trees, in grid metres."""

    pieces: Shapes  # [n] convex polygons, including four around the grid
    tree: shapely.STRtree  # of the pieces
    touching: Indices  # [m, 2] pairs of pieces
    contacts: shapely.STRtree  # of the intersections of these pairs
    scale: float  # metres a canonical metre

    def problem(self, x: float, y: float, heading: float, identity: str, class_name: str) -> Problem:
        """Make the canonical problem of a robot at a pose (grid coordinates), its goal straight ahead."""
        turn = heading - CANONICAL_START[2]
        along, across = self.scale * math.cos(turn), self.scale * math.sin(turn)
        to_map = np.array([[along, across], [-across, along]])
        window = shapely.transform(shapely.box(*BOUNDS), lambda points: points @ to_map + (x, y))
        near = np.sort(self.tree.query(window, predicate="intersects"))
        cut = self.pieces[near]
        shapely.prepare(window)
        across_border = ~shapely.covers(window, cut)
        cut[across_border] = shapely.intersection(cut[across_border], window)
        to_canonical = to_map.T / self.scale**2
        turned = shapely.transform(cut, lambda points: _rounded((points - (x, y)) @ to_canonical))
        touching = self.touching[self.contacts.query(window, predicate="intersects")]
        return Problem(
            identity,
            class_name,
            CANONICAL_START,
            CANONICAL_GOAL,
            GOAL_RADIUS,
            BOUNDS,
            _obstacles(shapely.convex_hull(turned), np.searchsorted(near, touching)),
            self.scale,
        )

    def obstacles(self) -> Obstacles:
        """Return all pieces in grid metres, exactly."""
        return _obstacles(self.pieces, self.touching)


def surroundings_of(world: OccupancyMap, scale: float = 1.0, tolerance_m: float = 0.0) -> Surroundings:
    """Prepare a map so that problems can be cut from it.

    Args:
        world: the map.
        scale: metres of the map in a canonical metre: 2 for a robot that is twice as long and wide.
        tolerance_m: how far the outlines of occupied regions may move.
    """
    width, height = world.size
    reach = math.sqrt(2.0) * WINDOW * scale  # no window reaches farther out of the map
    outside = shapely.box(
        [-reach, width, -reach, -reach],
        [-reach, -reach, -reach, height],
        [0.0, width + reach, width + reach, width + reach],
        [height + reach, height + reach, 0.0, height + reach],
    )
    pieces: Shapes = np.concatenate([pieces_of(world, tolerance_m), outside])
    tree = shapely.STRtree(pieces)
    pairs = tree.query(pieces, predicate="intersects").T
    touching = pairs[pairs[:, 0] < pairs[:, 1]]
    common: Shapes = np.asarray(shapely.intersection(*pieces[touching.T]))
    return Surroundings(pieces, tree, touching, shapely.STRtree(common), scale)


def _obstacles(pieces: Shapes, touching: Indices) -> Obstacles:
    """Make obstacles of the pieces with an area; pieces that touch, by pairs ``[m, 2]``, are one obstacle."""
    one, other = touching.T
    together = sparse.csr_array((np.ones(len(one)), (one, other)), shape=(len(pieces), len(pieces)))
    _, group = csgraph.connected_components(together, directed=False)
    solid = (shapely.get_type_id(pieces) == shapely.GeometryType.POLYGON) & (shapely.area(pieces) > SPECK)
    order = np.flatnonzero(solid)[np.argsort(group[solid], kind="stable")]
    rings = shapely.get_exterior_ring(shapely.orient_polygons(pieces[order]))
    corners = shapely.get_num_coordinates(rings) - 1  # the last repeats the first
    closed = np.cumsum(corners + 1) - 1
    return Obstacles(
        np.delete(shapely.get_coordinates(rings), closed, axis=0),
        np.concatenate([[0], np.cumsum(corners)]).astype(np.int32),
        np.append(np.unique(group[order], return_index=True)[1], len(order)).astype(np.int32),
    )


def _rounded(points: Floats) -> Floats:
    rounded: Floats = points.astype(np.float32).astype(np.float64)
    return rounded
