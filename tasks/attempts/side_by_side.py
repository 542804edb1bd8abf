"""Side by side: all attempts at a problem one after another, and their plans checked."""

from __future__ import annotations

import gc
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

from planners.memory.memory import Memory
from planners.solve import Attempt, solve
from planners.world.problem import Problem
from planners.world.randomness import generator
from planners.world.workspace import Workspace
from tasks.attempts.attempt_rows import attempt_row, check_attempt
from tasks.attempts.compile_assists import compile_assists
from tasks.attempts.timing import no_garbage_collection
from tasks.fan_out.chunk import Chunk
from tasks.inputs.problem_sources import Source
from tasks.settings.run_settings import Assist

COLLECTED_EVERY: Final = 10  # problems; collecting garbage takes as long as some ten attempts

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

    In which order they attempt a problem is drawn by its id, so that none of them always comes first.

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

    rows: list[dict[str, Any]] = []
    compile_assists(vehicle)
    for contestant in contestants:  # code and caches are warm before the first time counts
        attempt(source.problem("test", chunk.first), contestant)
    with no_garbage_collection():
        for index in range(chunk.first, chunk.last):
            problem = source.problem("test", index)
            order = generator(seed, "order", problem.id).permutation(len(contestants))
            attempts = {int(i): attempt(problem, contestants[i]) for i in order}
            checked: set[bytes] = set()
            for i, contestant in enumerate(contestants):
                check_attempt(problem, attempts[i], checked, vehicle)
                rows.append(attempt_row(attempts[i], contestant.memory, contestant.run, vehicle))
            if index % COLLECTED_EVERY == 0:
                gc.collect()
    return rows
