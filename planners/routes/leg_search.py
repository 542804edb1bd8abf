"""The search for the legs of a drive to one stop: local plans that need not end at rest.

The horizon recedes: from the state in which it drives, the vehicle plans to a local goal on the shortest
path, drives a part of that plan, and plans on from the state that it then has. It changes from one plan to
the next only where it could also brake. The search is depth first. If no plan leads on from a state, the
change is made earlier, then another local goal is tried, then the vehicle stops; then the search goes back by
a leg.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from planners.attempt import Attempt
from planners.maps.surroundings import Surroundings
from planners.routes.legs import Leg, stricter
from planners.routes.path_ahead import LocalGoal, PathAhead
from planners.routes.stuck import Stuck
from planners.search.braking import free_stop, is_free_drive
from planners.search.outcome import MEANINGS, Status
from planners.search.query import Limits, usual_limits
from planners.world.alignment import to_canonical
from planners.world.arrays import Floats
from planners.world.compiling import working_clock
from planners.world.geometry.collision import Scene, count_free_prefix
from planners.world.problem import CANONICAL_DISTANCE, CANONICAL_START, Problem
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import DifferentialDrive, Vehicle

SHARES: Final = (2.0 / 3.0, 1.0 / 3.0)  # of a plan, after which the next begins, in the order of trial
PROGRESS_M: Final = 3.0  # by which a leg must shorten the path to the goal
ATTEMPTS: Final = 30  # local problems to solve before a route is given up, and ...
ATTEMPTS_A_METRE: Final = 0.1  # ... so many more for each metre to the goal
RESTING: Final = 1e-8  # m/s and radians: what sums of controls round away, and no more
ARRIVED_M: Final = 1e6  # a stop in the goal disc is so much better than any other
POSE_TRIES: Final = 8  # of states from which a pose is asked for: more take long, and seldom help
BRIEFLY: Final = Limits(expansions=8_000)
VERY_BRIEFLY: Final = Limits(expansions=3_000)  # into a door, where there mostly are others
LATE: Final = "the limit of time ended the search where it was nearest to the goal"

Solve = Callable[[Problem, Limits], Attempt]


class LegSearch:
    """Searches legs over one map for one vehicle. Lengths are canonical metres in grid coordinates."""

    def __init__(
        self, surroundings: Surroundings, scene: Scene, solve: Solve, vehicle: Vehicle, name: str
    ) -> None:
        """Prepare the search.

        Args:
            surroundings: what is occupied on the map.
            scene: the same, ready for collision checks.
            solve: solves local problems, from any motion to a place or a pose.
            vehicle: what is to be driven.
            name: of the map.
        """
        self._surroundings, self._scene = surroundings, scene
        self._solve, self._vehicle, self._name = solve, vehicle, name
        self.begin()

    def begin(self, until: float = math.inf) -> None:
        """Begin another route: its local problems are counted, and named, from 0.

        Args:
            until: when the search ends, by ``working_clock``.
        """
        self._until, self.is_late = until, False
        self.attempts = self._most_attempts = self._pose_tries = 0
        self._is_enclosed = False

    def time_is_up(self) -> bool:
        """Whether the search has to end now; it is late from then on."""
        self.is_late = self.is_late or working_clock() >= self._until
        return self.is_late

    def legs_to(self, ahead: PathAhead, state: Floats, attempts: int = ATTEMPTS) -> list[Leg] | Stuck:
        """Search the legs from a state to rest at one stop, depth first.

        Args:
            ahead: the paths to the stop.
            state: ``[S]`` from which to drive.
            attempts: local problems that may be tried, beside those for each metre of the way.
        """
        legs: list[Leg] = []
        metres = float(ahead.to_go(state[np.newaxis])[0])
        if math.isinf(metres):
            return Stuck(ahead.stop.place, "no way that is wide enough leads to the goal", 0)
        options = [self._legs_from(ahead, state)]
        self._pose_tries, self._is_enclosed = 0, False
        self._most_attempts = self.attempts + attempts + int(ATTEMPTS_A_METRE * metres)
        start = nearest = state
        while not (ahead.arrived(state[np.newaxis])[0] and self._rests(state)):
            leg = next(options[-1], None)
            if leg is not None:
                legs.append(leg)
                options.append(self._legs_from(ahead, leg.end))
            else:
                options.pop()
                if not options:
                    return self._stuck(ahead, start, nearest)
                legs.pop()
            state = legs[-1].end if legs else start
            nearest = min(nearest, state, key=lambda each: ahead.to_go(each[np.newaxis])[0])
        return legs

    def _stuck(self, ahead: PathAhead, start: Floats, nearest: Floats) -> Stuck:
        """Why no legs were found from ``start [S]``; the search came as far as ``nearest [S]``."""
        place = float(nearest[0]), float(nearest[1])
        to_go = float(ahead.to_go(nearest[np.newaxis])[0])
        if self._is_enclosed:
            why = MEANINGS[Status.GOAL_ENCLOSED]
            return Stuck(ahead.stop.place, why, self.attempts, is_enclosed=True)
        if self.is_late:
            return Stuck(place, LATE, self.attempts, to_go, is_late=True)
        if free_stop(start, self._vehicle, self._scene) is None:
            why = "the vehicle can neither stop in time nor drive on from its motion at the start"
            return Stuck(place, why, self.attempts)
        why = "no plan leads on from where the search came nearest to the goal"
        return Stuck(place, why, self.attempts, to_go)

    def _rests(self, state: Floats) -> bool:
        """Whether the vehicle stands, however its wheels are steered; of the first order it stops at once."""
        turns_on = isinstance(self._vehicle, DifferentialDrive) and not self._vehicle.first_order
        return bool(np.abs(state[3 : 4 + turns_on]).max() < RESTING)

    def _legs_from(self, ahead: PathAhead, state: Floats) -> Iterator[Leg]:
        """Yield legs from a state, each searched when needed: in motion first, unless it is the last."""
        for goal in ahead.local_goals(state):
            if self.attempts == self._most_attempts or self._is_enclosed or self.time_is_up():
                break
            if goal.final and ahead.stop.is_pose and not goal.brief:
                if self._pose_tries == POSE_TRIES:
                    continue
                self._pose_tries += 1
            problem = self._problem(state, goal)
            self.attempts += 1
            briefly = VERY_BRIEFLY if ahead.briefly else BRIEFLY
            limits = briefly if goal.brief else usual_limits(problem)
            left = max(self._until - working_clock(), 0.0)
            # on the way there are other goals to try
            limits = replace(limits, seconds=min(limits.seconds, left), second=goal.final and not goal.brief)
            attempt = self._solve(problem, limits)
            if attempt.plan is None:
                self._is_enclosed = goal.final and attempt.status == Status.GOAL_ENCLOSED
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
            f"{self._name}-route-{self.attempts}",
            self._name,
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
