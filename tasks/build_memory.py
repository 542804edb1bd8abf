"""Build a memory: encoder, centroids and plans as one archive; and what it recalls on problems held out."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from planners.memory.centroids import build_memory
from planners.memory.recall import Memory, rank
from planners.world.occupancy import GRID
from planners.world.vehicle import vehicle_named
from storage.encoders import load_encoder
from storage.experiences import read_experiences
from storage.hallucinated import Labelled
from storage.memories import save_memory
from storage.recalls import write_recalls
from storage.shards import shard_is_done
from tasks.caching import Chunk, chunk_task, chunks_of, is_marked, mark_done
from tasks.settings import COMBINED, RunSettings
from tasks.train import problems_of_memory, train_chunks
from tasks.worlds import class_settings

HELD_OUT_SHARD: Final = 9999  # after all shards of fresh problems
HELD_OUT_PROBLEMS: Final = 2_000  # enough for a share within 2 %


def build_chunk(chunk: Chunk) -> dict[str, Any]:
    """Build one memory and write its recall of the problems that training did not see."""
    name, run = chunk.class_name, chunk.run
    vehicle = vehicle_named(chunk.settings.vehicle)
    trained = load_encoder(run.model(name), vehicle)
    problems = problems_of_memory(chunk.data, chunk.settings, name)
    seen = np.delete(np.arange(len(problems.plan_index)), trained.validation)
    plans = [experience.plan for experience in read_experiences(run.experiences(name), vehicle)]
    classes = chunk.settings.class_names if name == COMBINED else (name,)
    metadata = {
        "run": chunk.settings.run_name,
        "problems": len(seen),
        "classes": {each: class_settings(chunk.settings, each) for each in classes},
    }
    memory = build_memory(
        trained, problems.grids[seen], problems.plan_index[seen], plans, name, vehicle, metadata
    )
    save_memory(run.memory(name), memory)
    rows = _held_out(memory, name, problems, trained.validation.tolist())
    write_recalls(run.shard("recalls", name, HELD_OUT_SHARD), rows, plans=len(plans), key=chunk.key)
    mark_done(run.memory(name), chunk.key)
    return {"plans": len(plans), "held_out": len(rows)}


build_one_memory = chunk_task(build_chunk)


def is_built(chunk: Chunk) -> bool:
    """Whether the memory and its recall rows are there."""
    recalls = chunk.run.shard("recalls", chunk.class_name, HELD_OUT_SHARD)
    return is_marked(chunk.run.memory(chunk.class_name), chunk.key) and shard_is_done(recalls, chunk.key)


def memory_chunks(data: str, settings: RunSettings) -> list[Chunk]:
    """One chunk for each memory."""
    return [
        chunk
        for part in train_chunks(data, settings)
        for chunk in chunks_of(data, settings, "build-memory", part.class_name, 1, 1, [part.key])
    ]


def _held_out(memory: Memory, name: str, problems: Labelled, held_out: list[int]) -> list[dict[str, Any]]:
    rows = []
    for i in [i for i in held_out if problems.plan_index[i] >= 0][:HELD_OUT_PROBLEMS]:
        order, nothing = rank(memory, np.unpackbits(problems.grids[i]).reshape(GRID, GRID))
        rows.append(
            {
                "problem_id": f"{name}-held-out-{i}",
                "class": name,
                "memory": name,
                "protocol": "held-out",
                "order": order,
                "free": np.unpackbits(problems.labels[i], count=problems.plans).astype(bool),
                "nothing_recalled": nothing,
            }
        )
    return rows
