"""Drives across a map, in a robot's own process; a map is prepared once, for as many as are asked for."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from motion_memory.answers import RouteAnswer
from motion_memory.array_problems import motion_given, numbers_given
from motion_memory.given_plans import current_plan
from planners.current_plan import is_near
from planners.maps.occupancy_map import OccupancyMap
from planners.routes.leg_search import Solve
from planners.routes.router import Router
from planners.routes.stuck import Stuck
from planners.world.alignment import scaled
from planners.world.arrays import Point, Pose
from planners.world.compiling import working_clock
from planners.world.problem import Plan
from planners.world.vehicles.vehicle import Vehicle
from storage.errors import ended
from storage.fields import short
from storage.vehicles.vehicle_files import scale_for_vehicle
from storage.worlds.limits import check_resolution, check_size
from tasks.requests.map_routes import (
    LocalSolver,
    canonical_map,
    check_can_stop,
    check_options,
    check_route,
    checked_motion,
    in_frame_of,
    in_grid_of,
    stops_over,
)
from tasks.settings.checks import check_time_limit, is_number
from tasks.settings.errors import UsageError


class MapRouter:
    """Finds drives across one map. One thread may use it at a time."""

    def __init__(
        self,
        world: OccupancyMap,
        solve: Solve,
        vehicle: Vehicle,
        *,
        scale: float | None = None,
        tolerance_m: float = 0.0,
        judged: bool = True,
        polished: bool = True,
        seed: int = 1,
    ) -> None:
        """Prepare a map, as ``Memory.router`` says.

        Args:
            world: the map.
            solve: attempts local problems in canonical metres.
            vehicle: the vehicle that drives.
            scale: metres of the map in a canonical one; None: the vehicle's.
            tolerance_m: metres by which outlines of occupied regions may move.
            judged: whether the judge looks at each plan.
            polished: whether drives are polished.
            seed: for the error that the judge raises.
        """
        _check_map(world)
        check_can_stop(vehicle)
        if not (is_number(tolerance_m) and tolerance_m >= 0.0):
            raise UsageError(f"tolerance_m is {short(tolerance_m)}; give metres, 0 or more.")
        self._world, self._scale = world, scale_for_vehicle(scale, vehicle)
        self._vehicle, self._judged, self._seed = vehicle, judged, seed
        self._solver = LocalSolver(solve, vehicle, self._scale, judged)
        canonical = canonical_map(world, self._scale, "The map")
        self._router = Router(canonical, self._solver, vehicle, tolerance_m / self._scale, polished)

    def route(
        self,
        start: Pose,
        goals: Sequence[Point | Pose],
        *,
        start_motion: Sequence[float] = (),
        goal_radius: float | None = None,
        goal_tolerance: tuple[float, float] | None = None,
        goal_hitches: Sequence[float] = (),
        time_limit: float | None = None,
        current: Plan | None = None,
    ) -> RouteAnswer:
        """Find a drive from a pose through all goals, at each of which it stops; or say where it is stuck.

        Args:
            start: x, y in metres of the map's frame, heading in radians.
            goals: in the order of the drive; each x, y: a place; or x, y, heading: a pose.
            start_motion: the entries of the start state after the pose, as for ``Memory.plan_arrays``.
            goal_radius: metres by which places may be missed; None: 2, times the scale.
            goal_tolerance: metres and radians by which poses may be missed; None: 0.1, times the scale, and
                0.05.
            goal_hitches: hitch angles in poses, rad, one for each trailer; none: as they come.
            time_limit: seconds, after which the search ends as stuck, and a polish with what it has; what is
                found by then depends on the machine. None: no limit.
            current: the plan that the robot drives now, as an earlier answer held it. What is left of it from
                the start through all goals is the answer unless another drive is quicker.

        Raises:
            ValueError: an argument is no such numbers, no goal takes it, or the vehicle cannot move or stand
                so.
            PlanFaultError: the independent judge refuses a plan.
        """
        scale = self._scale
        x, y, heading = _finite("start", start, "x, y, heading")
        tolerance = None
        if goal_tolerance is not None:
            tolerance = tuple(_finite("goal_tolerance", goal_tolerance, "metres, radians"))
        least = None if tolerance is None else min(tolerance)
        for name, value in (("goal_radius", goal_radius), ("goal_tolerance", least)):
            if value is not None and not (is_number(value) and value > 0.0):
                raise UsageError(f"{name} is {short(value)}; give numbers above 0, or leave it out.")
        hitches = motion_given("goal_hitches", goal_hitches, "angles, one for each trailer")
        asked = _goals(goals)
        try:
            stops = stops_over(self._world, asked, self._vehicle, scale, goal_radius, tolerance, hitches)
        except ValueError as error:
            raise UsageError(ended(f"The {error}")) from None
        for_poses = {"goal_tolerance": tolerance is not None, "goal_hitches": len(hitches) > 0}
        check_options(stops, for_poses, {"goal_radius": goal_radius is not None}, "a goal")
        motion = checked_motion(motion_given("start_motion", start_motion), self._vehicle, scale)
        x, y, heading = self._world.grid_pose(x, y, heading)
        begin = (x / scale, y / scale, heading)
        check_time_limit(time_limit, "time_limit")
        driven: Plan | None = None
        near: bool | None = None
        if current is not None:
            driven = self._in_grid(current)
            near = is_near(driven, self._router.state(begin, motion), self._vehicle)
        self._solver.seconds.clear()
        began = working_clock()
        route = self._router.route(begin, stops, motion, time_limit, driven)
        seconds = working_clock() - began
        if isinstance(route, Stuck):
            why = route.told(self._world, scale)
            return RouteAnswer("stuck", None, None, why, len(self._solver.seconds), seconds, (), near)
        plan = route.plan(self._vehicle)
        if self._judged:
            check_route(route, plan, self._vehicle, self._seed)
        answer = scaled(in_frame_of(self._world, plan, scale), scale)
        found = tuple((*each, self._vehicle) for each in route.new_attempts(scale))
        local_plans = len(self._solver.seconds)
        return RouteAnswer("solved", route.source, answer, None, local_plans, seconds, found, near)

    def _in_grid(self, current: Plan) -> Plan:
        """A plan in the map's frame, in canonical metres of its grid. Raises UsageError if it is none."""
        near = scaled(current_plan(current, self._vehicle), 1.0 / self._scale)
        return in_grid_of(self._world, near, self._scale)


