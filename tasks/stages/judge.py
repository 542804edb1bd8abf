"""Judge: champion and challenger at the same held-back problems, next to each other, one row an attempt.

Before that, every plan of the challenger is checked once more by the authority.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import pandas as pd

from planners.memory.recall import Memory, default_recall
from planners.solve import WITHOUT_MEMORY, Attempt, solve
from planners.world.authority.authority import faults
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import vehicle_named
from planners.world.workspace import Workspace
from storage.archives.memories import load_memory
from storage.tables.attempts import read_attempts, write_attempts
from storage.tables.experiences import read_experiences
from storage.tables.shards import shard_is_done
from tasks.attempts.attempt_rows import PlanFaultError
from tasks.attempts.side_by_side import side_by_side
from tasks.fan_out.stage import Chunk, chunk_task, chunks_of, run_folder
from tasks.inputs.problem_sources import held_back, source_key
from tasks.settings.retraining_settings import champions_of, number_of
from tasks.settings.run_settings import Assist, RunSettings
from tasks.stages.benchmark import memories_of
from tasks.stages.build_memory import memory_chunks
from tasks.stages.collect import experiences_key

CHUNK_PROBLEMS: Final = 100
PLANS_AT_ONCE: Final = 25  # checked by FCL, some seconds


class Way(NamedTuple):
    """One way in which a held-back problem is attempted."""

    planner: str
    assist: Assist
    memory: str  # its name
    run: str  # that made it: the champion's, or the challenger's


def ways(settings: RunSettings, class_name: str) -> list[Way]:
    """Every planner with every memory, of both sides, in every configuration that uses one."""
    memories = memories_of(settings, class_name)
    made = [(each.memory, each.run) for each in champions_of(memories, settings.retraining)]
    sides = [*made, *((memory, settings.run_name) for memory in memories)]
    return [
        Way(planner, assist, *side)
        for planner in settings.planners
        for assist in settings.assists
        if assist.name not in WITHOUT_MEMORY
        for side in sides
    ]


def judge_chunk(chunk: Chunk) -> dict[str, Any]:
    """Attempt a range of held-back problems in every way, check the plans, write the attempts."""
    settings, name = chunk.settings, chunk.class_name
    vehicle, challenger = vehicle_named(settings.vehicle), settings.run_name
    asked = ways(settings, name)
    memories: dict[tuple[str, str], Memory] = {}
    for way in asked:
        place = chunk.run.memory if way.run == challenger else chunk.run.champion
        if way[2:] not in memories:
            memories[way[2:]] = load_memory(place(way.memory), vehicle)

    workspace = Workspace()

    def attempt(problem: Problem, way: Way) -> Attempt:
        assist, top_k, strategy = way.assist
        known = memories[way[2:]]
        strategy = strategy or default_recall(memories[way.memory, challenger])  # both alike
        return solve(
            *(problem, way.planner, assist, top_k, known, settings.seed),
            vehicle=vehicle,
            strategy=strategy,
            workspace=workspace,
        )

    held = held_back(chunk.data, settings, name)
    rows = side_by_side(chunk, held, asked, attempt, lambda way: (way.memory, way.run))
    write_attempts(chunk.run.shard("judged", name, chunk.index), rows, key=chunk.key)
    return {"attempts": len(rows)}


judge_problems = chunk_task(judge_chunk)


def is_judged(chunk: Chunk) -> bool:
    """Whether the chunk's attempts are there."""
    return shard_is_done(chunk.run.shard("judged", chunk.class_name, chunk.index), chunk.key)


def judge_chunks(data: str, settings: RunSettings) -> list[Chunk]:
    """Chunks of held-back problems of every class."""
    built = {chunk.class_name: chunk.key for chunk in memory_chunks(data, settings)}
    return [
        chunk
        for name in settings.class_names
        for chunk in chunks_of(
            data,
            settings,
            "judge",
            name,
            held_back(data, settings, name).count("test", settings.test_problems),
            CHUNK_PROBLEMS,
            [
                settings.seed,
                number_of(settings.retraining),
                [
                    (way.planner, way.assist, way.memory, way.run != settings.run_name)
                    for way in ways(settings, name)
                ],
                champions_of(memories_of(settings, name), settings.retraining),
                [built[memory] for memory in memories_of(settings, name)],
                *source_key(settings, name),
            ],
        )
    ]


def check_plans_chunk(chunk: Chunk) -> dict[str, Any]:
    """Have the authority check a range of a class's plans; PlanFaultError at the first fault."""
    vehicle = vehicle_named(chunk.settings.vehicle)
    kept = read_experiences(chunk.run.experiences(chunk.class_name), vehicle)
    for experience in kept[chunk.first : chunk.last]:
        for fault in faults(experience.problem, experience.plan, vehicle):
            raise PlanFaultError(f"plan for {experience.problem.id}: {fault}")
    return {"plans": chunk.last - chunk.first}


check_plans = chunk_task(check_plans_chunk)


def plan_chunks(data: str, settings: RunSettings) -> list[Chunk]:
    """Chunks of the plans that the challengers are made of."""
    return [
        chunk
        for name in settings.class_names
        for chunk in chunks_of(
            data,
            settings,
            "check-plans",
            name,
            settings.experiences,
            PLANS_AT_ONCE,
            [experiences_key(data, settings, name), settings.vehicle],
        )
    ]


class Judged(NamedTuple):
    """The attempts with one memory of both sides; the champion's are none where it is the first."""

    champion: pd.DataFrame
    challenger: pd.DataFrame


def judged(data: str, settings: RunSettings, memory: str) -> Judged:
    """What was attempted with a memory."""
    run = run_folder(data, settings)
    shards = [run.shard("judged", chunk.class_name, chunk.index) for chunk in _with(data, settings, memory)]
    rows = pd.concat([read_attempts(shard, ("recalled",)) for shard in shards], ignore_index=True)
    rows = rows[rows["memory"] == memory]
    ours = rows["run_id"] == settings.run_name
    return Judged(rows[~ours], rows[ours])


def judged_key(data: str, settings: RunSettings, memory: str) -> list[str]:
    """What the attempts with a memory depend on."""
    return [chunk.key for chunk in _with(data, settings, memory)]


def _with(data: str, settings: RunSettings, memory: str) -> list[Chunk]:
    """The chunks of the classes that a memory is measured on."""
    return [
        chunk for chunk in judge_chunks(data, settings) if memory in memories_of(settings, chunk.class_name)
    ]
