"""Collect: draw problems of a class, solve them, check every plan, keep the first N with their plans."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from planners.memory.experience import Experience
from planners.solve import solve
from planners.world.problem import Plan, Problem
from planners.world.vehicle import Vehicle, vehicle_named
from storage.experiences import merge_experiences, write_experiences
from storage.shards import metadata_of, shard_is_done
from tasks.attempts import check_attempt
from tasks.caching import Chunk, chunk_task, chunks_of, key_of, run_folder
from tasks.settings import COMBINED, RunError, RunSettings
from tasks.worlds import source_key, source_of

CHUNK_PROBLEMS: Final = 25
CLEARANCE_WEIGHT: Final = 1.0  # buys most of a metre of clearance for half a second (docs/optimisation.md)
SPARE: Final = 1.1  # problems asked for each one still wanted: some are not solved
GIVE_UP: Final = 20  # problems asked a wanted one; a class this hard is no class to remember

Results = Mapping[Chunk, Mapping[str, Any]]


def collect_chunk(chunk: Chunk) -> dict[str, Any]:
    """Solve a range of a class's problems; write those solved, each plan checked by the authority."""
    source = source_of(chunk.data, chunk.settings, chunk.class_name)
    planner, seed = chunk.settings.collector, chunk.settings.seed
    vehicle = vehicle_named(chunk.settings.vehicle)
    experiences, seconds = [], []
    for index in range(chunk.first, chunk.last):
        problem = source.problem("collect", index)
        attempt = solve(problem, planner, seed=seed, vehicle=vehicle)
        plan = attempt.plan
        if plan is None:
            continue
        if chunk.settings.optimised:
            plan = _optimised(problem, plan, vehicle)
        check_attempt(problem, replace(attempt, plan=plan), set(), vehicle)
        experiences.append(Experience(problem, plan, vehicle))
        seconds.append(attempt.planning_seconds)
    write_experiences(
        chunk.run.shard("experiences", chunk.class_name, chunk.index),
        experiences,
        planner=planner,
        seeds=[seed] * len(experiences),
        planning_seconds=seconds,
        key=chunk.key,
        vehicle=vehicle,
    )
    return {"solved": len(experiences), "asked": chunk.last - chunk.first}


def _optimised(problem: Problem, plan: Plan, vehicle: Vehicle) -> Plan:
    """The plan made shorter and clearer; as it is where that fails."""
    from planners.optimisation.optimise import DEFAULT_SETTINGS, improve  # late: few runs need CasADi

    objective = DEFAULT_SETTINGS.objective._replace(clearance_weight=CLEARANCE_WEIGHT)
    return improve(problem, plan, DEFAULT_SETTINGS._replace(objective=objective), vehicle)


collect_problems = chunk_task(collect_chunk)


def is_collected(chunk: Chunk) -> bool:
    """Whether the chunk's shard is there."""
    return shard_is_done(chunk.run.shard("experiences", chunk.class_name, chunk.index), chunk.key)


def chunks_wanted(data: str, settings: RunSettings, done: Results) -> list[Chunk]:
    """The chunks to do next so that each class gets its N experiences; none when all have them."""
    return [chunk for name in settings.class_names for chunk in _chunks_wanted(data, settings, name, done)]


def _chunks_wanted(data: str, settings: RunSettings, class_name: str, done: Results) -> list[Chunk]:
    results = [result for chunk, result in done.items() if chunk.class_name == class_name]
    solved = sum(result["solved"] for result in results)
    asked = sum(result["asked"] for result in results)
    missing = settings.experiences - solved
    if missing <= 0:
        return []
    more = -(-max(round(SPARE * missing), missing + 1) // CHUNK_PROBLEMS) * CHUNK_PROBLEMS
    until = source_of(data, settings, class_name).count("collect", asked + more)
    if until <= asked or asked >= GIVE_UP * settings.experiences + CHUNK_PROBLEMS:
        raise RunError(
            f"Class {class_name}: {solved} of {asked} problems solved, {settings.experiences} are wanted; "
            "ask for fewer, or take easier problems."
        )
    inputs = [settings.seed, settings.collector, settings.optimised, *source_key(settings, class_name)]
    return chunks_of(data, settings, "collect", class_name, until, CHUNK_PROBLEMS, inputs)[len(results) :]


def keep_experiences(data: str, settings: RunSettings, done: Results) -> None:
    """Write the first N experiences of each class, in the order of the problems, as one file."""
    run = run_folder(data, settings)
    for name in settings.class_names:
        chunks = sorted((chunk for chunk in done if chunk.class_name == name), key=lambda chunk: chunk.index)
        key = key_of("experiences", settings.experiences, *(chunk.key for chunk in chunks))
        shards = [run.shard("experiences", name, chunk.index) for chunk in chunks]
        if not shard_is_done(run.experiences(name), key):
            merge_experiences(shards, run.experiences(name), settings.experiences, key)
    if settings.combined:
        parts = [run.experiences(name) for name in settings.class_names]
        key = key_of("combined", *(experiences_key(data, settings, name) for name in settings.class_names))
        if not shard_is_done(run.experiences(COMBINED), key):
            merge_experiences(parts, run.experiences(COMBINED), settings.experiences * len(parts), key)


def experiences_key(data: str, settings: RunSettings, class_name: str) -> str:
    """The key under which a class's experiences were written; a StorageError where there are none."""
    return metadata_of(run_folder(data, settings).experiences(class_name))[b"key"].decode()
