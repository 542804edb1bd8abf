"""Plans of manoeuvres: of the lattice from many starts, with known endings and without, and one polished."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Final

from planners.memory.library.plan_library import PlanLibrary, gathered_library
from planners.search.query import Limits
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.classes.families import families_of, family
from planners.world.classes.problem_classes import DIFFICULTIES
from planners.world.problem import Problem
from planners.world.problem_faults import problem_fault
from planners.world.randomness import generator
from planners.world.vehicles.dynamics import turn_limit
from planners.world.vehicles.vehicle import Vehicle, trailers_of
from planners.world.workspace import Workspace
from tests.trials.judged_plans.fleet import FLEET
from tests.trials.judged_plans.general_plans import made
from tests.trials.judged_plans.made import Made

LIMITS: Final = Limits(expansions=2_000)  # what takes longer to solve gives too few plans
STARTS: Final = 40  # of a problem: the search has no randomness that would give several plans of one start
FAILURES: Final = 3  # to solve it from a start, and it is given up
STARTS_OFF: Final = (1.0, 1.0, 0.2)  # metres, metres and radians: standard deviations from the start drawn
BENT: Final = 0.2  # radians, at most, of each hitch at the start
STORED: Final = 4  # problems of each family that a library is made of
KINDS: Final = [
    (name, each, difficulty)
    for difficulty in DIFFICULTIES
    for name, vehicle in FLEET.items()
    for each in families_of(vehicle)
]
WORKSPACE: Final = Workspace()


@cache
def library(seed: int, name: str) -> PlanLibrary | None:
    """First plans for other problems of all families of a vehicle, at ``easy``; None if there are none."""
    vehicle = FLEET[name]
    answered = []
    for each in families_of(vehicle):
        for index in range(STORED):
            problem, _ = to_canonical(family(each, "easy", vehicle).draw(seed + 1, index))
            plan = solve(
                problem, "lattice", limits=LIMITS, vehicle=vehicle, workspace=WORKSPACE, polished=False
            ).plan
            if plan is not None:
                answered.append((problem.id, plan))
    return gathered_library("manoeuvres", vehicle, answered, (vehicle.scale,)) if answered else None


def started(asked: Problem, seed: int, number: int, vehicle: Vehicle) -> Problem:
    """The problem with a start beside its own, every second time in motion; itself if there is no room."""
    if number == 0:
        return asked
    rng = generator(seed, "start", asked.id, number)
    moves = rng.normal(0.0, STARTS_OFF)
    x, y, heading = (float(mine + off) for mine, off in zip(asked.start, moves, strict=True))
    bent = [BENT * float(rng.uniform(-1.0, 1.0)) for _ in trailers_of(vehicle)]
    speed = float(rng.uniform(0.5 * vehicle.min_speed, 0.5 * vehicle.max_speed))
    motion = (speed, turn_limit(vehicle) * float(rng.uniform(-1.0, 1.0)), *bent) if number % 2 else ()
    other = replace(asked, id=f"{asked.id}-{number}", start=(x, y, heading), start_motion=motion)
    return other if problem_fault(other, vehicle) is None else asked


def attempts(seed: int, index: int) -> Iterator[Made]:
    """Every attempt at the problem number ``index`` from all of its starts, and a polished one."""
    name, each, difficulty = KINDS[index % len(KINDS)]
    vehicle, kind = FLEET[name], f"{each}, {difficulty}"
    drawn = family(each, difficulty, vehicle).draw(seed, index)
    known = library(seed, name)
    ways = [("none", None)] if known is None else [("none", None), ("join", known)]
    failed = 0
    for number in range(STARTS):
        asked = started(drawn, seed, number, vehicle)
        canonical, alignment = to_canonical(asked)
        solved = False
        for assist, given in ways:
            also = number == 0 and assist == ways[index % len(ways)][0]
            for polished in (False, True)[: 1 + also]:
                attempt = solve(
                    *(canonical, "lattice", assist, 1, given, seed, LIMITS, vehicle),
                    workspace=WORKSPACE,
                    polished=polished,
                )
                source = "polished" if polished else attempt.source or ""
                yield made(asked, vehicle, kind, source, attempt, alignment)
                solved |= attempt.solved
        failed += not solved
        if failed == FAILURES:
            break
