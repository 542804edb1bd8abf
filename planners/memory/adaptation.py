"""Drives a stored plan again as another vehicle, and mends the drive: one robot's memory for another robot.

A plan into a pose is placed at the goal pose of the same question, drawn anew for the other vehicle, whose
slot is as much larger as it is. The plan grows, too: as the vehicle's tightest turn does, or as its body. Its
last run is driven first, then more and more of those before it, as long as that succeeds: whoever searches
joins such ends of plans, so the start matters less. Where no question can be drawn, the plan is driven on
open ground, and a plan to a place is followed by the tracking controller.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final, NamedTuple

import numpy as np

from planners.memory.retiming import retimed
from planners.optimisation.polish import driven_near, polish
from planners.search.manoeuvres.endings import last_of_stops, worth_storing
from planners.search.tracking import ARRIVED, TRACKING, track
from planners.world.alignment import to_canonical
from planners.world.arrays import Floats
from planners.world.authority.authority import faults
from planners.world.classes.families import FAMILIES, family
from planners.world.driving_cost import STANDING
from planners.world.geometry.collision import count_free_prefix, scene_of
from planners.world.goal import goal_of
from planners.world.problem import (
    BOUNDS,
    CANONICAL_GOAL,
    CANONICAL_START,
    GOAL_RADIUS,
    POSE_RADIUS,
    POSE_TOLERANCE,
    Arrival,
    Plan,
    Problem,
    obstacles_of,
)
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import DifferentialDrive, Vehicle, state_size
from planners.world.workspace import Workspace

SAME: Final = 1e-6  # metres, radians, m/s: a drive that is so near to the stored one is the stored one
OPEN_M: Final = 30.0  # around a plan on open ground
SPOT_RAD: Final = 0.05  # a larger turn in a step that leads nowhere is one on the spot
_NAMED: Final = re.compile(r"([a-z]+)-([a-z]+)-(\d+)-(\d+)")


class Outcome(StrEnum):
    """What became of a stored plan."""

    WHOLE = "whole"
    PART = "from a later stop on"
    BACKWARDS = "drive backwards, which the vehicle cannot"
    ON_THE_SPOT = "turn on the spot, which the vehicle cannot"
    BLOCKED = "blocked or do not arrive"
    REFUSED = "refused by the judge"


class Adapted(NamedTuple):
    """What became of a stored plan: one plan that passes, perhaps a polished one before it, or none."""

    outcome: Outcome
    question: Problem | None  # that the plans answer
    plans: list[Plan]


@dataclass(frozen=True)
class Adaptation:
    """From one vehicle to another."""

    old: Vehicle
    new: Vehicle

    def adapted(self, stored: Plan, question: str, canonical: bool, workspace: Workspace) -> Adapted:
        """Drive a stored plan as the new vehicle.

        Args:
            stored: the plan, of the old vehicle.
            question: the id of what it answered.
            canonical: whether it answers a canonical problem: then it is driven from its start to its place.
            workspace: the caller's buffers.
        """
        if self.new.min_speed >= 0.0 and (stored.states[:, 3] < -STANDING).any():
            return Adapted(Outcome.BACKWARDS, None, [])
        if not isinstance(self.new, DifferentialDrive) and _turns_on_the_spot(stored):
            return Adapted(Outcome.ON_THE_SPOT, None, [])
        found = Adapted(Outcome.BLOCKED, None, [])
        if abs(stored.states[-1, 3]) < STANDING and not canonical:
            drawn = None if len(stored.controls) == 0 else self._drawn_again(stored, question)
            unchanged = self._unchanged(stored, drawn, question)
            if unchanged is not None:
                return unchanged
            for factor in self.factors:
                found = self._into_pose(stored, drawn, factor, question, workspace)
                if found.plans:
                    break
            return found
        unchanged = self._unchanged(stored, None, question, canonical)
        return unchanged or self._to_place(stored, question, canonical, workspace)

    @property
    def factors(self) -> list[float]:
        """How much larger the new vehicle's ways may be: as much as its tightest turn, or as its body."""
        old, new = self.old, self.new
        factors = [(new.front + new.rear) / (old.front + old.rear)]
        if not isinstance(old, DifferentialDrive) and not isinstance(new, DifferentialDrive):
            turns = [each.wheelbase / math.tan(each.max_steering) for each in (new, old)]
            factors.insert(0, turns[0] / turns[1])
        return list(dict.fromkeys(round(each, 3) for each in factors))

    def _drawn_again(self, stored: Plan, question: str) -> tuple[Problem, Problem] | None:
        """The question of a family that a plan answered, for the old and the new vehicle; None for others."""
        named = _NAMED.fullmatch(question)
        if named is None or named[1] not in FAMILIES:
            return None
        try:
            drawn = [
                to_canonical(family(named[1], named[2], vehicle).draw(int(named[3]), int(named[4])))[0]
                for vehicle in (self.old, self.new)
            ]
        except ValueError:  # not for the new vehicle
            return None
        arrives = math.dist(stored.states[-1, :2], drawn[0].goal) <= drawn[0].goal_radius + SAME
        return (drawn[0], drawn[1]) if arrives else None

    def _unchanged(
        self,
        stored: Plan,
        drawn: tuple[Problem, Problem] | None,
        question: str,
        canonical: bool = False,
    ) -> Adapted | None:
        """The plan as it is, if the new vehicle can drive just that."""
        if state_size(self.old) != state_size(self.new) or stored.dt != self.new.dt:
            return None
        states = stored.states if drawn is None else _placed(stored.states, drawn, 1.0)
        driven = simulate(np.ascontiguousarray(states[0]), np.ascontiguousarray(stored.controls), self.new)
        if np.abs(driven - states).max() > SAME:
            return None
        plan = Plan(driven, stored.controls, stored.dt)
        asked = _asked(states, drawn and drawn[1], question, canonical, self.new)
        return None if faults(asked, plan, self.new) else Adapted(Outcome.WHOLE, asked, [plan])

    def _into_pose(
        self,
        stored: Plan,
        drawn: tuple[Problem, Problem] | None,
        factor: float,
        question: str,
        workspace: Workspace,
    ) -> Adapted:
        guess = retimed(stored, self.old, self.new, factor)
        if drawn is not None:
            guess = _placed(guess, drawn, factor)
        begins = last_of_stops(guess)
        found = Adapted(Outcome.BLOCKED, None, [])
        for begin in begins[::-1]:
            asked = _asked(guess[begin:], drawn and drawn[1], question, False, self.new)
            plan = driven_near(asked, guess[begin:].copy(), self.new, scene_of(asked), workspace).plan
            if plan is None:
                break
            if faults(asked, plan, self.new):
                found = found if found.plans else Adapted(Outcome.REFUSED, None, [])
                break
            found = Adapted(Outcome.WHOLE if begin == begins[0] else Outcome.PART, asked, [plan])
        return self._with_polished(found, workspace) if drawn is not None else found

    def _with_polished(self, found: Adapted, workspace: Workspace) -> Adapted:
        """Put the polished plan first; keep the other one beside it if it has stops, which polish melts."""
        if found.question is None:
            return found
        asked, plan = found.question, found.plans[0]
        polished = polish(asked, plan, self.new, scene_of(asked), workspace).plan
        if polished is None or faults(asked, polished, self.new):
            return found
        return found._replace(plans=worth_storing(plan, polished, self.new))

    def _to_place(self, stored: Plan, question: str, canonical: bool, workspace: Workspace) -> Adapted:
        guess = retimed(stored, self.old, self.new)
        asked = _asked(guess, None, question, canonical, self.new)
        scene, goal = scene_of(asked), goal_of(asked, self.new)
        states = np.empty((2 * len(guess) + 60, guess.shape[1]))
        controls = np.empty((len(states) - 1, 2))
        states[0] = guess[0]
        ended, last, _ = track(states, controls, 0, guess, 0, goal, TRACKING, self.new, scene)
        plan: Plan | None = Plan(states[: last + 1].copy(), controls[:last].copy(), self.new.dt)
        if ended != ARRIVED or count_free_prefix(states[:1], self.new, scene) == 0:
            plan = driven_near(asked, guess, self.new, scene, workspace).plan
        if plan is None:
            return Adapted(Outcome.BLOCKED, None, [])
        if faults(asked, plan, self.new):
            return Adapted(Outcome.REFUSED, None, [])
        return Adapted(Outcome.WHOLE, asked, [plan])


