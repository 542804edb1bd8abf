"""Benchmark every planner with and without memory on unseen problems, with one row per attempt."""

from __future__ import annotations

from typing import Final

from planners.attempt import WITHOUT_MEMORY
from storage.archives.memories import load_memory
from storage.tables.attempts import write_attempts
from tasks.attempts.side_by_side import Contestant, side_by_side
from tasks.fan_out.chunk import Chunk, Cut
from tasks.fan_out.stage import Stage
from tasks.inputs.problem_sources import source_key, source_of
from tasks.settings.run_settings import ABLATION_PLANNER, UNASSISTED, RunSettings
from tasks.stages.build_memory import BUILD_MEMORY

CHUNK_PROBLEMS: Final = 100  # about 10 s of work
POLISHED_PROBLEMS: Final = 1_000  # of a class, the first ones; polishing takes longer than all other attempts


def contestants(settings: RunSettings, class_name: str, first: int = 0) -> list[Contestant]:
    """Every planner without memory, and with every memory that is measured on a class.

    Args:
        settings: the settings of the run.
        class_name: the class.
        first: number of the first problem of a chunk. From ``POLISHED_PROBLEMS`` on nothing is polished.
    """
    run, everyone = settings.run_name, []
    for planner in settings.planners:
        measured = settings.assists_of(planner)
        alone = [assist for assist in measured if assist.name in WITHOUT_MEMORY]
        everyone += [Contestant(planner, assist, None, run) for assist in (UNASSISTED, *alone)]
        for memory in settings.memories_of(class_name):
            assists = [each for each in measured if each not in alone]
            everyone += [Contestant(planner, assist, memory, run) for assist in assists]
        if planner == ABLATION_PLANNER:
            everyone += [Contestant(planner, assist, class_name, run) for assist in settings.ablation]
    return [each for each in everyone if first < POLISHED_PROBLEMS or not each.assist.polished]


def benchmark_chunk(chunk: Chunk) -> None:
    """Have every contestant solve a range of unseen problems, check the plans, write the attempts."""
    settings, name = chunk.settings, chunk.class_name
    memories = {
        (memory, settings.run_name): load_memory(chunk.run.memory(memory), chunk.vehicle)
        for memory in settings.memories_of(name)
    }
    source = source_of(chunk.data, settings, name)
    problems = [source.problem("test", index) for index in range(chunk.first, chunk.last)]
    rows = side_by_side(problems, settings, contestants(settings, name, chunk.first), memories)
    write_attempts(chunk.shard("results"), rows, key=chunk.key)


def _cut(data: str, settings: RunSettings, name: str) -> Cut:
    inputs = [
        settings.seed,
        contestants(settings, name),
        POLISHED_PROBLEMS,
        [BUILD_MEMORY.keys(data, settings, memory) for memory in settings.memories_of(name)],
        *source_key(settings, name),
    ]
    count = source_of(data, settings, name).count("test", settings.test_problems)
    return Cut(count, CHUNK_PROBLEMS, inputs)


BENCHMARK: Final = Stage(
    name="benchmark", do=benchmark_chunk, cut=_cut, output=lambda chunk: chunk.shard("results")
)
