"""Every contestant attempts every problem, with cold caches.

A robot plans for each problem once, with other work in between. Therefore a problem is never attempted twice
in a row, and other data fill the caches before each attempt.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple, TypeVar

from planners.attempt import Attempt
from planners.memory.memory import Memory
from planners.solve import solve
from planners.world.problem import Problem
from planners.world.randomness import generator
from planners.world.workspace import Workspace
from storage.vehicles.vehicle_files import said_vehicle
from tasks.attempts.attempt_rows import attempt_row
from tasks.attempts.compile_assists import compile_assists
from tasks.attempts.judged_attempts import check_attempt
from tasks.attempts.timing import OtherWork, no_garbage_collection
from tasks.settings.run_settings import Assist, RunSettings

TURNS_A_COLLECTION: Final = 16  # of garbage, which takes as long as thirty attempts
MemoryOfRun = tuple[str, str]  # name of a memory, and the run that made it
Made = TypeVar("Made")


class Contestant(NamedTuple):
    """A planner and the memory that it may use."""

    planner: str
    assist: Assist
    memory: str | None  # its name
    run: str  # that made the memory


def in_turn(
    problems: Sequence[Problem], ways: int, seed: int, attempt: Callable[[Problem, int], Made]
) -> dict[tuple[int, int], Made]:
    """Attempt each problem in each of several ways, on the cold clock.

    All problems are attempted once before any is attempted again. The order of the ways at a problem is drawn
    from its id, so that none of them always comes first.

    Args:
        problems: the problems to attempt; a single problem is attempted several times in a row.
        ways: how many ways there are.
        seed: of the orders.
        attempt: attempts a problem in one of the ways, which are counted from 0.

    Returns:
        what each attempt returned, by the number of the problem and of the way.
    """
    turns = [generator(seed, "order", problem.id).permutation(ways) for problem in problems]
    made: dict[tuple[int, int], Made] = {}
    other_work = OtherWork()
    with no_garbage_collection():
        for turn in range(ways):
            for number, problem in enumerate(problems):
                way = int(turns[number][turn])
                other_work()
                made[number, way] = attempt(problem, way)
            if turn % TURNS_A_COLLECTION == 0:
                gc.collect()
    return made


def side_by_side(
    problems: Sequence[Problem],
    settings: RunSettings,
    contestants: Sequence[Contestant],
    memories: Mapping[MemoryOfRun, Memory],
) -> list[dict[str, Any]]:
    """Have every contestant attempt each problem, in turn.

    Args:
        problems: the problems to attempt.
        settings: the settings that name the vehicle and the seed.
        contestants: the contestants that attempt them.
        memories: what the contestants recall from.

    Returns:
        the attempt rows, problem by problem, in the order of the contestants.

    Raises:
        PlanFaultError: the authority finds fault with a plan.
    """
    vehicle, seed, workspace = said_vehicle(settings.vehicle), settings.seed, Workspace()

    def attempt(problem: Problem, number: int) -> Attempt:
        by = contestants[number]
        memory = memories[by.memory, by.run] if by.memory else None
        assist, top_k, recall, polished = by.assist
        return solve(
            *(problem, by.planner, assist, top_k, memory, seed),
            vehicle=vehicle,
            strategy=recall,
            workspace=workspace,
            polished=polished,
        )

    compile_assists(vehicle)
    for number in range(len(contestants)):  # anything made on first use exists before time counts
        attempt(problems[-1], number)
    attempts = in_turn(problems, len(contestants), seed, attempt)
    rows: list[dict[str, Any]] = []
    for number, problem in enumerate(problems):
        accepted: set[bytes] = set()
        for i, contestant in enumerate(contestants):
            checked = check_attempt(problem, attempts[number, i], accepted, vehicle)
            rows.append(attempt_row(checked, contestant.memory, contestant.run, vehicle))
    return rows
