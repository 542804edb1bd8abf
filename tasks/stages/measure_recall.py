"""Recalls: what each memory says to problems that training did not see, beside which plans are really free.

*Held out*: hallucinated problems, kept from training. *Fresh*: new problems of the classes, those that the
benchmark solves.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np

from planners.memory.encoder.training import TrainedEncoder
from planners.memory.plans.cell_masks import rank_by_cells
from planners.memory.plans.sweeps import Flags, free_plans
from planners.memory.recall import Memory, rank
from planners.world.arrays import Integers
from planners.world.geometry.collision import scene_of
from planners.world.geometry.occupancy import Grid, bits_of, occupancy_of, unpack
from planners.world.vehicles.vehicle import vehicle_named
from storage.archives.encoders import load_encoder
from storage.archives.memories import load_memory
from storage.tables.recalls import write_recalls
from storage.tables.shards import shard_is_done
from tasks.fan_out.stage import Chunk, chunk_task, chunks_of
from tasks.inputs.problem_sources import source_key, source_of
from tasks.settings.run_settings import COMBINED, RunSettings
from tasks.stages.build_memory import memories_by_seed, memory_chunks
from tasks.stages.train import problems_of_memory

CHUNK_PROBLEMS: Final = 2_000
HELD_OUT_PROBLEMS: Final = 10_000  # a class, at most: a share within 1 %
LONGEST_ORDER: Final = 100  # plans of a ranking that are kept: figures ask for some twenty


class Asked(NamedTuple):
    """A problem, and the truth about it."""

    identity: str
    class_name: str
    made_for: int  # the plan that it was hallucinated for; -1: none
    grid: Grid  # [64, 64]
    free: Flags  # [N]


def recall_chunk(chunk: Chunk) -> dict[str, Any]:
    """Rank the plans for a range of a memory's problems, with the encoder of each training seed."""
    name, run, grown = chunk.class_name, chunk.run, chunk.settings.grown
    vehicle = vehicle_named(chunk.settings.vehicle)
    memories = [load_memory(run.memory(name), vehicle)] if grown else memories_by_seed(chunk)
    by_popularity = None if grown else _by_popularity(load_encoder(run.model(name), vehicle))
    protocol = "held-out" if chunk.index == 0 else "fresh"
    problems = _held_out(chunk) if chunk.index == 0 else _fresh(chunk, memories[0])
    rows: list[dict[str, Any]] = []
    for asked in problems:
        by_cells = rank_by_cells(memories[0].masks, bits_of(asked.grid)).order
        rows.append(_row(chunk, protocol, asked, "mask", 0, by_cells, False))
        if by_popularity is not None:
            rows.append(_row(chunk, protocol, asked, "popularity", 0, by_popularity, False))
        for seed, memory in enumerate(memories):
            rows.append(_row(chunk, protocol, asked, "centroid", seed, *rank(memory, asked.grid)))
    path = chunk.run.shard("recalls", chunk.class_name, chunk.index)
    write_recalls(path, rows, plans=len(memories[0].plans), key=chunk.key)
    return {"rows": len(rows)}


recall_problems = chunk_task(recall_chunk)


def is_recalled(chunk: Chunk) -> bool:
    """Whether the chunk's recalls are there."""
    return shard_is_done(chunk.run.shard("recalls", chunk.class_name, chunk.index), chunk.key)


def recall_chunks(data: str, settings: RunSettings) -> list[Chunk]:
    """For each memory the problems held out as chunk 0, then ranges of the fresh problems of its classes."""
    found = []
    for built in memory_chunks(data, settings):
        memory = built.class_name
        names = _classes(settings, memory)
        fresh = sum(_count(data, settings, name) for name in names)
        keys = [built.key, *(source_key(settings, name) for name in names)]
        chunks = chunks_of(data, settings, "recall", memory, CHUNK_PROBLEMS + fresh, CHUNK_PROBLEMS, keys)
        found += chunks
    return found


def _classes(settings: RunSettings, memory: str) -> tuple[str, ...]:
    return settings.class_names if memory == COMBINED else (memory,)


def _count(data: str, settings: RunSettings, class_name: str) -> int:
    return source_of(data, settings, class_name).count("test", settings.test_problems)


def _fresh(chunk: Chunk, memory: Memory) -> Iterator[Asked]:
    data, settings = chunk.data, chunk.settings
    places = [
        (name, index)
        for name in _classes(settings, chunk.class_name)
        for index in range(_count(data, settings, name))
    ]
    for name, index in places[chunk.first - CHUNK_PROBLEMS : chunk.last - CHUNK_PROBLEMS]:
        problem = source_of(data, settings, name).problem("test", index)
        free = free_plans(memory.sweeps, scene_of(problem))
        yield Asked(problem.id, name, -1, occupancy_of(problem), free)


def _by_popularity(trained: TrainedEncoder) -> Integers:
    return np.argsort(-trained.popularity, kind="stable").astype(np.int32)


def _held_out(chunk: Chunk) -> Iterator[Asked]:
    name, settings = chunk.class_name, chunk.settings
    if settings.grown:  # most plans were never hallucinated for
        return
    problems = problems_of_memory(chunk.data, settings, name)
    held_out = load_encoder(chunk.run.model(name), vehicle_named(settings.vehicle)).held_out
    of_plans = held_out[problems.plan_index[held_out] >= 0]
    classes = _classes(settings, name)
    places = problems.plan_index[of_plans] // settings.taught  # plans are stored class by class
    for place, class_name in enumerate(classes):
        of_class = of_plans[places == place]
        every = max(1, -(-len(of_class) // HELD_OUT_PROBLEMS))  # they are sorted by plan
        for i in of_class[::every].tolist():
            yield Asked(
                f"{name}-held-out-{i}",
                class_name,
                int(problems.plan_index[i]),
                unpack(problems.grids[i]),
                np.unpackbits(problems.labels[i], count=problems.plans).astype(bool),
            )


def _row(
    chunk: Chunk, protocol: str, asked: Asked, recall: str, seed: int, order: Integers, nothing: bool
) -> dict[str, Any]:
    return {
        "problem_id": asked.identity,
        "class": asked.class_name,
        "memory": chunk.class_name,
        "protocol": protocol,
        "order": order[:LONGEST_ORDER],
        "free": asked.free,
        "nothing_recalled": nothing,
        "recall": recall,
        "training_seed": seed,
        "made_for": asked.made_for,
    }
