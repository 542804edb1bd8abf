"""A route: one feasible drive from a pose to a distant goal, made of local plans that a memory may hold.

The search is depth first. From where it rests, the vehicle turns to a local goal, the local problem is
solved, and the vehicle brakes where the outlook is best, which need not be at the local goal. If a local goal
leads nowhere another is tried, and then the search goes back to the stop before.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from planners.maps.cutting import is_drivable
from planners.maps.global_path import GlobalPaths
from planners.maps.occupancy_map import OccupancyMap
from planners.maps.surroundings import surroundings_of
from planners.routes.manoeuvres import bearing, braking, is_free_drive, rolling, turn_towards
from planners.routes.path_ahead import LocalGoal, PathAhead
from planners.solve import Attempt
from planners.world.arrays import Floats, Point, Pose
from planners.world.geometry.collision import count_free_prefix, point_is_free, scene_of
from planners.world.problem import (
    CANONICAL_DISTANCE,
    CANONICAL_START,
    GOAL_RADIUS,
    Plan,
    Problem,
    start_state,
)
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR, Vehicle
from planners.world.workspace import Workspace

CANONICAL_TRIED: Final = 4  # local goals at the canonical distance to try from one stop
STOPS_TRIED: Final = 2  # points of a plan to try to stop at
STOPS_APART_M: Final = 8.0
PROGRESS_M: Final = 3.0  # by which a leg must shorten the path to the goal
ATTEMPTS: Final = 30  # local problems to solve before a route is given up, and ...
ATTEMPTS_A_METRE: Final = 0.1  # ... so many more for each metre to the goal
FACED: Final = 0.01  # radians by which a final goal at the canonical distance may lie aside

Solve = Callable[[Problem], Attempt]


@dataclass(frozen=True, eq=False)
class Leg:
    """A drive from rest to rest: turn, follow a local plan as far as it is of use, brake."""

    begin: Floats  # [S] at rest
    end: Floats  # [S] at rest
    controls: Floats  # [n, 2]
    turning: int  # how many controls turn and roll
    driving: int  # how many follow the plan; the others brake
    attempt: Attempt  # how the local problem was solved
    problem: Problem  # in the canonical frame
    goal: Point  # local or final, metres

    def states(self, vehicle: Vehicle) -> Floats:
        """Simulate the states ``[n + 1, S]`` from ``begin`` to ``end``."""
        return simulate(self.begin, self.controls, vehicle)

    @property
    def source(self) -> str:
        """``recalled``, ``repaired`` or ``searched``."""
        return self.attempt.source or ""


class Stuck(NamedTuple):
    """Why there is no route."""

    place: Point  # metres; after a search the stop that was nearest to the goal
    why: str  # a clause that follows "at (x, y)"
    attempts: int  # local problems that were tried; 0 if there was nothing to try


@dataclass(frozen=True, eq=False)
class Route:
    """Legs from a start to the last of some goals."""

    problem: Problem  # the whole one: start, last goal, everything that is occupied
    legs: list[Leg]
    paths: list[Floats]  # to each goal the shortest path over the cells, [n, 2] metres

    def plan(self, vehicle: Vehicle) -> Plan:
        """Join all legs to one plan."""
        controls = np.concatenate([np.empty((0, 2)), *(leg.controls for leg in self.legs)])
        return Plan(simulate(start_state(self.problem, vehicle), controls, vehicle), controls, vehicle.dt)


class Router:
    """Finds routes over one map for one vehicle. Lengths are canonical metres in grid coordinates."""

    def __init__(
        self,
        world: OccupancyMap,
        recalled: Solve,
        searched: Solve,
        vehicle: Vehicle = CAR,
        tolerance_m: float = 0.0,
    ) -> None:
        """Prepare the map.

        Args:
            world: the map.
            recalled: solves canonical problems.
            searched: solves problems whose goal may be nearer or aside.
            vehicle: what is to be driven.
            tolerance_m: how far the outlines of occupied regions may move.
        """
        self._name, self._vehicle = world.name, vehicle
        self._recalled, self._searched = recalled, searched
        self._surroundings = surroundings_of(world, 1.0, tolerance_m)
        bounds = (0.0, 0.0, *world.size)
        occupied = self._surroundings.obstacles()
        self._whole = Problem(
            world.name, world.name, CANONICAL_START, (0.0, 0.0), GOAL_RADIUS, bounds, occupied
        )
        self._scene = scene_of(self._whole)
        self._paths = GlobalPaths(world, 1.0)
        self._attempts = self._most_attempts = 0
        self._workspace = Workspace()

    def route(self, start: Pose, goals: list[Point]) -> Route | Stuck:
        """Find a route from a pose (m, m, rad) through all ``goals``, with a stop in the disc around each."""
        whole = replace(self._whole, start=start, goal=goals[-1])
        state = start_state(whole, self._vehicle)
        if not is_free_drive(state[np.newaxis], self._vehicle, self._scene):
            return Stuck(start[:2], "the vehicle stands in an obstacle, or out of the map", 0)
        for x, y in goals:
            if not point_is_free(x, y, self._scene):
                return Stuck((x, y), "the goal is occupied, or out of the map", 0)
        legs: list[Leg] = []
        paths = []
        self._attempts = 0
        for goal in goals:
            ahead = PathAhead(self._paths, goal)
            path = ahead.path(state)
            if path is None:
                return Stuck(goal, "no path over the map leads to the goal", 0)
            more = self._legs_to(ahead, state)
            if isinstance(more, Stuck):
                return more
            legs += more
            paths.append(path)
            state = legs[-1].end if legs else state
        return Route(whole, legs, paths)

    def _legs_to(self, ahead: PathAhead, state: Floats) -> list[Leg] | Stuck:
        """Search the legs from a state to one goal, depth first."""
        legs: list[Leg] = []
        options = [self._legs_from(ahead, state)]
        begun = self._attempts
        self._most_attempts = begun + ATTEMPTS + int(ATTEMPTS_A_METRE * ahead.to_go(state[np.newaxis])[0])
        nearest = state
        while not ahead.arrived(state[np.newaxis])[0]:
            leg = next(options[-1], None)
            if leg is not None:
                legs.append(leg)
                options.append(self._legs_from(ahead, leg.end))
            else:
                options.pop()
                if not options:
                    metres = ahead.to_go(nearest[np.newaxis])[0]
                    tried = self._attempts - begun
                    why = f"the route ends, {metres:.0f} m before the goal: none of the local goals tried"
                    return Stuck((float(nearest[0]), float(nearest[1])), why, max(tried, 1))
                legs.pop()
            state = legs[-1].end if legs else state
            nearest = min(nearest, state, key=lambda each: ahead.to_go(each[np.newaxis])[0])
        return legs

    def _legs_from(self, ahead: PathAhead, state: Floats) -> Iterator[Leg]:
        """Yield legs from a state at rest, best first, each searched when it is needed."""
        for goal in ahead.local_goals(state, CANONICAL_TRIED):
            if self._attempts == self._most_attempts:
                return
            legs = self._legs_towards(ahead, state, goal)
            if goal.final and not any(ahead.arrived(leg.end[np.newaxis])[0] for leg in legs):
                ahead.give_up(state)
            yield from legs

    def _legs_towards(self, ahead: PathAhead, state: Floats, goal: LocalGoal) -> list[Leg]:
        """Make legs of the plan for one local goal, with different stops; none if there is no plan."""
        turn = self._made_ready(state, goal)
        if turn is None:
            return []
        begin = simulate(state, turn, self._vehicle)[-1]
        problem = self._problem(begin, goal)
        if goal.canonical and not is_drivable(problem, self._vehicle, self._workspace):
            return []
        self._attempts += 1
        attempt = self._recalled(problem) if goal.canonical else self._searched(problem)
        if attempt.plan is None:
            return []
        driven = simulate(begin, attempt.plan.controls, self._vehicle)
        legs = []
        for steps, brake in self._stops(ahead, driven, float(ahead.to_go(state[np.newaxis])[0])):
            controls = np.concatenate([turn, attempt.plan.controls[:steps], brake])
            end = simulate(state, controls, self._vehicle)[-1]
            legs.append(Leg(state, end, controls, len(turn), steps, attempt, problem, goal.place))
        return legs

    def _made_ready(self, state: Floats, goal: LocalGoal) -> Floats | None:
        """The controls that turn to a canonical goal, and roll to the distance of the final one."""
        if not goal.canonical:
            return np.empty((0, 2))
        turn = turn_towards(state, goal.place, self._vehicle, self._scene)
        if turn is None or not goal.final:
            return turn
        facing = simulate(state, turn, self._vehicle)[-1]
        roll = rolling(math.dist(facing[:2], goal.place) - CANONICAL_DISTANCE, self._vehicle)
        free = is_free_drive(simulate(facing, roll, self._vehicle), self._vehicle, self._scene)
        return np.concatenate([turn, roll]) if free else None

    def _problem(self, state: Floats, goal: LocalGoal) -> Problem:
        """The local problem of a vehicle at rest, in the canonical frame.

        A canonical goal is straight ahead at the canonical distance. The final goal is where it is.
        """
        x, y, heading = state[:3].tolist()
        identity = f"{self._name}-route-{self._attempts}"
        if goal.canonical and not goal.final:
            return self._surroundings.problem(x, y, heading, identity, self._name)
        aside = bearing(state, goal.place)
        faced = abs(aside) < FACED  # then the window lies along the heading, else towards the goal
        turned = 0.0 if faced else aside
        distance = math.dist((x, y), goal.place)
        angle = CANONICAL_START[2] + (aside if faced else 0.0)
        return replace(
            self._surroundings.problem(x, y, heading + turned, identity, self._name),
            start=(0.0, 0.0, CANONICAL_START[2] - turned),
            goal=(distance * math.cos(angle), distance * math.sin(angle)),
        )

    def _stops(self, ahead: PathAhead, driven: Floats, to_go: float) -> list[tuple[int, Floats]]:
        """The best points of a drive ``[T, S]`` to stop at: after how many steps to brake, and the controls.

        A stop in the goal disc is best, the nearer to its centre the better; then the outlook counts.
        """
        free = count_free_prefix(driven, self._vehicle, self._scene)
        braked = [(steps, braking(driven[steps], self._vehicle)) for steps in range(1, free)]
        stops = [(steps, brake, simulate(driven[steps], brake, self._vehicle)) for steps, brake in braked]
        stops = [stop for stop in stops if is_free_drive(stop[2], self._vehicle, self._scene)]
        if not stops:
            return []
        rests = np.array([states[-1] for _, _, states in stops])
        outlook = ahead.outlook(rests)
        further = (ahead.to_go(rests) <= to_go - PROGRESS_M) | ahead.arrived(rests)
        chosen: list[int] = []
        for i in np.argsort(outlook, kind="stable").tolist():
            apart = all(np.hypot(*(rests[i, :2] - rests[j, :2])) >= STOPS_APART_M for j in chosen)
            if further[i] and apart and len(chosen) < STOPS_TRIED and outlook[i] < math.inf:
                chosen.append(i)
        return [stops[i][:2] for i in chosen]
