"""Whether no vehicle gets out of a goal pose, and so hardly any into it."""

from __future__ import annotations

from typing import Final

import numpy as np

from planners.search.manoeuvres.pose_tree import NODES, SIZE, PoseTree
from planners.world.arrays import Bounds, Floats
from planners.world.goal import HEADING_TOLERANCE, HITCHES, RADIUS
from planners.world.vehicles.vehicle import Vehicle, trailers_of

EXACT: Final = 0.1  # of a length, or radians: with larger tolerances another pose may be reachable


def is_closed(tree: PoseTree, goal: Floats, bounds: Bounds, vehicle: Vehicle) -> bool:
    """Whether all ways out of a goal end near it, if its ``tree`` has nothing left to open.

    Where a body came within the vehicle's length of the ``bounds``, there may be a way beyond them, and where
    large tolerances are asked for, or no hitch angles, out of a pose beside this one.

    Args:
        tree: the tree of ways out.
        goal: that of ``goal_of``.
        bounds: of the problem, metres.
        vehicle: what is to get there.
    """
    size, trailers = int(tree.counts[SIZE]), trailers_of(vehicle)
    length = vehicle.front + vehicle.rear
    is_exact = (
        goal[RADIUS] <= EXACT * length
        and goal[HEADING_TOLERANCE] <= EXACT
        and len(goal) == HITCHES + 2 * len(trailers)
    )
    if size == NODES or not is_exact:
        return False
    places, edges = tree.states[:size, :2], np.array(bounds)
    room = np.minimum(places.min(0) - edges[:2], edges[2:] - places.max(0)).min()
    return bool(room > length + sum(each.hitch_length + each.rear for each in trailers))
