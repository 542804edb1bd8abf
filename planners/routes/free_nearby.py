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
FARTHER: Final = 0.5  # rings
BEARINGS: Final = 16


def free_nearby(state: Floats, vehicle: Vehicle, scene: Scene) -> Point | None:
    """Find the nearest of some places around a state ``[S]`` at which it would be free, turned as it is.

    Returns x and y (m) a little beyond it, so that they may be rounded; None if there is no such place within
    half the vehicle's width.
    """

    def moved(ring: float, bearing: int) -> Floats:
        metres, angle = REACH * vehicle.width * ring / RINGS, math.tau * bearing / BEARINGS
        there = state.copy()
        there[:2] += metres * math.cos(angle), metres * math.sin(angle)
        return there

    for ring, bearing in itertools.product(range(1, RINGS + 1), range(BEARINGS)):
        beyond = moved(ring + FARTHER, bearing)
        if all(is_free_drive(each[np.newaxis], vehicle, scene) for each in (moved(ring, bearing), beyond)):
            return float(beyond[0]), float(beyond[1])
    return None
