"""Finds routes: drives from a state through some stops, along the shortest path or else by other ways."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Final

import numpy as np
from scipy import ndimage

from planners.maps.global_path import GlobalPaths, length_of, passable
from planners.maps.occupancy_map import OccupancyMap
from planners.maps.surroundings import surroundings_of
from planners.routes.doors import Doors
from planners.routes.free_nearby import free_nearby
from planners.routes.kept_route import kept_route
from planners.routes.leg_search import LATE, LegSearch, Solve
from planners.routes.legs import Leg, polished_legs
from planners.routes.path_ahead import PathAhead, Stop
from planners.routes.route import Route
from planners.routes.stuck import Stuck
from planners.search.braking import is_free_drive
from planners.search.free_goal import lacks_room, unfolded
from planners.world.arrays import Floats, Pose
from planners.world.compiling import working_clock
from planners.world.driving_cost import cost_of
from planners.world.geometry.collision import note_free, point_is_free, scene_of
from planners.world.problem import (
    CANONICAL_START,
    GOAL_RADIUS,
    Plan,
    Problem,
    start_state,
    starting_at,
)
from planners.world.vehicles.bodies import body_count, swept_boxes
from planners.world.vehicles.vehicle import CAR, Trailer, Vehicle, trailers_of
from planners.world.workspace import Workspace

CELL_M: Final = 1.0  # width of the cells of paths, at most, if those of the map are no wider
WIDER: Final = (1.2, 1.6)  # times the vehicle's width: gaps of the ways that are tried next ...
DETOUR_M: Final = 1.0  # ... if they are so much longer; at last ...
ROOMY_M: Final = 1.0  # ... a way that keeps so much more away from obstacles
FOR_SEARCH: Final = 0.25  # share of the time, at least, where what is left of a plan has to be mended
OF_OUTLINE: Final = 0.9  # of its width: with an outline a body may fit through gaps narrower than its box


class Router:
    """Finds routes over one map for one vehicle. Lengths are canonical metres in grid coordinates."""

    def __init__(
        self,
        world: OccupancyMap,
        solve: Solve,
        vehicle: Vehicle = CAR,
        tolerance_m: float = 0.0,
        polishes: bool = True,
    ) -> None:
        """Prepare the map.

        Args:
            world: the map.
            solve: solves local problems, from any motion to a place or a pose.
            vehicle: what is to be driven.
            tolerance_m: how far the outlines of occupied regions may move.
            polishes: whether the drive to each stop is polished as a whole.
        """
        self._world, self._vehicle, self._polishes = world, vehicle, polishes
        self._workspace = Workspace()
        self._surroundings = surroundings_of(world, 1.0, tolerance_m)
        bounds = (0.0, 0.0, *world.size)
        occupied = self._surroundings.obstacles()
        self._whole = Problem(
            world.name, world.name, CANONICAL_START, (0.0, 0.0), GOAL_RADIUS, bounds, occupied
        )
        self._scene = scene_of(self._whole)
        bodies = vehicle, *trailers_of(vehicle)
        fits = max(_disc_inside(body) for body in bodies)
        self._paths = passable(world, fits - 2.0 * tolerance_m, CELL_M)
        self._search = LegSearch(self._surroundings, self._scene, solve, vehicle, world.name)
        self._doors = Doors(world, self._paths, self._scene, self._search, vehicle)
        widest = self._doors.widest
        self._wider = [cache(partial(passable, world, more * widest, CELL_M)) for more in WIDER]
        self._wider.append(cache(self._roomy_paths))

    def route(
        self,
        start: Pose,
        stops: Sequence[Stop],
        motion: tuple[float, ...] = (),
        time_limit: float | None = None,
        current: Plan | None = None,
    ) -> Route | Stuck:
        """Find a route from a pose (m, m, rad) through all ``stops``.

        Args:
            start: where the drive begins.
            stops: where the vehicle is to come to rest, in this order.
            motion: the state at the start behind the pose, speed (m/s) first; what is missing is 0.
            time_limit: seconds, after which the search ends, and the polish with what it has; what is found
                by then depends on the machine. None: no limit.
            current: the plan that is being driven; what is left of it is the route if none that costs less is
                found.
        """
        until = math.inf if time_limit is None else working_clock() + time_limit
        refused = self.refusal(start, stops, motion)
        problems, state = self._problems(start, stops, motion), self.state(start, motion)
        kept = None
        if current is not None:
            around = self._vehicle, self._scene, self._workspace
            most = math.inf if time_limit is None else until - FOR_SEARCH * time_limit
            kept_until = most if refused is None else -math.inf
            kept = kept_route(current, problems, around, self._polishes, kept_until)
        if refused is not None:  # a robot that drives may be within the margins of what it passes
            return kept or refused
        found = self._searched(problems, stops, state, until)
        if kept is None or (isinstance(found, Route) and self._cost(found) < self._cost(kept)):
            return found
        return kept

    def _cost(self, route: Route) -> float:
        return cost_of(route.plan(self._vehicle), self._vehicle)

    def _searched(
        self, problems: list[Problem], stops: Sequence[Stop], state: Floats, until: float
    ) -> Route | Stuck:
        """Search a route from a ``state [S]`` through all ``stops``."""
        problems = list(problems)
        sections: list[list[Leg]] = []
        paths = []
        self._search.begin(until)
        for number, stop in enumerate(stops):
            ahead, path = self._first_way(stop, state)
            goal = _goal_name(number, stops)
            if path is None:
                why = f"{goal} cannot be reached: no way that is wide enough leads there"
                return self._doors.at_a_gap(
                    Stuck(stop.place, why, 0), (float(state[0]), float(state[1])), stop.place
                )
            problems[number] = starting_at(problems[number], state)
            more = self._search.legs_to(ahead, state)
            if isinstance(more, Stuck):
                more = self._by_other_ways(more, ahead, path, state)
            if isinstance(more, Stuck):
                more = more._replace(
                    why=more.why.replace("the goal", goal), attempts=max(self._search.attempts, 1)
                )
                if more.is_late or more.to_go is None:
                    return more
                return self._doors.at_a_gap(more, more.place, stop.place)
            if self._polishes:
                driven = self._vehicle, self._scene, self._workspace
                more = polished_legs(problems[number], more, *driven, until - working_clock())
            sections.append(more)
            paths.append(np.vstack((problems[number].start[:2], path[1:], stop.place)))
            state = more[-1].end if more else state
        return Route(problems, sections, paths)

    def _first_way(self, stop: Stop, state: Floats) -> tuple[PathAhead, Floats | None]:
        """The paths to a stop that are tried first, and the one ``[n, 2]`` from a state ``[S]``, if there is.

        They are the shortest, but for trains those with a little more room, if they are hardly longer: around
        a corner trailers come nearer to it than the vehicle that pulls them.
        """
        ahead = PathAhead(self._paths, stop, self._scene, state)
        path = ahead.path(state)
        if path is not None and trailers_of(self._vehicle):
            roomier = PathAhead(self._wider[0](), stop, self._scene, state)
            other = roomier.path(state)
            if other is not None and length_of(other) <= length_of(path) + DETOUR_M:
                return roomier, other
        return ahead, path

    def refusal(self, start: Pose, stops: Sequence[Stop], motion: tuple[float, ...] = ()) -> Stuck | None:
        """Why start or goals cannot be used, if so; arguments as of ``route``."""
        state = self.state(start, motion)
        if not is_free_drive(state[np.newaxis], self._vehicle, self._scene):
            body = self._blocked_body(state)
            where = (
                "in an obstacle or across the map's edge"
                if self._world.holds(*start[:2])
                else "outside the map"
            )
            free = free_nearby(state, self._vehicle, self._scene)
            return Stuck(start[:2], f"{body} would stand {where}", 0, free=free)
        for number, (stop, to_stop) in enumerate(
            zip(stops, self._problems(start, stops, motion), strict=True)
        ):
            goal = _goal_name(number, stops)
            if not point_is_free(*stop.place, self._scene):
                where = "in an obstacle" if self._world.holds(*stop.place) else "outside the map"
                return Stuck(stop.place, f"{goal} lies {where}", 0)
            if lacks_room(to_stop, self._vehicle, self._scene):
                last = unfolded(to_stop, self._vehicle)
                body = self._blocked_body(last)
                pose = f"the pose of {goal}" if len(stops) > 1 else "the goal pose"
                free = None if last is None else free_nearby(last, self._vehicle, self._scene)
                return Stuck(stop.place, f"{body} has no room in {pose}", 0, free=free)
        return None

    def _begun(self, start: Pose, motion: tuple[float, ...]) -> Problem:
        return replace(self._whole, start=start, start_motion=motion)

    def state(self, start: Pose, motion: tuple[float, ...]) -> Floats:
        """The state ``[S]`` at the start; arguments as of ``route``."""
        return start_state(self._begun(start, motion), self._vehicle)

    def _problems(self, start: Pose, stops: Sequence[Stop], motion: tuple[float, ...]) -> list[Problem]:
        """For each stop the problem of driving there from the start."""
        begun = self._begun(start, motion)
        return [
            replace(begun, goal=stop.place, goal_radius=stop.radius, arrival=stop.arrival) for stop in stops
        ]

    def _roomy_paths(self) -> GlobalPaths:
        grid = self._paths.grid
        wider = ndimage.binary_dilation(grid.occupied, iterations=max(1, round(ROOMY_M / grid.resolution)))
        return GlobalPaths(replace(grid, occupied=wider), self._paths.spots, self._paths.rooms)

    def _by_other_ways(
        self, stuck: Stuck, ahead: PathAhead, path: Floats, state: Floats
    ) -> list[Leg] | Stuck:
        """Search the legs to a stop where a search along the shortest ``path [n, 2]`` got ``stuck``."""
        if stuck.is_enclosed or stuck.is_late:
            return stuck
        legs = None
        if stuck.to_go is not None and not self._search.time_is_up():
            legs = self._doors.legs_through(ahead, state)
        legs = legs or self._legs_around(path, ahead.stop, state)
        if legs is None and stuck.to_go is not None and self._search.is_late:
            return stuck._replace(why=LATE, is_late=True)
        return legs or stuck

    def _legs_around(self, path: Floats, stop: Stop, state: Floats) -> list[Leg] | Stuck | None:
        """Search the legs to a stop along ways with more room than a ``path [n, 2]`` that was in vain.

        Returns None if there are none, or why it is hopeless.
        """
        metres = length_of(path)
        for wider in self._wider:
            if self._search.time_is_up():
                break
            around = PathAhead(wider(), stop, self._scene, state)
            other = around.path(state)
            if other is None:
                continue
            if wider is self._wider[-1] or length_of(other) > metres + DETOUR_M:
                legs = self._search.legs_to(around, state)
                if not isinstance(legs, Stuck) or legs.is_enclosed:
                    return legs
                metres = length_of(other)
        return None

    def _blocked_body(self, state: Floats | None) -> str:
        """What is not free in a state ``[S]``: the vehicle, or if that is free a trailer."""
        bodies = body_count(self._vehicle)
        free = np.ones(bodies, bool)
        if state is not None:
            note_free(swept_boxes(state[np.newaxis], self._vehicle), self._scene, free)
        if free.all() or not free[0]:
            return "the vehicle"
        return f"trailer {int(free.argmin())}" if bodies > 2 else "the trailer"


def _goal_name(number: int, stops: Sequence[Stop]) -> str:
    return f"goal {number + 1}" if len(stops) > 1 else "the goal"


def _disc_inside(body: Vehicle | Trailer) -> float:
    """The width in metres of a disc that surely lies inside a body; it gets through gaps about as wide."""
    return min(body.width, body.front + body.rear) * (OF_OUTLINE if body.about.outline else 1.0)
