"""Which questions a search for manoeuvres suits, and what is hard about them: tight goals, trains."""

from __future__ import annotations

from typing import Final

import numpy as np

from planners.search.manoeuvres.outward import room_around
from planners.search.manoeuvres.pose_tree import pose_of
from planners.search.manoeuvres.variants import at_its_slowest, time_reversed
from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene
from planners.world.goal import HEADING_TOLERANCE, LEAST_SPEED, MOST_SPEED
from planners.world.vehicles.vehicle import Vehicle, state_size, trailers_of

TIGHT: Final = 0.6  # a goal with less room around it is tight


def suits(goal: Floats, vehicle: Vehicle) -> bool:
    """Whether a goal, that of ``goal_of``, may be reached by manoeuvres: a pose, at rest.

    A vehicle that cannot stand has to change speed and turn at once, and may arrive at any speed asked for.
    """
    if vehicle.min_speed > 0.0 and not vehicle.first_order:
        return False
    slowest = max(vehicle.min_speed, 0.0)
    return bool(
        goal[HEADING_TOLERANCE] < np.inf
        and goal[LEAST_SPEED] <= at_its_slowest(vehicle).max_speed
        and goal[MOST_SPEED] >= slowest
        and (slowest > 0.0 or goal[LEAST_SPEED] <= 0.0)
    )


def is_tight(goal: Floats, vehicle: Vehicle, scene: Scene) -> bool:
    """Whether there is so little room around a goal that suits that other searches have small hopes.

    A vehicle that cannot stand has no room to try again.
    """
    root = pose_of(goal, state_size(vehicle))[np.newaxis]
    return bool(vehicle.min_speed > 0.0 or room_around(root, time_reversed(vehicle), vehicle, scene) < TIGHT)


def meets(start: Floats, vehicle: Vehicle) -> bool:
    """Whether a tree grows out of a start ``[S]`` too: what is hard from one end is easy from the other.

    With trailers it does, if the vehicle stands, or can at once.
    """
    return bool(trailers_of(vehicle)) and bool(vehicle.first_order or start[3] == 0.0)
