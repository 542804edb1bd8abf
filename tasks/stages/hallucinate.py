"""Hallucinate: for every stored plan many problems that it solves, each with its exact label vector."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from typing import Any, Final

import numpy as np

from planners.memory.hallucination.mixture import LEARNED, hallucinate
from planners.memory.hallucination.no_plan import no_plan
from planners.memory.labelling import label_problems
from planners.memory.plans.experience import Experience
from planners.memory.plans.sweeps import PlanSweeps, sweep_plans
from planners.world.arrays import Integers
from planners.world.problem import Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import vehicle_named
from storage.archives.hallucinators import load_hallucinator
from storage.errors import StorageError
from storage.tables.hallucinated import (
    read_hallucinated_problems,
    read_labelled,
    read_methods,
    write_hallucinated,
)
from storage.tables.shards import shard_is_done
from tasks.fan_out.stage import Chunk, chunk_task, chunks_of
from tasks.inputs.champion_run import champion_run_of
from tasks.inputs.problem_sources import source_key, source_of
from tasks.inputs.taught_experiences import taught_experiences
from tasks.settings.run_settings import COMBINED, RunSettings
from tasks.stages.collect import experiences_key

CHUNK_PROBLEMS: Final = 5_000  # some seconds of work
NO_PLAN: Final = "no-plan"
NO_PLAN_SHARE: Final = 0.05  # problems of S_0 for each one that is made for a plan
DRAWN: Final = "drawn"
DRAWN_SHARE: Final = 1.0  # likewise of problems as the class has them
ORIGIN: Final = "origin"  # a problem that was collected


def hallucinate_chunk(chunk: Chunk) -> dict[str, Any]:
    """Make the problems of a range of experiences, problems that no plan solves, and some as they come.

    The last are what a robot meets: labelled like the others, they teach which plans are free there.
    """
    settings, name = chunk.settings, chunk.class_name
    source = source_of(chunk.data, settings, name)
    vehicle = vehicle_named(settings.vehicle)
    experiences = taught_experiences(chunk.run, settings, name)
    sweeps = sweep_plans([experience.plan for experience in experiences], vehicle)
    mixture = dict(settings.hallucination)
    weights = load_hallucinator(chunk.run.hallucinator(name), vehicle) if LEARNED in mixture else None
    problems: list[Problem] = []
    methods: list[str] = []
    taken = known_problems(chunk, experiences[chunk.first : chunk.last])
    for experience in experiences[chunk.first : chunk.last]:
        known = taken.get(mark_of(experience))
        if known is None:
            rng = generator(settings.seed, "hallucinate", name, experience.problem.id)
            made = hallucinate(experience, mixture, source.draw, rng, weights)
            known = [(experience.problem, ORIGIN), *islice(made, settings.problems_per_experience - 1)]
        problems += [problem for problem, _ in known]
        methods += [method for _, method in known]
    made_for = np.repeat(np.arange(chunk.first, chunk.last), settings.problems_per_experience)
    share = NO_PLAN_SHARE * settings.problems_per_experience
    first, last = round(share * chunk.first), round(share * chunk.last)
    for index in range(first, max(last, first + 1)):
        rng = generator(settings.seed, NO_PLAN, name, index)
        problems.append(no_plan(sweeps, source.draw, rng, name, index, experiences[0].problem.bounds))
        methods.append(NO_PLAN)
    wanted = round(DRAWN_SHARE * settings.taught * settings.problems_per_experience)
    drawn = source.count("collect", wanted)  # a folder of worlds has no more than these
    first, last = (drawn * i // settings.taught for i in (chunk.first, chunk.last))
    problems += [source.problem("collect", index) for index in range(first, last)]
    methods += [DRAWN] * (last - first)
    for_none = np.full(len(problems) - len(made_for), -1)
    _write(chunk, problems, np.concatenate([made_for, for_none]).astype(np.int32), methods, sweeps)
    return {"problems": len(problems), "taken": len(taken), "plans": chunk.last - chunk.first}


hallucinate_problems = chunk_task(hallucinate_chunk)


def is_hallucinated(chunk: Chunk) -> bool:
    """Whether the chunk's shard is there."""
    return shard_is_done(chunk.run.shard("hallucinated", chunk.class_name, chunk.index), chunk.key)


def hallucination_chunks(data: str, settings: RunSettings) -> list[Chunk]:
    """Chunks of experiences of every class."""
    return [chunk for name in settings.class_names for chunk in _chunks(data, settings, name)]