def _finite(name: str, given: Sequence[float], *meanings: str) -> list[float]:
    """As many numbers as one of the ``meanings`` lists; a ValueError if they are others, or not finite."""
    numbers = numbers_given(name, given, *meanings)
    if not all(map(math.isfinite, numbers)):
        raise UsageError(f"{name} is {short(numbers)}; give finite numbers.")
    return numbers


def _check_map(world: OccupancyMap) -> None:
    """Raise UsageError unless a map is one."""
    if not isinstance(world, OccupancyMap):
        raise UsageError(f"The map is {short(world)}; give an OccupancyMap, such as read_map returns.")
    if not isinstance(world.name, str) or not world.name or not world.name.isprintable():
        raise UsageError(f"The map's name is {short(world.name)}; give a text of printable characters.")
    occupied = world.occupied
    is_grid = isinstance(occupied, np.ndarray) and occupied.dtype == np.bool_ and occupied.ndim == 2
    if is_grid and not occupied.size:
        raise UsageError(f"The map's occupied has no cells: its shape is {occupied.shape}.")
    if not is_grid:
        raise UsageError(
            "The map's occupied is no array [rows, columns] of bool; give one, row 0 the lowest: of a ROS "
            "OccupancyGrid's cells, (cells < 0) | (cells >= 50)."
        )
    if not is_number(world.resolution):
        raise UsageError(f"The map's resolution is {short(world.resolution)}; give metres a cell.")
    try:
        check_size(*occupied.shape)
        check_resolution(world.resolution)
    except ValueError as error:
        raise UsageError(ended(f"The map {error}")) from None
    _finite("origin of the map", world.origin, "x, y, turn")


def _goals(given: Sequence[Point | Pose]) -> list[list[float]]:
    """The goals. Raises ValueError unless they are some, each of two or three numbers."""
    if not isinstance(given, list | tuple | np.ndarray) or len(given) == 0:
        raise UsageError(f"goals is {short(given)}; give a list of one or more, each x, y or x, y, heading.")
    if not any(isinstance(goal, list | tuple | np.ndarray) for goal in given):
        raise UsageError(f"goals is {short(given)}; give a list of goals, such as [(x, y)].")
    return [_finite("each of goals", goal, "x, y", "x, y, heading") for goal in given]
