"""Answers of searches: what is found, polished, and which of some is best."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from planners.search.outcome import Outcome
from planners.world.driving_cost import cost_of
from planners.world.problem import Plan
from planners.world.vehicles.vehicle import Vehicle

FOR_SEARCHES = 0.5  # of the seconds left, for each further search: the rest is for the polish
POLISHED = 2  # of the cheapest plans: which of them is cheapest when polished cannot be told before

Answer = tuple[Outcome, Plan | None]  # of a search, its plan polished; and what that was before


def best_of(answers: Sequence[Answer], vehicle: Vehicle) -> Answer:
    """The first answer with the plan that costs least, or without one if none has any; the work is of all."""
    best, rough = min(answers, key=lambda each: cost_of(each[0].plan, vehicle) if each[0].plan else math.inf)
    return with_work([each for each, _ in answers], best), rough


def with_work(all_of: Sequence[Outcome], one: Outcome) -> Outcome:
    """One outcome with the work and the time of all."""
    return replace(
        one,
        collision_checks=sum(each.collision_checks for each in all_of),
        expansions=sum(each.expansions for each in all_of),
        nodes=sum(each.nodes for each in all_of),
        roadmap_seconds=sum(each.roadmap_seconds for each in all_of),
        search_seconds=sum(each.search_seconds for each in all_of),
    )