def _turns_on_the_spot(plan: Plan) -> bool:
    ways = np.hypot(*np.diff(plan.states[:, :2], axis=0).T)
    return bool((np.abs(np.diff(plan.states[:, 2]))[ways < STANDING] > SPOT_RAD).any())


def _placed(states: Floats, drawn: tuple[Problem, Problem], factor: float) -> Floats:
    """Move states from the goal pose of the old question, times ``factor``, to that of the new one."""
    before, after = drawn
    turn = _heading(after) - _heading(before)
    cos, sin = math.cos(turn), math.sin(turn)
    x, y = (states[:, :2] - factor * np.array(before.goal)).T
    placed = states.copy()
    placed[:, 0] = after.goal[0] + cos * x - sin * y
    placed[:, 1] = after.goal[1] + sin * x + cos * y
    placed[:, 2] += turn
    return placed


def _heading(problem: Problem) -> float:
    assert problem.arrival is not None  # families ask for poses
    assert problem.arrival.heading is not None
    return problem.arrival.heading


def _asked(
    states: Floats, drawn: Problem | None, question: str, canonical: bool, vehicle: Vehicle
) -> Problem:
    """The question that begins like these states: the goal drawn, or to end as they do on open ground."""
    start = (float(states[0, 0]), float(states[0, 1]), float(states[0, 2]))
    motion = tuple(states[0, 3:].tolist())
    if drawn is not None:
        return replace(drawn, start=start, start_motion=motion)
    x, y, heading = states[-1, :3].tolist()
    low, high = states[:, :2].min(axis=0) - OPEN_M, states[:, :2].max(axis=0) + OPEN_M
    place = Problem(
        id=question,
        class_name="open",
        start=start,
        goal=(x, y),
        goal_radius=GOAL_RADIUS,
        bounds=(*low.tolist(), *high.tolist()),
        obstacles=obstacles_of([]),
        scale=vehicle.scale,
        start_motion=motion,
    )
    if canonical:
        return replace(place, start=CANONICAL_START, goal=CANONICAL_GOAL, bounds=BOUNDS, start_motion=())
    if abs(states[-1, 3]) >= STANDING:
        return place
    return replace(place, goal_radius=POSE_RADIUS, arrival=Arrival(heading, POSE_TOLERANCE, 0.0, 0.0))
