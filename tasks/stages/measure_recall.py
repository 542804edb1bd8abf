"""Measure how each memory ranks its plans for problems that training did not see, beside the truth.

*Held out*: hallucinated problems, kept from training. *Fresh*: new problems of the classes, those that the
benchmark solves.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np

from planners.memory.encoder.training import TrainedEncoder
from planners.memory.memory import Memory
from planners.memory.plans.cell_masks import rank_by_cells
from planners.memory.plans.free import free_plans
from planners.memory.recall import rank
from planners.world.arrays import Flags, Integers
from planners.world.geometry.collision import scene_of
from planners.world.geometry.occupancy import Grid, bits_of, occupancy_of, unpack
from storage.archives.encoders import load_encoder
from storage.archives.memories import load_memory
from storage.tables.recalls import write_recalls
from tasks.fan_out.chunk import Chunk, Cut
from tasks.fan_out.stage import Stage
from tasks.inputs.problem_sources import source_key, source_of
from tasks.inputs.taught_experiences import taught_counts
from tasks.settings.run_settings import RunSettings
from tasks.stages.build_memory import BUILD_MEMORY, memories_by_seed
from tasks.stages.relabel import problems_of_memory

CHUNK_PROBLEMS: Final = 2_000
HELD_OUT_PROBLEMS: Final = 10_000  # per class, at most: enough for a share within 1 %
LONGEST_ORDER: Final = 100  # plans of a ranking that are kept; figures need about twenty


class LabelledProblem(NamedTuple):
    """A problem and the truth about it."""

    identity: str
    class_name: str
    made_for: int  # the plan that it was hallucinated for; -1: none
    grid: Grid  # [64, 64]
    free: Flags  # [N]


def recall_chunk(chunk: Chunk) -> None:
    """Rank the plans for a range of a memory's problems, with the encoder of each training seed."""
    name, run, grown = chunk.class_name, chunk.run, chunk.settings.grown
    memories = [load_memory(run.memory(name), chunk.vehicle)] if grown else memories_by_seed(chunk)
    by_popularity = None if grown else _by_popularity(load_encoder(run.model(name), chunk.vehicle))
    protocol = "held-out" if chunk.index == 0 else "fresh"
    problems = _held_out(chunk) if chunk.index == 0 else _fresh(chunk, memories[0])
    rows: list[dict[str, Any]] = []
    for problem in problems:
        by_cells = rank_by_cells(memories[0].masks, bits_of(problem.grid)).order
        rows.append(_row(chunk, protocol, problem, "mask", 0, by_cells, False))
        if by_popularity is not None:
            rows.append(_row(chunk, protocol, problem, "popularity", 0, by_popularity, False))
        for seed, memory in enumerate(memories):
            rows.append(_row(chunk, protocol, problem, "encoder", seed, *rank(memory, problem.grid)))
    write_recalls(chunk.shard("recalls"), rows, plans=len(memories[0].plans), key=chunk.key)


def _count(data: str, settings: RunSettings, class_name: str) -> int:
    return source_of(data, settings, class_name).count("test", settings.test_problems)


def _fresh(chunk: Chunk, memory: Memory) -> Iterator[LabelledProblem]:
    data, settings = chunk.data, chunk.settings
    numbers = [
        (name, index)
        for name in settings.classes_of(chunk.class_name)
        for index in range(_count(data, settings, name))
    ]
    for name, index in numbers[chunk.first - CHUNK_PROBLEMS : chunk.last - CHUNK_PROBLEMS]:
        problem = source_of(data, settings, name).problem("test", index)
        free = free_plans(memory.sweeps, scene_of(problem))
        yield LabelledProblem(problem.id, name, -1, occupancy_of(problem), free)


def _by_popularity(trained: TrainedEncoder) -> Integers:
    return np.argsort(-trained.popularity, kind="stable").astype(np.int32)


def _held_out(chunk: Chunk) -> Iterator[LabelledProblem]:
    name, settings = chunk.class_name, chunk.settings
    if settings.grown:  # most plans were never hallucinated for
        return
    problems = problems_of_memory(chunk.data, settings, name)
    held_out = load_encoder(chunk.run.model(name), chunk.vehicle).held_out
    of_plans = held_out[problems.plan_index[held_out] >= 0]
    ends = np.cumsum(taught_counts(chunk.run, settings, name))  # plans are stored class by class
    class_numbers = np.searchsorted(ends, problems.plan_index[of_plans], side="right")
    for number, class_name in enumerate(settings.classes_of(name)):
        of_class = of_plans[class_numbers == number]
        every = max(1, -(-len(of_class) // HELD_OUT_PROBLEMS))  # they are sorted by plan
        for i in of_class[::every].tolist():
            yield LabelledProblem(
                f"{name}-held-out-{i}",
                class_name,
                int(problems.plan_index[i]),
                unpack(problems.grids[i]),
                np.unpackbits(problems.labels[i], count=problems.plans).astype(bool),
            )


def _row(
    chunk: Chunk,
    protocol: str,
    problem: LabelledProblem,
    recall: str,
    seed: int,
    order: Integers,
    nothing: bool,
) -> dict[str, Any]:
    return {
        "problem_id": problem.identity,
        "class": problem.class_name,
        "memory": chunk.class_name,
        "protocol": protocol,
        "order": order[:LONGEST_ORDER],
        "free": problem.free,
        "nothing_recalled": nothing,
        "recall": recall,
        "training_seed": seed,
        "made_for": problem.made_for,
    }


def _cut(data: str, settings: RunSettings, name: str) -> Cut:
    """The problems held out are chunk 0, and ranges of the fresh problems follow."""
    classes = settings.classes_of(name)
    fresh = sum(_count(data, settings, each) for each in classes)
    inputs = [*BUILD_MEMORY.keys(data, settings, name), *(source_key(settings, each) for each in classes)]
    return Cut(CHUNK_PROBLEMS + fresh, CHUNK_PROBLEMS, inputs)


MEASURE_RECALL: Final = Stage(
    name="recall",
    do=recall_chunk,
    classes=lambda settings: settings.memory_names,
    cut=_cut,
    output=lambda chunk: chunk.shard("recalls"),
)
