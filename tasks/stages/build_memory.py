"""Build a memory: encoder, centroids and plans as one archive."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import pandas as pd

from dashboards.figures.embeddings import embedding_map
from dashboards.figures.recall_curves import training_curves
from dashboards.figures.style import save
from planners.memory.build_memory import build_memory
from planners.memory.recall import Memory
from planners.world.geometry.occupancy import GRID
from planners.world.vehicles.vehicle import vehicle_named
from storage.archives.encoders import load_encoder
from storage.archives.memories import save_memory
from tasks.fan_out.stage import Chunk, chunk_task, chunks_of, is_marked, mark_done
from tasks.inputs.problem_sources import class_settings
from tasks.inputs.taught_experiences import grown_memory, taught_experiences
from tasks.settings.run_settings import COMBINED, RunSettings
from tasks.stages.train import memory_names, problems_of_memory, train_chunks

SHOWN_PROBLEMS: Final = 4_000  # on an embedding map


def build_chunk(chunk: Chunk) -> dict[str, Any]:
    """Build one memory, of the encoder that is best on the validation problems; the first of equals.

    Plans that no encoder was taught join it then.
    """
    run, name, settings = chunk.run, chunk.class_name, chunk.settings
    vehicle = vehicle_named(settings.vehicle)
    built = memories_by_seed(chunk)
    scores = [load_encoder(run.model(name, seed), vehicle).score for seed in range(len(built))]
    best = scores.index(max(scores))
    _draw(chunk, best, built[best])
    memory = grown_memory(chunk, built[best]) if settings.grown else built[best]
    save_memory(run.memory(name), memory)
    mark_done(run.memory(name), chunk.key)
    return {"plans": len(memory.plans), "training_seed": best}


build_one_memory = chunk_task(build_chunk)


def is_built(chunk: Chunk) -> bool:
    """Whether the memory is there."""
    return is_marked(chunk.run.memory(chunk.class_name), chunk.key)


def memory_chunks(data: str, settings: RunSettings) -> list[Chunk]:
    """One chunk for each memory."""
    parts = train_chunks(data, settings)
    return [
        chunk
        for name in memory_names(settings)
        for chunk in chunks_of(
            data,
            settings,
            "build-memory",
            name,
            1,
            1,
            [part.key for part in parts if part.class_name == name],
        )
    ]


def figure_names(class_name: str) -> tuple[str, str]:
    """Names of what is drawn of a memory's training."""
    return f"training-{class_name}", f"embeddings-{class_name}"


def _draw(chunk: Chunk, seed: int, memory: Memory) -> None:
    """Draw the epochs of the training that was chosen, and where its encoder places held-out problems."""
    name, run = chunk.class_name, chunk.run
    trained = load_encoder(run.model(name, seed), memory.vehicle)
    problems = problems_of_memory(chunk.data, chunk.settings, name)
    shown = trained.held_out[:: -(-len(trained.held_out) // SHOWN_PROBLEMS)]  # they are sorted by plan
    grids = np.unpackbits(problems.grids[shown], axis=1).reshape(-1, GRID, GRID)
    epochs = pd.DataFrame(epoch._asdict() for epoch in trained.history)
    curves, places = figure_names(name)
    save(training_curves(epochs), run.figures, curves)
    made_for = problems.plan_index[shown]
    save(embedding_map(memory.encoder(grids), made_for, memory.centroids), run.figures, places)


def memories_by_seed(chunk: Chunk) -> list[Memory]:
    """The memory of a chunk's taught plans with the encoder of each training seed."""
    name, run, settings = chunk.class_name, chunk.run, chunk.settings
    vehicle = vehicle_named(settings.vehicle)
    experiences = taught_experiences(run, settings, name)
    plans = [experience.plan for experience in experiences]
    classes = settings.class_names if name == COMBINED else (name,)
    metadata = {
        "run": settings.run_name,
        "classes": {each: class_settings(settings, each) for each in classes},
        "scales": sorted({experience.problem.scale for experience in experiences}),
    }
    return [
        build_memory(
            load_encoder(run.model(name, seed), vehicle),
            plans,
            name,
            vehicle,
            metadata | {"training_seed": seed},
        )
        for seed in range(settings.learning.seeds)
    ]
