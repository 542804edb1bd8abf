"""Curate: of all solved problems of a class keep the N of most use, and improve their plans if asked."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from typing import Any, Final

from planners.memory.curation import curate
from planners.memory.plans.experience import Experience
from planners.world.authority.authority import faults
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import Vehicle, vehicle_named
from storage.places.data_folder import open_data_folder
from storage.tables.experiences import merge_experiences, read_experiences, replace_plans
from storage.tables.learned_experiences import extract_class, snapshot_path
from storage.tables.shards import shard_is_done
from tasks.attempts.attempt_rows import PlanFaultError
from tasks.fan_out.keys import key_of
from tasks.fan_out.stage import Chunk, chunk_task, chunks_of, run_folder
from tasks.inputs.problem_sources import held_back, source_of
from tasks.settings.run_settings import COMBINED, RunSettings
from tasks.stages.collect import Results, experiences_key

IMPROVED_AT_ONCE: Final = 25  # plans, a second each
CLEARANCE_WEIGHT: Final = 1.0  # buys most of a metre of clearance for half a second (docs/optimisation.md)


def curate_chunk(chunk: Chunk) -> dict[str, Any]:
    """Choose among the candidates of a class, which lie in shards ``first`` to before ``last``."""
    run, settings, name = chunk.run, chunk.settings, chunk.class_name
    vehicle = vehicle_named(settings.vehicle)
    shards = [run.shard("candidates", name, i) for i in range(chunk.first, chunk.last)]
    drawn = [each for shard in shards for each in read_experiences(shard, vehicle)]
    learned = _learned_of(chunk, vehicle)
    rows = chosen(drawn, learned, settings)
    shards += [run.shard("learned", name, 0)] if learned else []
    merge_experiences(shards, run.shard("curated", name, 0), rows, chunk.key)
    return {"candidates": min(len(drawn), settings.wanted) + len(learned), "kept": len(rows)}


def chosen(drawn: Sequence[Experience], learned: Sequence[Experience], settings: RunSettings) -> list[int]:
    """Which to keep of what was drawn and learned of a class, numbered in this order, the best first."""
    rows = _alternating(range(min(len(drawn), settings.wanted)), range(len(drawn), len(drawn) + len(learned)))
    everything = [*drawn, *learned]
    candidates = [everything[row] for row in rows]
    kept = curate(candidates, settings.taught, vehicle_named(settings.vehicle)).tolist()
    if settings.grown:  # the others join these: which ones hardly matters
        others = sorted(set(range(len(candidates))) - set(kept))
        kept += others[: settings.experiences - len(kept)]
    return [rows[i] for i in kept]


def _learned_of(chunk: Chunk, vehicle: Vehicle) -> list[Experience]:
    """What was learned of the class, as a shard of the run; problems that the run is measured by stay out."""
    settings, name = chunk.settings, chunk.class_name
    if not settings.learned:
        return []
    sources = [each(chunk.data, settings, name) for each in (source_of, held_back)]
    tested = {
        source.problem("test", i).id
        for source in sources
        for i in range(source.count("test", settings.test_problems))
    }
    snapshot = snapshot_path(open_data_folder(chunk.data).learned(settings.vehicle), settings.learned)
    shard = chunk.run.shard("learned", name, 0)
    extract_class(snapshot, name, tested, shard, chunk.key)
    return read_experiences(shard, vehicle)


def _alternating(ours: Sequence[int], theirs: Sequence[int]) -> list[int]:
    """One of these, one of those: of both are the first, which curation covers."""
    pairs = zip_longest(ours, theirs)
    return [row for pair in pairs for row in pair if row is not None]


curate_candidates = chunk_task(curate_chunk)


def is_curated(chunk: Chunk) -> bool:
    """Whether the choice of a class is there."""
    return shard_is_done(chunk.run.shard("curated", chunk.class_name, 0), chunk.key)


def curation_chunks(data: str, settings: RunSettings, done: Results) -> list[Chunk]:
    """One chunk for each class, of all that was collected of it."""
    chunks = []
    for name in settings.class_names:
        of_class = sorted((each for each in done if each.class_name == name), key=lambda each: each.index)
        inputs = [settings.wanted, settings.experiences, settings.learned, *(each.key for each in of_class)]
        chunks += chunks_of(data, settings, "curate", name, len(of_class), len(of_class), inputs)
    return chunks


def improve_chunk(chunk: Chunk) -> dict[str, Any]:
    """Make a range of the kept plans of a class shorter and clearer, each checked by the authority."""
    vehicle = vehicle_named(chunk.settings.vehicle)
    curated = chunk.run.shard("curated", chunk.class_name, 0)
    kept = read_experiences(curated, vehicle)[chunk.first : chunk.last]
    plans = [_improved(each.problem, each.plan, vehicle) for each in kept]
    for each, plan in zip(kept, plans, strict=True):
        for wrong in faults(each.problem, plan, vehicle):
            raise PlanFaultError(f"{each.problem.id} optimised: {wrong}")
    place = chunk.run.shard("experiences", chunk.class_name, chunk.index)
    replace_plans(curated, place, chunk.first, plans, chunk.key)
    return {"improved": len(plans)}


improve_kept = chunk_task(improve_chunk)


def is_improved(chunk: Chunk) -> bool:
    """Whether the chunk's shard is there."""
    return shard_is_done(chunk.run.shard("experiences", chunk.class_name, chunk.index), chunk.key)


def improvement_chunks(data: str, settings: RunSettings, curated: Sequence[Chunk]) -> list[Chunk]:
    """Chunks of the kept plans of every class, if they are to be improved."""
    return [
        chunk
        for each in curated
        if settings.optimised
        for chunk in chunks_of(
            data, settings, "improve", each.class_name, settings.experiences, IMPROVED_AT_ONCE, [each.key]
        )
    ]


def keep_experiences(
    data: str, settings: RunSettings, curated: Sequence[Chunk], improved: Sequence[Chunk]
) -> None:
    """Write the kept experiences of each class as one file, and those of all classes if that is wanted."""
    run = run_folder(data, settings)
    for name in settings.class_names:
        chunks = [chunk for chunk in improved or curated if chunk.class_name == name]
        key = key_of("experiences", *(chunk.key for chunk in chunks))
        shards = [run.shard("experiences" if improved else "curated", name, chunk.index) for chunk in chunks]
        if not shard_is_done(run.experiences(name), key):
            merge_experiences(shards, run.experiences(name), range(settings.experiences), key)
    if settings.combined:
        parts = [run.experiences(name) for name in settings.class_names]
        key = key_of("combined", *(experiences_key(data, settings, name) for name in settings.class_names))
        if not shard_is_done(run.experiences(COMBINED), key):
            everything = range(settings.experiences * len(parts))
            merge_experiences(parts, run.experiences(COMBINED), everything, key)


def _improved(problem: Problem, plan: Plan, vehicle: Vehicle) -> Plan:
    """The plan made shorter and clearer; as it is where that fails."""
    from planners.optimisation.optimise import DEFAULT_SETTINGS, improve  # late: few runs need CasADi

    objective = DEFAULT_SETTINGS.objective._replace(clearance_weight=CLEARANCE_WEIGHT)
    return improve(problem, plan, DEFAULT_SETTINGS._replace(objective=objective), vehicle)
