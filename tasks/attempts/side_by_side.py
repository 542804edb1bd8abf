"""Side by side: every contestant attempts every problem, at a time when neither is in the caches.

A robot plans for each problem once, with other work in between. So two attempts at a problem are never made
in a row, and before each attempt other data fill the caches.
"""

from __future__ import annotations

import gc
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from planners.memory.memory import Memory
from planners.solve import Attempt, solve
from planners.world.problem import Problem
from planners.world.randomness import generator
from planners.world.workspace import Workspace
from tasks.attempts.attempt_rows import attempt_row, check_attempt
from tasks.attempts.compile_assists import compile_assists
from tasks.attempts.timing import OtherWork, no_garbage_collection
from tasks.fan_out.chunk import Chunk
from tasks.inputs.problem_sources import Source
from tasks.settings.run_settings import Assist

MemoryOfRun = tuple[str, str]  # name of a memory, and the run that made it


class Contestant(NamedTuple):
    """A planner with what it may use."""

    planner: str
    assist: Assist
    memory: str | None  # its name
    run: str  # that made the memory


def side_by_side(
    chunk: Chunk,
    source: Source,
    contestants: Sequence[Contestant],
    memories: Mapping[MemoryOfRun, Memory],
) -> list[dict[str, Any]]:
    """Have every contestant attempt each problem of a chunk.

    All problems are attempted once before any is attempted again. In which order the contestants attempt a
    problem is drawn by its id, so that none of them always comes first.

    Args:
        chunk: the range of test problems.
        source: where the problems come from.
        contestants: who attempts them.
        memories: what the contestants recall from.

    Returns:
        the attempt rows, problem by problem, in the order of the contestants.

    Raises:
        PlanFaultError: the authority finds fault with a plan.

    """
    vehicle, seed, workspace = chunk.vehicle, chunk.settings.seed, Workspace()

    def attempt(problem: Problem, by: Contestant) -> Attempt:
        memory = memories[by.memory, by.run] if by.memory else None
        assist, top_k, recall = by.assist
        return solve(
            *(problem, by.planner, assist, top_k, memory, seed),
            vehicle=vehicle,
            strategy=recall,
            workspace=workspace,
        )

    problems = [source.problem("test", index) for index in range(chunk.first, chunk.last)]
    turns = [generator(seed, "order", problem.id).permutation(len(contestants)) for problem in problems]
    attempts: dict[tuple[int, int], Attempt] = {}
    other_work = OtherWork()
    compile_assists(vehicle)
    for contestant in contestants:  # what is made when first needed is there before the first time counts
        attempt(problems[-1], contestant)
    with no_garbage_collection():
        for turn in range(len(contestants)):
            for number, problem in enumerate(problems):
                who = int(turns[number][turn])
                other_work()
                attempts[number, who] = attempt(problem, contestants[who])
            gc.collect()
    rows: list[dict[str, Any]] = []
    for number, problem in enumerate(problems):
        checked: set[bytes] = set()
        for i, contestant in enumerate(contestants):
            check_attempt(problem, attempts[number, i], checked, vehicle)
            rows.append(attempt_row(attempts[number, i], contestant.memory, contestant.run, vehicle))
    return rows
