"""A library of plans: of any questions, from any motion to any place, in whatever frames they were made."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planners.memory.library.drives import Drives, drives_of
from planners.memory.library.stretches import Stretches, stretches_of
from planners.memory.library.sub_plans import SubPlans, index_of
from planners.memory.plans.plan_arrays import StoredPlans, store_plans
from planners.search.manoeuvres.endings import endings_of
from planners.search.query import Endings
from planners.world.arrays import Indices
from planners.world.driving_cost import cost_in_steps
from planners.world.problem import Plan
from planners.world.vehicles.vehicle import Vehicle, state_size


@dataclass(frozen=True, eq=False)
class PlanLibrary:
    """Stored plans of one vehicle, and the questions that they answered.

    Raises ValueError if there are no plans, or not one question for each.
    """

    class_name: str  # of the questions, "general" if of several classes
    vehicle: Vehicle
    plans: StoredPlans  # N plans, each in a frame of its own
    questions: tuple[str, ...]  # [N] the id of the question that each plan answered
    scales: tuple[float, ...] = (1.0,)  # of the questions: real metres in one metre of a plan

    def __post_init__(self) -> None:
        if not self.questions or len(self.questions) != len(self.plans):
            raise ValueError(
                f"{len(self.plans)} plans of {len(self.questions)} questions: a library has at least one "
                "plan, and one question for each"
            )

    @functools.cached_property
    def sub_plans(self) -> SubPlans:
        """The parts of the plans, and what finds them."""
        return index_of(self.plans, self.vehicle)

    @functools.cached_property
    def stretches(self) -> Stretches:
        """The few parts that lead onward from each kind of motion."""
        return stretches_of(self.sub_plans, self.vehicle)

    @functools.cached_property
    def endings(self) -> Endings:
        """The ways into a pose at rest that the plans end with, from the places where they stand."""
        return endings_of(((plan.states, plan.controls) for plan in self.plans), self.vehicle)

    @functools.cached_property
    def drives(self) -> Drives:
        """The cheapest plans of their questions that end at rest, whole, and ready to be moved to others.

        Another one begins where the cheapest does, and would only keep other ways out of the choice.
        """
        return drives_of(self.plans, self.vehicle, self._cheapest())

    def _cheapest(self) -> Indices:
        """The numbers of the plans that cost least of those of their questions."""
        steps = [cost_in_steps(plan, self.vehicle) for plan in self.plans]
        best: dict[str, int] = {}
        for number, question in enumerate(self.questions):
            if question not in best or steps[number] < steps[best[question]]:
                best[question] = number
        return np.array(sorted(best.values()))

    def __len__(self) -> int:
        """Count the plans."""
        return len(self.plans)


def gathered_library(
    class_name: str,
    vehicle: Vehicle,
    answered: Sequence[tuple[str, Plan]],
    scales: tuple[float, ...] = (1.0,),
) -> PlanLibrary:
    """Make a library of questions that were answered.

    Args:
        class_name: of the questions.
        vehicle: what is driven.
        answered: the id of each question, and its plan in any frame.
        scales: of the questions: real metres in one metre of a plan.

    Raises:
        ValueError: nothing was answered.
    """
    plans = store_plans((plan for _, plan in answered), state_size(vehicle))
    return PlanLibrary(class_name, vehicle, plans, tuple(question for question, _ in answered), scales)
