"""Where a vehicle would be free that is not quite: poses are measured, and so are walls."""

from __future__ import annotations

import itertools
import math
from typing import Final

import numpy as np

from planners.search.braking import is_free_drive
from planners.world.arrays import Floats, Point
from planners.world.geometry.collision import Scene
from planners.world.vehicles.vehicle import Vehicle

REACH: Final = 0.5  # of the vehicle's width: farther away it is another place
RINGS: Final = 20
BEARINGS: Final = 16


def free_nearby(state: Floats, vehicle: Vehicle, scene: Scene) -> Point | None:
    """Find the nearest of some places around a state ``[S]`` at which it would be free, turned as it is.

    Returns its x and y (m); None if there is none within half the vehicle's width.
    """
    for ring, bearing in itertools.product(range(1, RINGS + 1), range(BEARINGS)):
        metres, angle = REACH * vehicle.width * ring / RINGS, math.tau * bearing / BEARINGS
        moved = state.copy()
        moved[:2] += metres * math.cos(angle), metres * math.sin(angle)
        if is_free_drive(moved[np.newaxis], vehicle, scene):
            return float(moved[0]), float(moved[1])
    return None
