"""Keep: the chosen experiences of each class as one file, with better plans if the run asks for them."""

from __future__ import annotations

from typing import Final

from planners.world.authority.authority import faults
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import Vehicle
from storage.tables.experiences import merge_experiences, read_experiences, replace_plans
from storage.tables.shards import metadata_of
from tasks.attempts.attempt_rows import PlanFaultError
from tasks.fan_out.chunk import Chunk, Cut, run_folder
from tasks.fan_out.stage import Stage
from tasks.settings.run_settings import COMBINED, RunSettings
from tasks.stages.curate import CURATE

IMPROVED_AT_ONCE: Final = 25  # plans, a second each
CLEARANCE_WEIGHT: Final = 1.0  # buys most of a metre of clearance for half a second (docs/optimisation.md)


def improve_chunk(chunk: Chunk) -> None:
    """Make a range of a class's chosen plans shorter and clearer, each checked by the authority."""
    curated = chunk.run.shard("curated", chunk.class_name, 0)
    kept = read_experiences(curated, chunk.vehicle)[chunk.first : chunk.last]
    plans = [_improved(each.problem, each.plan, chunk.vehicle) for each in kept]
    for each, plan in zip(kept, plans, strict=True):
        for fault in faults(each.problem, plan, chunk.vehicle):
            raise PlanFaultError(f"{each.problem.id} optimised: {fault}")
    replace_plans(curated, chunk.shard("experiences"), chunk.first, plans, chunk.key)


def _improved(problem: Problem, plan: Plan, vehicle: Vehicle) -> Plan:
    """The plan made shorter and clearer; the same plan if that fails."""
    from planners.optimisation.optimise import DEFAULT_SETTINGS, refined  # late: few runs need CasADi

    weights = DEFAULT_SETTINGS.weights._replace(clearance_weight=CLEARANCE_WEIGHT)
    return refined(problem, plan, DEFAULT_SETTINGS._replace(weights=weights), vehicle)


IMPROVE: Final = Stage(
    name="optimise",
    do=improve_chunk,
    classes=lambda settings: settings.class_names if settings.optimised else (),
    cut=lambda data, settings, name: Cut(
        settings.experiences, IMPROVED_AT_ONCE, CURATE.keys(data, settings, name)
    ),
    output=lambda chunk: chunk.shard("experiences"),
)


def keep_chunk(chunk: Chunk) -> None:
    """Write the experiences of a class into one file."""
    data, settings, name = chunk.data, chunk.settings, chunk.class_name
    stage = _before(settings)
    shards = [stage.output(each) for each in stage.chunks_of(data, settings, name)]
    merge_experiences(shards, chunk.run.experiences(name), range(settings.experiences), chunk.key)


def _before(settings: RunSettings) -> Stage[None]:
    return IMPROVE if settings.optimised else CURATE


KEEP: Final = Stage(
    name="keep",
    do=keep_chunk,
    cut=lambda data, settings, name: Cut(1, 1, _before(settings).keys(data, settings, name)),
    output=lambda chunk: chunk.run.experiences(chunk.class_name),
)


def combine_chunk(chunk: Chunk) -> None:
    """Write the experiences of all classes into one file, for the combined memory."""
    run, settings = chunk.run, chunk.settings
    files = [run.experiences(name) for name in settings.class_names]
    merge_experiences(files, run.experiences(COMBINED), range(settings.experiences * len(files)), chunk.key)


COMBINE: Final = Stage(
    name="combine",
    do=combine_chunk,
    classes=lambda settings: (COMBINED,) if settings.combined else (),
    cut=lambda data, settings, _: Cut(
        1, 1, [experiences_key(data, settings, name) for name in settings.class_names]
    ),
    output=lambda chunk: chunk.run.experiences(COMBINED),
)


def experiences_key(data: str, settings: RunSettings, name: str) -> str:
    """The key under which the experiences of a class were written; StorageError if there are none."""
    return metadata_of(run_folder(data, settings).experiences(name))[b"key"].decode()