def _chunks(data: str, settings: RunSettings, name: str) -> list[Chunk]:
    inputs = [*_making(settings, name), experiences_key(data, settings, name)]
    return chunks_of(data, settings, "hallucinate", name, settings.taught, plans_at_once(settings), inputs)


def plans_at_once(settings: RunSettings) -> int:
    """Plans a shard."""
    return max(1, CHUNK_PROBLEMS // settings.problems_per_experience)


def _making(settings: RunSettings, name: str) -> list[Any]:
    """All but experiences that problems around a plan depend on."""
    made = [settings.seed, settings.problems_per_experience, settings.hallucination]
    return [*made, *source_key(settings, name)]


def mark_of(experience: Experience) -> tuple[str, bytes]:
    """What tells an experience from all others: its problem and its plan."""
    return experience.problem.id, experience.plan.states.tobytes() + experience.plan.controls.tobytes()


def known_problems(
    chunk: Chunk, experiences: Sequence[Experience]
) -> dict[tuple[str, bytes], list[tuple[Problem, str]]]:
    """What the run of the champion made for some of these experiences, with methods, in its order.

    The same would be made again: it depends on nothing but experience, settings and code. (A network that
    hallucinates depends on all experiences; so nothing of that is known.)
    """
    before, name = champion_run_of(chunk), chunk.class_name
    if before is None or LEARNED in dict(chunk.settings.hallucination):
        return {}
    alike = _making(before.settings, name) == _making(chunk.settings, name)
    if not alike or (name not in chunk.settings.classes and before.settings.wanted != chunk.settings.wanted):
        return {}  # from a map as many problems are cut as are wanted
    wanted = {mark_of(experience) for experience in experiences}
    try:
        theirs = [mark_of(each) for each in taught_experiences(before.folder, before.settings, name)]
        shards = [part for part in _chunks(chunk.data, before.settings, name) if is_hallucinated(part)]
    except StorageError:  # it is not whole any more
        return {}
    known: dict[tuple[str, bytes], list[tuple[Problem, str]]] = {}
    for part in shards:
        if not wanted.isdisjoint(theirs[part.first : part.last]):
            place = part.run.shard("hallucinated", name, part.index)
            made_for = read_labelled([place]).plan_index.tolist()
            rows = zip(made_for, read_hallucinated_problems(place), read_methods(place), strict=True)
            for plan, problem, method in rows:
                if plan >= 0 and theirs[plan] in wanted:
                    known.setdefault(theirs[plan], []).append((problem, method))
    return known


def tell_taken(results: Sequence[dict[str, Any]]) -> None:
    """Say of how many plans the problems were there already, if they were of some."""
    taken, plans = (sum(result[name] for result in results) for name in ("taken", "plans"))
    if taken:
        print(f"hallucinated anew for {plans - taken} of {plans} plans; the champion's run had the others'")


def relabel_chunk(chunk: Chunk) -> dict[str, Any]:
    """Label one shard of one class for the plans of all classes: a shard of the combined memory."""
    run, settings = chunk.run, chunk.settings
    origin = hallucination_chunks(chunk.data, settings)[chunk.index]
    place = run.shard("hallucinated", origin.class_name, origin.index)
    offset = settings.class_names.index(origin.class_name) * settings.taught
    made_for = read_labelled([place]).plan_index
    vehicle = vehicle_named(settings.vehicle)
    experiences = taught_experiences(run, settings, COMBINED)
    sweeps = sweep_plans([experience.plan for experience in experiences], vehicle)
    problems = read_hallucinated_problems(place)
    offsets = np.where(made_for >= 0, np.int32(offset), np.int32(0))
    _write(chunk, problems, made_for + offsets, read_methods(place), sweeps)
    return {"problems": len(problems)}


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
    made_for: Integers,
    methods: Sequence[str],
    sweeps: PlanSweeps,
) -> None:
    """Write problems, grids and labels; ``made_for`` is -1 for those made for no plan.

    RuntimeError: a plan does not solve a problem that was made for it.
    """
    grids, free = label_problems(problems, sweeps)
    denied = np.flatnonzero((made_for >= 0) & ~free[np.arange(len(problems)), made_for])
    if len(denied):
        raise RuntimeError(f"{problems[denied[0]].id} is not solved by the plan that it was made for")
    write_hallucinated(
        chunk.run.shard("hallucinated", chunk.class_name, chunk.index),
        problems,
        plan_index=made_for,
        methods=methods,
        grids=grids,
        labels=np.packbits(free, axis=1),
        plans=free.shape[1],
        key=chunk.key,
    )
