"""A route: one feasible drive from a pose to a goal far away, made of local plans that a memory may know.

Depth first: from where the vehicle rests it turns to a local goal, the local problem there is solved, and it
brakes where the outlook is best, which need not be at the local goal. Where a local goal leads no further
another is tried, and then the place before.
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
from planners.routes.way_ahead import LocalGoal, Place, WayAhead
from planners.solve import Attempt
from planners.world.arrays import Floats
from planners.world.geometry.collision import box_is_free, count_free_prefix, scene_of
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

CANONICAL_TRIED: Final = 4  # local goals at the canonical distance, from one place
STOPS_TRIED: Final = 2  # places to brake at, of one plan
STOPS_APART_M: Final = 8.0
PROGRESS_M: Final = 3.0  # of the way to the goal, that a leg has to bring
ATTEMPTS: Final = 30  # local problems to solve before a route is given up, and ...
ATTEMPTS_A_METRE: Final = 0.1  # ... as many more
FACED: Final = 0.01  # radians: a final goal at the canonical distance may lie so far aside

Solve = Callable[[Problem], Attempt]


@dataclass(frozen=True, eq=False)
class Leg:
    """From rest to rest: turn, drive a local plan as far as it serves, brake."""

    begin: Floats  # [S] at rest
    end: Floats  # [S] at rest
    controls: Floats  # [n, 2]
    turning: int  # the first so many controls turn and roll
    driving: int  # so many follow the plan; the others brake
    attempt: Attempt  # how the local problem was solved
    problem: Problem  # in the canonical frame
    goal: Place  # local or final, metres

    def states(self, vehicle: Vehicle) -> Floats:
        """``[n + 1, S]``, from ``begin`` to ``end``."""
        return simulate(self.begin, self.controls, vehicle)

    @property
    def source(self) -> str:
        """``recalled``, ``repaired`` or ``searched``."""
        return self.attempt.source or ""


class Stuck(NamedTuple):
    """Why there is no route."""

    place: Place  # where; of a search the place nearest to the goal that was reached, metres
    why: str  # a clause that goes on after "at (x, y)"
    attempts: int  # local problems that were tried; 0: what was asked cannot be


@dataclass(frozen=True, eq=False)
class Route:
    """Legs from a start to the last of some goals."""

    problem: Problem  # the whole: start, last goal, everything that is occupied
    legs: list[Leg]
    paths: list[Floats]  # to each goal the shortest way over the cells, [n, 2] metres

    def plan(self, vehicle: Vehicle) -> Plan:
        """All legs as one plan."""
        controls = np.concatenate([np.empty((0, 2)), *(leg.controls for leg in self.legs)])
        return Plan(simulate(start_state(self.problem, vehicle), controls, vehicle), controls, vehicle.dt)


class Router:
    """Finds routes over one map for one vehicle; all lengths are canonical metres, in grid coordinates."""

    def __init__(
        self,
        world: OccupancyMap,
        recalled: Solve,
        searched: Solve,
        vehicle: Vehicle = CAR,
        tolerance_m: float = 0.0,
    ) -> None:
        """``recalled`` solves canonical problems, ``searched`` those whose goal may be nearer or aside."""
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

    def route(self, start: tuple[float, float, float], goals: list[Place]) -> Route | Stuck:
        """A route through all ``goals``, at rest in the disc around each."""
        whole = replace(self._whole, start=start, goal=goals[-1])
        state = start_state(whole, self._vehicle)
        if not is_free_drive(state[np.newaxis], self._vehicle, self._scene):
            return Stuck(start[:2], "the vehicle stands in an obstacle, or out of the map", 0)
        for x, y in goals:
            if not box_is_free(x, y, 1.0, 0.0, 0.0, 0.0, self._scene):
                return Stuck((x, y), "the goal is occupied, or out of the map", 0)
        legs: list[Leg] = []
        paths = []
        self._attempts = 0
        for goal in goals:
            ahead = WayAhead(self._paths, goal)
            path = ahead.path(state)
            if path is None:
                return Stuck(goal, "no way over the map leads to the goal", 0)
            more = self._legs_to(ahead, state)
            if isinstance(more, Stuck):
                return more
            legs += more
            paths.append(path)
            state = legs[-1].end if legs else state
        return Route(whole, legs, paths)

    def _legs_to(self, ahead: WayAhead, state: Floats) -> list[Leg] | Stuck:
        """The legs from a state to one goal, depth first."""
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

    def _legs_from(self, ahead: WayAhead, state: Floats) -> Iterator[Leg]:
        """Legs from a state at rest, best first, each found when it is asked for."""
        for goal in ahead.local_goals(state, CANONICAL_TRIED):
            if self._attempts == self._most_attempts:
                return
            legs = self._legs_towards(ahead, state, goal)
            if goal.final and not any(ahead.arrived(leg.end[np.newaxis])[0] for leg in legs):
                ahead.give_up(state)
            yield from legs

    def _legs_towards(self, ahead: WayAhead, state: Floats, goal: LocalGoal) -> list[Leg]:
        """Legs by the plan for one local goal, which differ in where they brake; none without a plan."""
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
        """Controls that turn to a canonical goal, and roll to the distance of the final one."""
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

        Facing a local goal, it is straight ahead at the canonical distance. The final goal is where it is.
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

    def _stops(self, ahead: WayAhead, driven: Floats, to_go: float) -> list[tuple[int, Floats]]:
        """The best places of a drive ``[T, S]`` to brake: after how many steps, and the controls that do it.

        Best is a place in the goal disc, nearest to its middle, then the best outlook.
        """
        free = count_free_prefix(driven, self._vehicle, self._scene)
        braked = [(steps, braking(driven[steps], self._vehicle)) for steps in range(1, free)]
        ways = [(steps, brake, simulate(driven[steps], brake, self._vehicle)) for steps, brake in braked]
        free_ways = [way for way in ways if is_free_drive(way[2], self._vehicle, self._scene)]
        if not free_ways:
            return []
        rests = np.array([states[-1] for _, _, states in free_ways])
        outlook = ahead.outlook(rests)
        further = (ahead.to_go(rests) <= to_go - PROGRESS_M) | ahead.arrived(rests)
        chosen: list[int] = []
        for i in np.argsort(outlook, kind="stable").tolist():
            apart = all(np.hypot(*(rests[i, :2] - rests[j, :2])) >= STOPS_APART_M for j in chosen)
            if further[i] and apart and len(chosen) < STOPS_TRIED and outlook[i] < math.inf:
                chosen.append(i)
        return [free_ways[i][:2] for i in chosen]
