"""Benchmark: every planner with and without memory on problems that nobody has seen, one row an attempt."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from planners.solve import WITHOUT_MEMORY, Attempt, solve
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import vehicle_named
from planners.world.workspace import Workspace
from storage.archives.memories import load_memory
from storage.tables.attempts import write_attempts
from storage.tables.shards import shard_is_done
from tasks.attempts.side_by_side import side_by_side
from tasks.fan_out.stage import Chunk, chunk_task, chunks_of
from tasks.inputs.problem_sources import source_key, source_of
from tasks.settings.run_settings import ABLATION, ABLATION_PLANNER, COMBINED, UNASSISTED, Assist, RunSettings
from tasks.stages.build_memory import memory_chunks

CHUNK_PROBLEMS: Final = 100  # some 10 s of work


class Configuration(NamedTuple):
    """A planner and what it may use."""

    planner: str
    assist: Assist
    memory: str | None  # name of the memory


def configurations(settings: RunSettings, class_name: str) -> list[Configuration]:
    """Every way in which each problem of a class is solved."""
    found = []
    for planner in settings.planners:
        alone = [assist for assist in settings.assists if assist.name in WITHOUT_MEMORY]
        found += [Configuration(planner, assist, None) for assist in (UNASSISTED, *alone)]
        for memory in memories_of(settings, class_name):
            found += [Configuration(planner, each, memory) for each in settings.assists if each not in alone]
        if planner == ABLATION_PLANNER:
            found += [Configuration(planner, assist, class_name) for assist in ABLATION]
    return found


def memories_of(settings: RunSettings, class_name: str) -> list[str]:
    """The memories that are measured on a class: its own, and the combined one if there is one."""
    return [class_name, COMBINED] if settings.combined else [class_name]


def benchmark_chunk(chunk: Chunk) -> dict[str, Any]:
    """Solve a range of unseen problems in every way, check the plans, write the attempts."""
    settings, name = chunk.settings, chunk.class_name
    vehicle, run_name = vehicle_named(settings.vehicle), settings.run_name
    places = {memory: chunk.run.memory(memory) for memory in memories_of(settings, name)}
    memories = {memory: load_memory(place, vehicle) for memory, place in places.items()}

    workspace = Workspace()

    def attempt(problem: Problem, asked: Configuration) -> Attempt:
        memory = memories[asked.memory] if asked.memory else None
        assist, top_k, strategy = asked.assist
        return solve(
            *(problem, asked.planner, assist, top_k, memory, settings.seed),
            vehicle=vehicle,
            strategy=strategy,
            workspace=workspace,
        )

    rows = side_by_side(
        chunk,
        source_of(chunk.data, settings, name),
        configurations(settings, name),
        attempt,
        lambda asked: (asked.memory, run_name),
    )
    write_attempts(chunk.run.shard("results", name, chunk.index), rows, key=chunk.key)
    return {"attempts": len(rows), "solved": sum(row["solved"] for row in rows)}


benchmark_problems = chunk_task(benchmark_chunk)


def is_benchmarked(chunk: Chunk) -> bool:
    """Whether the chunk's attempts are there."""
    return shard_is_done(chunk.run.shard("results", chunk.class_name, chunk.index), chunk.key)


def benchmark_chunks(data: str, settings: RunSettings) -> list[Chunk]:
    """Chunks of unseen problems of every class."""
    memories = {chunk.class_name: chunk.key for chunk in memory_chunks(data, settings)}
    return [
        chunk
        for name in settings.class_names
        for chunk in chunks_of(
            data,
            settings,
            "benchmark",
            name,
            source_of(data, settings, name).count("test", settings.test_problems),
            CHUNK_PROBLEMS,
            [
                settings.seed,
                configurations(settings, name),
                [memories[memory] for memory in memories_of(settings, name)],
                *source_key(settings, name),
            ],
        )
    ]
