"""The command ``adapt``: drive the plans of a memory with another vehicle, and keep those that pass."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple

from planners.memory.adaptation import Outcome
from planners.memory.growth import grow
from planners.memory.library.plan_library import PlanLibrary, gathered_library
from planners.memory.memory import Memory
from planners.memory.plans.experience import Experience
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.vehicles.vehicle import Vehicle, name_of
from storage.archives.libraries import (
    HEADERS,
    load_memory_or_library,
    save_library,
    vehicle_of,
)
from storage.archives.memories import save_memory
from storage.tables.experiences import read_experiences
from storage.vehicles.definitions import is_built_in
from storage.vehicles.vehicle_files import label_of, said_vehicle
from tasks.registry.memory_at import memory_at
from tasks.requests.adapt_pieces import ADAPT, AdaptRequest, Driven
from tasks.requests.part_folder import (
    do_here,
    part_workers,
    refuse_existing,
    remove_parts,
    unfinished,
)
from tasks.settings.checks import check_outputs, check_seed, checked_vehicle
from tasks.settings.errors import RunError

AdaptFlow = Callable[[AdaptRequest], Sequence[Driven]]

FEW_PLANS: Final = 200  # driving so few takes less time here than starting a server and workers
LABELLED: Final = 500  # problems of each class, from which the readout of a memory is fitted again
GOOD: Final = (Outcome.WHOLE, Outcome.PART)


class Kept(NamedTuple):
    """The outcomes of the stored plans."""

    summary: str
    answer: dict[str, Any]  # for programs


def adapt(
    memory: str, vehicle: str, out: Path, seed: int, workers: int = 1, flow: AdaptFlow | None = None
) -> Kept:
    """Drive the plans of a memory or a library with another vehicle, and write those that pass.

    With the same arguments, the written files are the same to the byte for any number of workers. If the
    command was killed, it drives only the remaining plans when it is repeated.

    Args:
        memory: the address of a memory or a library: a folder, a run, or a model in MLflow.
        vehicle: the other vehicle: a name, or the path of a file.
        out: the folder to write, which must not be there.
        seed: seed of the problems from which the readout of a memory is fitted again.
        workers: number of worker processes.
        flow: does the pieces in worker processes; None does everything in this process.

    Raises:
        UsageError: a name or a number is wrong, or ``out`` exists.
        StorageError: the memory cannot be read.
        RunError: no plan can be kept.
    """
    check_seed(seed)
    new = said_vehicle(checked_vehicle(vehicle))
    with memory_at(memory) as folder:
        check_outputs([folder], [out])
        refuse_existing(out)
        old = vehicle_of(folder)
        stored = load_memory_or_library(folder, old)
        header = next(folder / name for name in HEADERS if (folder / name).is_file())
        digest = hashlib.sha256(header.read_bytes()).hexdigest()
        request = AdaptRequest(folder.absolute(), digest, len(stored.plans), old, new, out)
        with unfinished(out):
            if flow is None or workers == 1 or request.plans <= FEW_PLANS:
                results: Sequence[Driven] = do_here(ADAPT, request.pieces)
            else:
                with part_workers(out, workers):
                    results = flow(request)
            kept = [each for piece in request.pieces for each in read_experiences(piece.shard, new)]
            told = _told(old, new, [Outcome[name] for result in results for name in result.outcomes])
            if not kept:
                remove_parts(out)
                raise RunError(f"{told.summary}. Gather plans for {name_of(new)} instead.")
            _save(out, stored, new, kept, seed)
            remove_parts(out)
    return told


def _told(old: Vehicle, new: Vehicle, outcomes: Sequence[Outcome]) -> Kept:
    counts = Counter(outcomes)
    good = sum(counts[each] for each in GOOD)
    dropped = {each: counts[each] for each in Outcome if counts[each] and each not in GOOD}
    parts = f" ({counts[Outcome.PART]} of them {Outcome.PART})" if counts[Outcome.PART] else ""
    why = "; not kept: " + ", ".join(f"{count} {each}" for each, count in dropped.items()) if dropped else ""
    answer = {
        "vehicle": label_of(new),
        "made_for": label_of(old),
        "plans": len(outcomes),
        "kept": good,
        "kept_from_a_later_stop": counts[Outcome.PART],
        "not_kept": {each.name.lower(): count for each, count in dropped.items()},
    }
    return Kept(f"{good} of {len(outcomes)} plans kept for {name_of(new)}{parts}{why}", answer)


def _save(
    out: Path, stored: Memory | PlanLibrary, vehicle: Vehicle, kept: Sequence[Experience], seed: int
) -> None:
    scales = stored.scales if is_built_in(vehicle) else (vehicle.scale,)
    if isinstance(stored, PlanLibrary):
        answered = [(each.problem.id, each.plan) for each in kept]
        save_library(out, gathered_library(stored.class_name, vehicle, answered, scales))
        return
    metadata = {"adapted_from": label_of(stored.vehicle), "scales": list(scales)}
    begun = replace(stored, vehicle=vehicle, metadata=metadata)
    names = [name for name in stored.metadata.get("classes", [stored.class_name]) if name in CLASSES]
    problems = [
        problem_class(name, vehicle=vehicle).draw(seed, index)
        for name in names or CLASSES
        for index in range(LABELLED)
    ]
    save_memory(out, grow(begun, [each.plan for each in kept], problems))
