"""Leads a vehicle through doors that it hardly fits through, by way of a pose in each."""

from __future__ import annotations

import math
from typing import Final

from planners.maps.global_path import GlobalPaths
from planners.maps.occupancy_map import OccupancyMap
from planners.maps.widest_way import Gap, middle_of, narrowest_gap
from planners.routes.leg_search import LegSearch
from planners.routes.legs import Leg
from planners.routes.path_ahead import PathAhead, Stop
from planners.routes.stuck import NARROW, Stuck
from planners.world.arrays import Floats, Point
from planners.world.geometry.collision import Scene, point_is_free
from planners.world.problem import POSE_RADIUS, POSE_TOLERANCE, Arrival
from planners.world.vehicles.vehicle import Vehicle, trailers_of

DOORS: Final = 4  # one after another that a vehicle is led through, if it can be ...
DOOR_POSES: Final = 8  # ... with so many poses in all; local problems that may be tried, ...
ATTEMPTS_INTO: Final = 3  # ... beside those for each metre of the way, to get into one of them, ...
ATTEMPTS_ONWARD: Final = 10  # ... and to drive on from there


class Doors:
    """Doors of one map for one vehicle. Lengths are canonical metres in grid coordinates."""

    def __init__(
        self, world: OccupancyMap, paths: GlobalPaths, scene: Scene, search: LegSearch, vehicle: Vehicle
    ) -> None:
        """Prepare the map.

        Args:
            world: the map.
            paths: those over its cells.
            scene: what is occupied on it.
            search: finds the legs into doors and onward.
            vehicle: what is driven.
        """
        self._world, self._paths, self._scene = world, paths, scene
        self._search, self._vehicle = search, vehicle
        self.widest: Final = max(body.width for body in (vehicle, *trailers_of(vehicle)))  # metres
        self._poses_left = 0

    def legs_through(self, ahead: PathAhead, state: Floats) -> list[Leg] | Stuck | None:
        """Search the legs to a stop by way of a pose in the narrowest gap before it, and so on behind that.

        A vehicle that is nearly as wide as a door has to be parked in it: that is a pose like one in a slot.

        Args:
            ahead: the paths to the stop.
            state: ``[S]`` from which to drive.

        Returns:
            The legs; None if there are none, or why it is hopeless.
        """
        self._poses_left = DOOR_POSES
        return self._through_next(ahead, state, (float(state[0]), float(state[1])), ())

    def at_a_gap(self, stuck: Stuck, start: Point, goal: Point) -> Stuck:
        """Say of a search that is stuck where the widest way ahead is narrow, if it is."""
        return stuck._replace(gap=self._narrow_gap(start, goal), width=self.widest)

    def _through_next(
        self, ahead: PathAhead, state: Floats, place: Point, passed: tuple[Point, ...]
    ) -> list[Leg] | Stuck | None:
        """As ``legs_through``, from a place behind the doors that the vehicle has ``passed``."""
        gap = self._narrow_gap(place, ahead.stop.place) if len(passed) < DOORS else None
        if gap is None or gap.place in passed:
            return None
        pose = middle_of(gap, self._world)
        if pose is None:
            return None
        x, y, through = pose
        length = self._vehicle.front + self._vehicle.rear
        behind = x + length * math.cos(through), y + length * math.sin(through)
        off = 0.5 * (self._vehicle.front - self._vehicle.rear)  # of the middle, ahead of the reference point
        straight = (0.0,) * len(trailers_of(self._vehicle))
        tolerances = (POSE_TOLERANCE,) * len(straight)
        reverses = self._vehicle.min_speed < 0.0
        for heading in (through, through + math.pi)[: 1 + reverses]:
            if self._search.time_is_up() or self._poses_left == 0:
                break
            place = x - off * math.cos(heading), y - off * math.sin(heading)
            if not point_is_free(*place, self._scene):
                continue
            self._poses_left -= 1
            arrival = Arrival(heading, POSE_TOLERANCE, 0.0, 0.0, straight, tolerances)
            parked = Stop(place, POSE_RADIUS, arrival)
            into = self._search.legs_to(
                PathAhead(self._paths, parked, self._scene, state, briefly=True), state, ATTEMPTS_INTO
            )
            if isinstance(into, Stuck) or not into:
                continue
            inside = into[-1].end
            onward: list[Leg] | Stuck | None = self._search.legs_to(ahead, inside, ATTEMPTS_ONWARD)
            if isinstance(onward, Stuck) and not onward.is_enclosed:
                onward = self._through_next(ahead, inside, behind, (*passed, gap.place))
            if onward is not None:
                return onward if isinstance(onward, Stuck) else into + onward
        return None

    def _narrow_gap(self, start: Point, goal: Point) -> Gap | None:
        """Where the widest way is narrowest, if the vehicle hardly fits through there."""
        return narrowest_gap(self._world, start, goal, NARROW * self.widest)
