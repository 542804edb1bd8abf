"""Plans of general questions: of every planner, with parts of other plans and without, some polished."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import count, islice
from typing import Final

from planners.attempt import Attempt
from planners.memory.library.plan_library import PlanLibrary, gathered_library
from planners.optimisation.polish import polish
from planners.search.query import Limits
from planners.solve import solve
from planners.world.alignment import Alignment, from_canonical, to_canonical
from planners.world.geometry.collision import scene_of
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import Vehicle, trailers_of
from planners.world.workspace import Workspace
from tests.trials.judged_plans.fleet import FLEET
from tests.trials.judged_plans.hard_questions import kind_of, question_of
from tests.trials.judged_plans.made import POLISHED, Made

LIMITS: Final = Limits(expansions=500)  # what takes longer to solve gives too few plans
STORED: Final = 60  # plans of a library
WAYS: Final = (  # planner, assist, seeds
    *((planner, assist, 6) for planner in ("rrt", "gust", "follow") for assist in ("none", "fresh")),
    ("lattice", "none", 2),
    ("lattice", "closed", 1),
    ("lattice", "join", 1),
    ("lattice", "random-closed", 6),
)
ROUNDS: Final = 3  # in all of them there is a turn for each vehicle without trailers, for others in the first
TURNS: Final = [
    (name, turn) for turn in range(ROUNDS) for name in FLEET if turn == 0 or not trailers_of(FLEET[name])
]
MARGINS_M: Final = (0.0, 0.4)  # that polished plans keep, in turn
WORKSPACE: Final = Workspace()


@cache
def library(seed: int, name: str) -> PlanLibrary:
    """Plans of the lattice for questions of other worlds and other parts of the maps."""
    vehicle = FLEET[name]

    def answered() -> Iterator[tuple[str, Plan]]:
        for index in count():
            asked = question_of(seed, index, vehicle, "train")
            if asked is None:
                continue
            plan = solve(
                to_canonical(asked)[0], "lattice", limits=LIMITS, vehicle=vehicle, workspace=WORKSPACE
            ).plan
            if plan is not None and len(plan.controls):
                yield asked.id, plan

    return gathered_library("general", vehicle, list(islice(answered(), STORED)), (vehicle.scale,))


def made(
    asked: Problem, vehicle: Vehicle, kind: str, source: str, attempt: Attempt, alignment: Alignment
) -> Made:
    """An attempt at a question in the canonical frame, moved back into the question's own."""
    plan = attempt.plan and from_canonical(attempt.plan, alignment)
    return Made(asked, vehicle, kind, source, replace(attempt, plan=plan))


def attempts(seed: int, index: int) -> Iterator[Made]:
    """Every attempt at question number ``index``, and one of a planner in turn, polished."""
    whole, place = divmod(index, len(TURNS))
    name, turn = TURNS[place]
    vehicle, question = FLEET[name], ROUNDS * whole + turn
    asked = question_of(seed, question, vehicle)
    if asked is None:
        return
    canonical, alignment = to_canonical(asked)
    kind, known = kind_of(asked), library(seed, name)
    for number, (planner, assist, seeds) in enumerate(WAYS):
        given = None if assist in ("none", "fresh") else known
        for each in range(seeds):
            attempt = solve(
                *(canonical, planner, assist, 1, given, each, LIMITS, vehicle),
                workspace=WORKSPACE,
                polished=(question + number + each) % POLISHED == 0,
            )
            yield made(asked, vehicle, kind, attempt.source or "", attempt, alignment)
            if attempt.plan is None:
                break  # mostly nobody finds any
        if attempt.plan is not None and number == question % len(WAYS):
            margin = MARGINS_M[question // len(WAYS) % len(MARGINS_M)]
            scene = scene_of(canonical)
            better = polish(canonical, attempt.plan, vehicle, scene, WORKSPACE, margin_m=margin).plan
            yield made(asked, vehicle, kind, "polished", replace(attempt, plan=better), alignment)
