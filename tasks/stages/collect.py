"""Collect: draw problems of a class, solve them, check every plan: the candidates among which to choose."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from planners.memory.plans.experience import Experience
from planners.solve import solve
from planners.world.vehicles.vehicle import vehicle_named
from planners.world.workspace import Workspace
from storage.tables.experiences import copy_experiences, write_experiences
from storage.tables.shards import metadata_of, shard_is_done
from tasks.attempts.attempt_rows import check_attempt
from tasks.fan_out.stage import Chunk, chunk_task, chunks_of, run_folder
from tasks.inputs.champion_run import champion_run_of
from tasks.inputs.problem_sources import source_key, source_of
from tasks.settings.run_settings import RunError, RunSettings

SMALLEST_CHUNK: Final = 25
LARGEST_CHUNK: Final = 100  # a second of work
PATIENCE: Final = 2  # problems asked a wanted candidate, once there are as many as must be kept
GIVE_UP: Final = 20  # problems asked a wanted experience; a class this hard is no class to remember

Results = Mapping[Chunk, Mapping[str, Any]]


def collect_chunk(chunk: Chunk) -> dict[str, Any]:
    """Solve a range of a class's problems; write those solved, each plan checked by the authority.

    What the run of a retraining's champion has from the same key is taken over.
    """
    place, asked = chunk.run.shard("candidates", chunk.class_name, chunk.index), chunk.last - chunk.first
    before = champion_run_of(chunk)
    if before is not None:
        known = before.folder.shard("candidates", chunk.class_name, chunk.index)
        if shard_is_done(known, chunk.key):
            return {"solved": copy_experiences(known, place, chunk.key), "asked": asked}
    source = source_of(chunk.data, chunk.settings, chunk.class_name)
    planner, seed = chunk.settings.collector, chunk.settings.seed
    vehicle = vehicle_named(chunk.settings.vehicle)
    workspace = Workspace()
    experiences, seconds = [], []
    for index in range(chunk.first, chunk.last):
        problem = source.problem("collect", index)
        attempt = solve(problem, planner, seed=seed, vehicle=vehicle, workspace=workspace)
        if attempt.plan is not None:
            check_attempt(problem, attempt, set(), vehicle)
            experiences.append(Experience(problem, attempt.plan, vehicle))
            seconds.append(attempt.planning_seconds)
    write_experiences(
        place,
        experiences,
        planner=planner,
        seeds=[seed] * len(experiences),
        planning_seconds=seconds,
        key=chunk.key,
        vehicle=vehicle,
    )
    return {"solved": len(experiences), "asked": asked}


collect_problems = chunk_task(collect_chunk)


def is_collected(chunk: Chunk) -> bool:
    """Whether the chunk's shard is there."""
    return shard_is_done(chunk.run.shard("candidates", chunk.class_name, chunk.index), chunk.key)


def chunks_wanted(data: str, settings: RunSettings, done: Results) -> list[Chunk]:
    """The chunks to do next so that each class gets its candidates; none when all have them.

    A class with too few, or too few that are solved, makes do with them if they suffice for its experiences;
    else a RunError.
    """
    return [chunk for name in settings.class_names for chunk in _chunks_wanted(data, settings, name, done)]


def _chunks_wanted(data: str, settings: RunSettings, class_name: str, done: Results) -> list[Chunk]:
    results = [result for chunk, result in done.items() if chunk.class_name == class_name]
    solved = sum(result["solved"] for result in results)
    asked = sum(result["asked"] for result in results)
    enough = solved >= settings.experiences
    missing = settings.wanted - solved
    if missing <= 0 or (enough and asked >= PATIENCE * settings.wanted):
        return []
    size = max(SMALLEST_CHUNK, min(LARGEST_CHUNK, settings.wanted // 10))
    expected = missing * max(asked, 1) // max(solved, 1) + 1 if asked else missing
    more = -(-min(expected, settings.wanted) // size) * size
    until = source_of(data, settings, class_name).count("collect", asked + more)
    if enough and until <= asked:
        return []
    if until <= asked or asked >= GIVE_UP * settings.experiences + size:
        raise RunError(
            f"Class {class_name}: {solved} of {asked} problems solved, {settings.experiences} are wanted; "
            "ask for fewer, or take easier problems."
        )
    inputs = [settings.seed, settings.collector, *source_key(settings, class_name)]
    return chunks_of(data, settings, "collect", class_name, until, size, inputs)[len(results) :]


def experiences_key(data: str, settings: RunSettings, class_name: str) -> str:
    """The key under which a class's experiences were written; a StorageError where there are none."""
    return metadata_of(run_folder(data, settings).experiences(class_name))[b"key"].decode()
