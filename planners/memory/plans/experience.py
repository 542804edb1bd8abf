"""A solved problem as it is kept."""

from __future__ import annotations

import functools
from dataclasses import dataclass

from planners.memory.plans.sweeps import PlanSweeps, sweep_plans
from planners.world.arrays import Floats
from planners.world.problem import Plan, Problem
from planners.world.vehicles.bodies import swept_boxes
from planners.world.vehicles.vehicle import CAR, Vehicle


@dataclass(frozen=True, eq=False)
class Experience:
    """A solved problem and its plan in the canonical frame: the pair ``(S_i, P_i)`` of docs/method.md."""

    problem: Problem
    plan: Plan
    vehicle: Vehicle = CAR

    @functools.cached_property
    def boxes(self) -> Floats:
        """The plan's swept boxes ``[T, B, 6]`` of B bodies in driving order, columns as in ``PlanSweeps``."""
        boxes = swept_boxes(self.plan.states, self.vehicle)
        return boxes.reshape(len(self.plan.states), -1, 6)

    @functools.cached_property
    def sweep(self) -> PlanSweeps:
        """The plan ready to be checked in many problems."""
        return sweep_plans([self.plan], self.vehicle)
