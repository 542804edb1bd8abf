"""Finds a route: one feasible drive to a distant goal, made of local plans that need not end at rest.

The horizon recedes: from the state in which it drives, the vehicle plans to a local goal on the shortest
path, drives a part of that plan, and plans on from the state that it then has. It changes from one plan to
the next only where it could also brake. The search is depth first. If no plan leads on from a state, the
change is made earlier, then another local goal is tried, then the vehicle stops; then the search goes back by
a leg.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Final, NamedTuple

import numpy as np
from scipy import ndimage

from planners.attempt import Attempt
from planners.maps.global_path import GlobalPaths, length_of, passable
from planners.maps.occupancy_map import OccupancyMap
from planners.maps.surroundings import surroundings_of
from planners.maps.widest_way import middle_of, narrowest_gap
from planners.routes.legs import Leg, polished_legs, stricter
from planners.routes.path_ahead import LocalGoal, PathAhead, Stop
from planners.routes.route import Route
from planners.routes.stuck import NARROW, Stuck
from planners.search.braking import free_stop, is_free_drive
from planners.search.free_goal import lacks_room, unfolded
from planners.search.query import Limits, usual_limits
from planners.world.alignment import to_canonical
from planners.world.arrays import Floats, Point, Pose
from planners.world.geometry.collision import count_free_prefix, note_free, point_is_free, scene_of
from planners.world.problem import (
    CANONICAL_DISTANCE,
    CANONICAL_START,
    GOAL_RADIUS,
    POSE_RADIUS,
    POSE_TOLERANCE,
    Arrival,
    Problem,
    start_state,
)
from planners.world.vehicles.bodies import body_count, swept_boxes
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR, DifferentialDrive, Trailer, Vehicle, trailers_of
from planners.world.workspace import Workspace

SHARES: Final = (2.0 / 3.0, 1.0 / 3.0)  # of a plan, after which the next begins, in the order of trial
PROGRESS_M: Final = 3.0  # by which a leg must shorten the path to the goal
CELL_M: Final = 1.0  # width of the cells of paths, at most, if those of the map are no wider
WIDER: Final = (1.2, 1.6)  # times the vehicle's width: gaps of the ways that are tried next ...
DETOUR_M: Final = 1.0  # ... if they are so much longer; at last ...
ROOMY_M: Final = 1.0  # ... a way that keeps so much more away from obstacles
OF_OUTLINE: Final = 0.9  # of its width: who does not fill a box may get through what is narrower
ATTEMPTS: Final = 30  # local problems to solve before a route is given up, and ...
ATTEMPTS_A_METRE: Final = 0.1  # ... so many more for each metre to the goal
RESTING: Final = 1e-8  # m/s and radians: what sums of controls round away, and no more
ARRIVED_M: Final = 1e6  # so much better than any other stop is one in the goal disc
DOORS: Final = 4  # one after another that a vehicle is led through by a pose in each
POSE_TRIES: Final = 8  # of states from which a pose is asked for: more take long, and seldom help

BRIEFLY: Final = Limits(expansions=8_000)

Solve = Callable[[Problem, Limits], Attempt]


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
            solve: solves local problems, from any motion to a place.
            vehicle: what is to be driven.
            tolerance_m: how far the outlines of occupied regions may move.
            polishes: whether the drive to each stop is polished as a whole.
        """
        self._world, self._vehicle, self._polishes = world, vehicle, polishes
        self._workspace = Workspace()
        self._solve = solve
        self._surroundings = surroundings_of(world, 1.0, tolerance_m)
        bounds = (0.0, 0.0, *world.size)
        occupied = self._surroundings.obstacles()
        self._whole = Problem(
            world.name, world.name, CANONICAL_START, (0.0, 0.0), GOAL_RADIUS, bounds, occupied
        )
        self._scene = scene_of(self._whole)
        bodies = vehicle, *trailers_of(vehicle)
        self._widest = max(body.width for body in bodies)
        fits = max(_disc_inside(body) for body in bodies)
        self._paths = passable(world, fits - 2.0 * tolerance_m, CELL_M)
        self._wider = [cache(partial(passable, world, more * self._widest, CELL_M)) for more in WIDER]
        self._wider.append(cache(self._roomy_paths))
        self._attempts = self._most_attempts = self._pose_tries = 0

    def route(self, start: Pose, stops: Sequence[Stop], motion: tuple[float, ...] = ()) -> Route | Stuck:
        """Find a route from a pose (m, m, rad) through all ``stops``.

        Args:
            start: where the drive begins.
            stops: where the vehicle is to come to rest, in this order.
            motion: the state at the start behind the pose, speed (m/s) first; what is missing is 0.
        """
        begun = replace(self._whole, start=start, start_motion=motion)
        problems = [
            replace(begun, goal=stop.place, goal_radius=stop.radius, arrival=stop.arrival) for stop in stops
        ]
        state = start_state(begun, self._vehicle)
        if not is_free_drive(state[np.newaxis], self._vehicle, self._scene):
            who = self._blocked_body(state)
            return Stuck(start[:2], f"{who} would stand in an obstacle or outside the map", 0)
        for stop, to_stop in zip(stops, problems, strict=True):
            if not point_is_free(*stop.place, self._scene):
                return Stuck(stop.place, "the goal lies in an obstacle or outside the map", 0)
            if lacks_room(to_stop, self._vehicle, self._scene):
                who = self._blocked_body(unfolded(to_stop, self._vehicle))
                return Stuck(stop.place, f"{who} has no room in the goal pose", 0)
        sections: list[list[Leg]] = []
        paths = []
        self._attempts = 0
        for number, stop in enumerate(stops):
            ahead = PathAhead(self._paths, stop, self._scene, state)
            path = ahead.path(state)
            goal = f"goal {number + 1}" if len(stops) > 1 else "the goal"
            if path is None:
                why = f"{goal} cannot be reached: no way that is wide enough leads there"
                return self._at_a_gap(
                    Stuck(stop.place, why, 0), (float(state[0]), float(state[1])), stop.place
                )
            pose, moving = tuple(state[:3].tolist()), tuple(state[3:].tolist())
            problems[number] = replace(problems[number], start=pose, start_motion=moving)
            more = self._legs_to(ahead, state)
            if isinstance(more, Stuck):
                through = None if more.to_go is None else self._legs_through(stop, state, DOORS)
                again = through or self._legs_around(path, stop, state)
                if again is None:
                    more = more._replace(why=more.why.replace("the goal", goal))
                    return more if more.to_go is None else self._at_a_gap(more, more.place, stop.place)
                more = again
            if self._polishes:
                more = polished_legs(problems[number], more, self._vehicle, self._scene, self._workspace)
            sections.append(more)
            paths.append(np.vstack((pose[:2], path[1:], stop.place)))
            state = more[-1].end if more else state
        return Route(problems, sections, paths)

    def _roomy_paths(self) -> GlobalPaths:
        grid = self._paths.grid
        wider = ndimage.binary_dilation(grid.occupied, iterations=max(1, round(ROOMY_M / grid.resolution)))
        return GlobalPaths(replace(grid, occupied=wider), self._paths.spots, self._paths.rooms)

    def _legs_through(self, stop: Stop, state: Floats, doors: int) -> list[Leg] | None:
        """Search the legs to a stop by way of a pose in the narrowest gap ahead, and so on if need be.

        A vehicle that is nearly as wide as a door has to be parked in it: that is a pose like one in a slot.
        """
        gap = narrowest_gap(self._world, (float(state[0]), float(state[1])), stop.place)
        pose = None if gap is None or gap.width > NARROW * self._widest else middle_of(gap, self._world)
        if pose is None or doors == 0:
            return None
        x, y, through = pose
        ahead = 0.5 * (self._vehicle.front - self._vehicle.rear)  # from the reference point to the middle
        straight = (0.0,) * len(trailers_of(self._vehicle))
        tolerances = (POSE_TOLERANCE,) * len(straight)
        for heading in (through, through + math.pi):
            place = x - ahead * math.cos(heading), y - ahead * math.sin(heading)
            arrival = Arrival(heading, POSE_TOLERANCE, 0.0, 0.0, straight, tolerances)
            parked = Stop(place, POSE_RADIUS, arrival)
            into = self._legs_to(PathAhead(self._paths, parked, self._scene, state, briefly=True), state)
            if isinstance(into, Stuck) or not into:
                continue
            inside = into[-1].end
            onward = self._legs_to(PathAhead(self._paths, stop, self._scene, inside), inside)
            if isinstance(onward, Stuck):
                again = self._legs_through(stop, inside, doors - 1)
                if again is None:
                    continue
                onward = again
            return into + onward
        return None

    def _legs_around(self, path: Floats, stop: Stop, state: Floats) -> list[Leg] | None:
        """Search the legs to a stop along ways with more room than a ``path [n, 2]`` that was in vain."""
        metres = length_of(path)
        for wider in self._wider:
            around = PathAhead(wider(), stop, self._scene, state)
            other = around.path(state)
            if other is None:
                continue
            if wider is self._wider[-1] or length_of(other) > metres + DETOUR_M:
                legs = self._legs_to(around, state)
                if not isinstance(legs, Stuck):
                    return legs
                metres = length_of(other)
        return None

    def _blocked_body(self, state: Floats | None) -> str:
        """Who is not free in a state ``[S]``: the vehicle, or if that is free a trailer."""
        bodies = body_count(self._vehicle)
        free = np.ones(bodies, bool)
        if state is not None:
            note_free(swept_boxes(state[np.newaxis], self._vehicle), self._scene, free)
        if free.all() or not free[0]:
            return "the vehicle"
        return f"trailer {int(free.argmin())}" if bodies > 2 else "the trailer"

    def _legs_to(self, ahead: PathAhead, state: Floats) -> list[Leg] | Stuck:
        """Search the legs from a state to rest at one stop, depth first."""
        legs: list[Leg] = []
        options = [self._legs_from(ahead, state)]
        begun, self._pose_tries = self._attempts, 0
        self._most_attempts = begun + ATTEMPTS + int(ATTEMPTS_A_METRE * ahead.to_go(state[np.newaxis])[0])
        start = nearest = state
        while not (ahead.arrived(state[np.newaxis])[0] and self._rests(state)):
            leg = next(options[-1], None)
            if leg is not None:
                legs.append(leg)
                options.append(self._legs_from(ahead, leg.end))
            else:
                options.pop()
                if not options:
                    return self._stuck(ahead, start, nearest, max(self._attempts - begun, 1))
                legs.pop()
            state = legs[-1].end if legs else start
            nearest = min(nearest, state, key=lambda each: ahead.to_go(each[np.newaxis])[0])
        return legs

    def _stuck(self, ahead: PathAhead, start: Floats, nearest: Floats, tried: int) -> Stuck:
        """Why no legs were found from ``start [S]``; the search came as far as ``nearest [S]``."""
        place = float(nearest[0]), float(nearest[1])
        if free_stop(start, self._vehicle, self._scene) is None:
            why = "the vehicle can neither stop in time nor drive on from its motion at the start"
            return Stuck(place, why, tried)
        why = "no plan leads on from where the search came nearest to the goal"
        return Stuck(place, why, tried, float(ahead.to_go(nearest[np.newaxis])[0]))

    def _at_a_gap(self, stuck: Stuck, start: Point, goal: Point) -> Stuck:
        """Say of a search that is stuck where the widest way ahead is narrow, if it is."""
        gap = narrowest_gap(self._world, start, goal)
        if gap is None or gap.width > NARROW * self._widest:
            return stuck
        return stuck._replace(gap=gap, width=self._widest)

    def _rests(self, state: Floats) -> bool:
        """Whether the vehicle stands, however its wheels are steered; of the first order it stops at once."""
        turns_on = isinstance(self._vehicle, DifferentialDrive) and not self._vehicle.first_order
        return bool(np.abs(state[3 : 4 + turns_on]).max() < RESTING)

    def _legs_from(self, ahead: PathAhead, state: Floats) -> Iterator[Leg]:
        """Yield legs from a state, each searched when needed: in motion first, unless it is the last."""
        for goal in ahead.local_goals(state):
            if self._attempts == self._most_attempts:
                break
            if goal.final and ahead.stop.is_pose and not goal.brief:
                if self._pose_tries == POSE_TRIES:
                    continue
                self._pose_tries += 1
            problem = self._problem(state, goal)
            self._attempts += 1
            attempt = self._solve(problem, BRIEFLY if goal.brief else usual_limits(problem))
            if attempt.plan is None:
                continue
            states = simulate(state, attempt.plan.controls, self._vehicle)
            drive = _Drive(states, attempt.plan.controls, attempt, problem, goal)
            if goal.final and ahead.stop.is_pose:
                yield from self._arrivals(ahead, drive)
                continue
            ends = [self._handovers(ahead, drive), self._stops(ahead, drive)]
            for legs in reversed(ends) if goal.final else ends:
                yield from legs

    def _problem(self, state: Floats, goal: LocalGoal) -> Problem:
        """The local problem, in the canonical frame: a window of the map around start and goal."""
        x, y, heading = state[:3].tolist()
        towards = math.atan2(goal.place[1] - y, goal.place[0] - x)
        distance = math.dist((x, y), goal.place)
        # metres from the window's start to the vehicle
        before = 0.5 * max(CANONICAL_DISTANCE - distance, 0.0)
        cos, sin = math.cos(towards), math.sin(towards)
        window = self._surroundings.problem(
            x - before * cos,
            y - before * sin,
            towards,
            f"{self._world.name}-route-{self._attempts}",
            self._world.name,
        )
        along = CANONICAL_START[2]
        place = before * math.cos(along), before * math.sin(along), along + heading - towards
        end = (before + distance) * math.cos(along), (before + distance) * math.sin(along)
        motion = np.where(np.abs(state[3:]) < RESTING, 0.0, state[3:])
        asked = replace(
            window,
            start=place,
            goal=end,
            goal_radius=goal.radius,
            start_motion=tuple(motion.tolist()),
            arrival=goal.arrival,
        )
        if goal.arrival is not None and goal.arrival.heading is not None:
            heading = along + goal.arrival.heading - towards
            asked = stricter(replace(asked, arrival=goal.arrival._replace(heading=heading)))
        return to_canonical(asked)[0]

    def _arrivals(self, ahead: PathAhead, drive: _Drive) -> Iterator[Leg]:
        """Yield a drive to a pose as a whole."""
        last = drive.states[-1]
        if is_free_drive(drive.states, self._vehicle, self._scene) and ahead.arrived(last[np.newaxis])[0]:
            yield drive.leg(len(drive.controls), np.empty((0, 2)), last)

    def _handovers(self, ahead: PathAhead, drive: _Drive) -> Iterator[Leg]:
        """Yield the parts of a drive after which the next plan may begin: there the vehicle could brake."""
        free = count_free_prefix(drive.states, self._vehicle, self._scene)
        to_go = ahead.to_go(drive.states)
        later = free
        for share in SHARES:
            for steps in range(min(int(share * (len(drive.states) - 1)), later - 1), 0, -1):
                if to_go[steps] > to_go[0] - PROGRESS_M:
                    continue
                if free_stop(drive.states[steps], self._vehicle, self._scene) is not None:
                    yield drive.leg(steps, np.empty((0, 2)), drive.states[steps])
                    later = steps
                    break

    def _stops(self, ahead: PathAhead, drive: _Drive) -> Iterator[Leg]:
        """Yield the part of a drive after which the vehicle brakes, in the goal disc if it can."""
        free = count_free_prefix(drive.states, self._vehicle, self._scene)
        stops = []
        for steps in range(1, free):
            stop = free_stop(drive.states[steps], self._vehicle, self._scene)
            if stop is not None:
                stops.append((steps, stop.controls, stop.states[-1]))
        if stops:
            rests = np.array([end for _, _, end in stops])
            arrived, to_go = ahead.arrived(rests), ahead.to_go(rests)
            best = int(np.where(arrived, ahead.distance(rests) - ARRIVED_M, to_go).argmin())
            if arrived[best] or to_go[best] <= ahead.to_go(drive.states[:1])[0] - PROGRESS_M:
                yield drive.leg(*stops[best])


def _disc_inside(body: Vehicle | Trailer) -> float:
    """How wide a disc is that surely lies inside a body, metres; about as wide as what it gets through."""
    return min(body.width, body.front + body.rear) * (OF_OUTLINE if body.about.outline else 1.0)


class _Drive(NamedTuple):
    """A local plan, driven over the map."""

    states: Floats  # [n + 1, S]
    controls: Floats  # [n, 2]
    attempt: Attempt
    problem: Problem
    goal: LocalGoal

    def leg(self, steps: int, brake: Floats, end: Floats) -> Leg:
        """The leg of so many steps of the plan, and then of controls ``brake [m, 2]``."""
        controls = np.concatenate([self.controls[:steps], brake])
        return Leg(self.states[0], end, controls, steps, self.attempt, self.problem, self.goal.place)
