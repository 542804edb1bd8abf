"""Hallucinate: for every stored plan many problems that it solves, each with its exact label vector."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from planners.memory.hallucination import hallucinate, no_plan
from planners.memory.labels import PlanSweeps, free_plans, sweep_plans
from planners.world.collision import scene_of
from planners.world.occupancy import occupancy_of
from planners.world.problem import Problem
from planners.world.randomness import generator
from planners.world.vehicle import vehicle_named
from storage.experiences import read_experiences
from storage.hallucinated import (
    read_hallucinated_problems,
    read_labelled,
    read_methods,
    write_hallucinated,
)
from storage.shards import shard_is_done
from tasks.caching import Chunk, chunk_task, chunks_of
from tasks.collect import experiences_key
from tasks.settings import COMBINED, RunSettings
from tasks.worlds import source_key, source_of

CHUNK_PROBLEMS: Final = 5_000  # some 10 s of work
METHOD: Final = "rearrange"
NO_PLAN: Final = "no-plan"
NO_PLAN_SHARE: Final = 0.05  # problems of S_0 for each one that is made for a plan
DRAWN: Final = "drawn"
DRAWN_SHARE: Final = 0.5  # likewise of problems as the class has them


def hallucinate_chunk(chunk: Chunk) -> dict[str, Any]:
    """Make the problems of a range of experiences, problems that no plan solves, and some as they come.

    The last are what a robot meets: labelled like the others, they teach which plans are free there.
    """
    settings, name = chunk.settings, chunk.class_name
    source = source_of(chunk.data, settings, name)
    vehicle = vehicle_named(settings.vehicle)
    experiences = read_experiences(chunk.run.experiences(name), vehicle)
    sweeps = sweep_plans([experience.plan for experience in experiences], vehicle)
    problems, plan_index = [], []
    for i in range(chunk.first, chunk.last):
        problems.append(experiences[i].problem)
        for index in range(1, settings.problems_per_experience):
            rng = generator(settings.seed, "hallucinate", name, i, index)
            problems.append(hallucinate(METHOD, experiences[i], source.draw, rng, index))
        plan_index += [i] * settings.problems_per_experience
    unsolved = max(1, round(NO_PLAN_SHARE * len(problems)))
    bounds = experiences[0].problem.bounds
    for index in range(chunk.index * unsolved, (chunk.index + 1) * unsolved):
        rng = generator(settings.seed, NO_PLAN, name, index)
        problems.append(no_plan(sweeps, source.draw, rng, name, index, bounds))
    wanted = round(DRAWN_SHARE * settings.experiences * settings.problems_per_experience)
    drawn = source.count("collect", wanted)  # a folder of worlds has no more than these
    first, last = (drawn * i // settings.experiences for i in (chunk.first, chunk.last))
    problems += [source.problem("collect", index) for index in range(first, last)]
    methods = [METHOD] * len(plan_index) + [NO_PLAN] * unsolved + [DRAWN] * (last - first)
    _write(chunk, problems, plan_index + [-1] * (unsolved + last - first), methods, sweeps)
    return {"problems": len(problems)}


hallucinate_problems = chunk_task(hallucinate_chunk)


def is_hallucinated(chunk: Chunk) -> bool:
    """Whether the chunk's shard is there."""
    return shard_is_done(chunk.run.shard("hallucinated", chunk.class_name, chunk.index), chunk.key)


def hallucination_chunks(data: str, settings: RunSettings) -> list[Chunk]:
    """Chunks of experiences of every class."""
    size = max(1, CHUNK_PROBLEMS // settings.problems_per_experience)
    return [
        chunk
        for name in settings.class_names
        for chunk in chunks_of(
            data,
            settings,
            "hallucinate",
            name,
            settings.experiences,
            size,
            [
                settings.seed,
                settings.problems_per_experience,
                experiences_key(data, settings, name),
                *source_key(settings, name),
            ],
        )
    ]


def relabel_chunk(chunk: Chunk) -> dict[str, Any]:
    """Label one shard of one class for the plans of all classes: a shard of the combined memory."""
    run, settings = chunk.run, chunk.settings
    origin = hallucination_chunks(chunk.data, settings)[chunk.index]
    place = run.shard("hallucinated", origin.class_name, origin.index)
    offset = settings.class_names.index(origin.class_name) * settings.experiences
    plan_index = [i + offset if i >= 0 else i for i in read_labelled([place]).plan_index.tolist()]
    vehicle = vehicle_named(settings.vehicle)
    experiences = read_experiences(run.experiences(COMBINED), vehicle)
    sweeps = sweep_plans([experience.plan for experience in experiences], vehicle)
    _write(chunk, read_hallucinated_problems(place), plan_index, read_methods(place), sweeps)
    return {"problems": len(plan_index)}


relabel_problems = chunk_task(relabel_chunk)


def relabel_chunks(data: str, settings: RunSettings) -> list[Chunk]:
    """One chunk for each shard of hallucinated problems, if the run has a combined memory."""
    if not settings.combined:
        return []
    keys = [chunk.key for chunk in hallucination_chunks(data, settings)]
    inputs = [experiences_key(data, settings, COMBINED), *keys]
    return chunks_of(data, settings, "relabel", COMBINED, len(keys), 1, inputs)


def _write(
    chunk: Chunk,
    problems: Sequence[Problem],
    plan_index: Sequence[int],
    methods: Sequence[str],
    sweeps: PlanSweeps,
) -> None:
    """Write problems, grids and labels; those made for no plan have plan index -1."""
    grids = np.stack([np.packbits(occupancy_of(problem)) for problem in problems])
    free = np.stack([free_plans(sweeps, scene_of(problem)) for problem in problems])
    write_hallucinated(
        chunk.run.shard("hallucinated", chunk.class_name, chunk.index),
        problems,
        plan_index=plan_index,
        methods=methods,
        grids=grids,
        labels=np.packbits(free, axis=1),
        plans=free.shape[1],
        key=chunk.key,
    )
