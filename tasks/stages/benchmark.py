"""Benchmark: every planner with and without memory on problems that nobody has seen, one row an attempt."""

from __future__ import annotations

from typing import Final, NamedTuple

from planners.solve import WITHOUT_MEMORY, Attempt, solve
from planners.world.problem import Problem
from planners.world.workspace import Workspace
from storage.archives.memories import load_memory
from storage.tables.attempts import write_attempts
from tasks.attempts.side_by_side import side_by_side
from tasks.fan_out.chunk import Chunk, Cut
from tasks.fan_out.stage import Stage
from tasks.inputs.problem_sources import source_key, source_of
from tasks.settings.run_settings import ABLATION, ABLATION_PLANNER, UNASSISTED, Assist, RunSettings
from tasks.stages.build_memory import BUILD_MEMORY

CHUNK_PROBLEMS: Final = 100  # some 10 s of work


class AssistedPlanner(NamedTuple):
    """A planner and what it may use."""

    planner: str
    assist: Assist
    memory: str | None  # name of the memory


def assisted_planners(settings: RunSettings, class_name: str) -> list[AssistedPlanner]:
    """Everything that each problem of a class is solved by."""
    combinations = []
    for planner in settings.planners:
        alone = [assist for assist in settings.assists if assist.name in WITHOUT_MEMORY]
        combinations += [AssistedPlanner(planner, assist, None) for assist in (UNASSISTED, *alone)]
        for memory in settings.memories_of(class_name):
            assists = [each for each in settings.assists if each not in alone]
            combinations += [AssistedPlanner(planner, assist, memory) for assist in assists]
        if planner == ABLATION_PLANNER:
            combinations += [AssistedPlanner(planner, assist, class_name) for assist in ABLATION]
    return combinations


def benchmark_chunk(chunk: Chunk) -> None:
    """Solve a range of unseen problems in every way, check the plans, write the attempts."""
    settings, name, vehicle = chunk.settings, chunk.class_name, chunk.vehicle
    memories = {each: load_memory(chunk.run.memory(each), vehicle) for each in settings.memories_of(name)}
    workspace = Workspace()

    def attempt(problem: Problem, by: AssistedPlanner) -> Attempt:
        memory = memories[by.memory] if by.memory else None
        assist, top_k, strategy = by.assist
        return solve(
            *(problem, by.planner, assist, top_k, memory, settings.seed),
            vehicle=vehicle,
            strategy=strategy,
            workspace=workspace,
        )

    rows = side_by_side(
        chunk,
        source_of(chunk.data, settings, name),
        assisted_planners(settings, name),
        attempt,
        lambda by: (by.memory, settings.run_name),
    )
    write_attempts(chunk.shard("results"), rows, key=chunk.key)


def _cut(data: str, settings: RunSettings, name: str) -> Cut:
    inputs = [
        settings.seed,
        assisted_planners(settings, name),
        [BUILD_MEMORY.keys(data, settings, memory) for memory in settings.memories_of(name)],
        *source_key(settings, name),
    ]
    count = source_of(data, settings, name).count("test", settings.test_problems)
    return Cut(count, CHUNK_PROBLEMS, inputs)


BENCHMARK: Final = Stage(
    name="benchmark",
    do=benchmark_chunk,
    cut=_cut,
    output=lambda chunk: chunk.shard("results"),
)
