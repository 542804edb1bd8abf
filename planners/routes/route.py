"""A route: one drive from a state through some stops, made of legs."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

from planners.attempt import KEPT, NEW, SOURCES, Attempt
from planners.routes.legs import Leg, joined
from planners.world.arrays import Floats
from planners.world.problem import Plan, Problem, start_state
from planners.world.vehicles.dynamics import control_limits
from planners.world.vehicles.vehicle import Vehicle

LEG_SOURCES: Final = (KEPT, *SOURCES)


@dataclass(frozen=True, eq=False)
class Route:
    """Legs from a start to the last of some stops."""

    problems: list[Problem]  # to each stop: from where the vehicle then is, with everything that is occupied
    sections: list[list[Leg]]  # to each stop the legs of the drive, all but the first from rest
    paths: list[Floats]  # to each stop the shortest path over the cells, [n, 2] metres

    @property
    def problem(self) -> Problem:
        """The whole one, from the start to the last stop."""
        first, last = self.problems[0], self.problems[-1]
        return replace(last, start=first.start, start_motion=first.start_motion)

    @property
    def legs(self) -> list[Leg]:
        """All legs, in the order of the drive."""
        return [leg for section in self.sections for leg in section]

    @property
    def source(self) -> str:
        """Where it comes from: "searched" if any leg was, else "repaired", "recalled", or else "kept"."""
        return max((leg.source for leg in self.legs), key=LEG_SOURCES.index, default="searched")

    def new_attempts(self, scale: float) -> list[tuple[Problem, Attempt]]:
        """Each local problem whose plan no memory had, once and without a name, and how it was solved.

        Args:
            scale: metres of the map in a canonical one.
        """
        by_name = {
            leg.problem.id: (replace(leg.problem, id="", scale=scale), leg.attempt)
            for leg in self.legs
            if leg.attempt is not None and leg.source in NEW
        }
        return list(by_name.values())

    def least_seconds(self, vehicle: Vehicle) -> float:
        """Return how long as many metres take at full speed, from the start's to rest at each stop."""
        acceleration, _ = control_limits(vehicle)
        seconds, speed = 0.0, abs(float(start_state(self.problem, vehicle)[3]))
        for section in self.sections:
            metres = sum(Plan(leg.states(vehicle), leg.controls).length_m for leg in section)
            as_if_from_rest = metres + 0.5 * speed * speed / acceleration
            highest = min(vehicle.max_speed, math.sqrt(acceleration * as_if_from_rest))
            at_it = as_if_from_rest - highest * highest / acceleration
            seconds += (2.0 * highest - speed) / acceleration + at_it / highest if highest > 0.0 else 0.0
            speed = 0.0
        return seconds

    def plan(self, vehicle: Vehicle) -> Plan:
        """Join all legs to one plan."""
        return joined(self.problem, self.legs, vehicle)

    def plans(self, vehicle: Vehicle) -> list[Plan]:
        """To each stop the plan that solves its problem."""
        return [joined(*each, vehicle) for each in zip(self.problems, self.sections, strict=True)]
