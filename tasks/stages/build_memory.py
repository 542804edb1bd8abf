"""Build a memory: encoder, centroids and plans as one archive."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
import pandas as pd

from dashboards.figures.embeddings import embedding_map
from dashboards.figures.recall_curves import training_curves
from dashboards.figures.style import save
from planners.memory.build_memory import build_memory
from planners.memory.memory import Memory
from planners.world.geometry.occupancy import GRID
from storage.archives.encoders import load_encoder
from storage.archives.memories import save_memory
from tasks.fan_out.chunk import Chunk, Cut
from tasks.fan_out.stage import Stage, is_marked, mark_done
from tasks.inputs.problem_sources import class_settings
from tasks.inputs.taught_experiences import grown_memory, taught_experiences
from tasks.stages.relabel import problems_of_memory
from tasks.stages.train import TRAIN

SHOWN_PROBLEMS: Final = 4_000  # on an embedding map


class Built(NamedTuple):
    """What a memory was built from."""

    training_seed: int  # number of the encoder that validated best


def build_chunk(chunk: Chunk) -> Built:
    """Build one memory with the encoder that is best on the validation problems, the first of equals.

    Plans that no encoder was taught join it afterwards.
    """
    run, name = chunk.run, chunk.class_name
    memories = memories_by_seed(chunk)
    scores = [load_encoder(run.model(name, seed), chunk.vehicle).score for seed in range(len(memories))]
    best = scores.index(max(scores))
    _draw(chunk, best, memories[best])
    memory = grown_memory(chunk, memories[best]) if chunk.settings.grown else memories[best]
    save_memory(run.memory(name), memory)
    mark_done(run.memory(name), chunk.key)
    return Built(best)


def memories_by_seed(chunk: Chunk) -> list[Memory]:
    """The memory of a chunk's taught plans, once with the encoder of each training seed."""
    name, run, settings = chunk.class_name, chunk.run, chunk.settings
    experiences = taught_experiences(run, settings, name)
    plans = [experience.plan for experience in experiences]
    metadata = {
        "run": settings.run_name,
        "classes": {each: class_settings(settings, each) for each in settings.classes_of(name)},
        "scales": sorted({experience.problem.scale for experience in experiences}),
    }
    return [
        build_memory(
            load_encoder(run.model(name, seed), chunk.vehicle),
            plans,
            name,
            chunk.vehicle,
            metadata | {"training_seed": seed},
        )
        for seed in range(settings.learning.seeds)
    ]


def figure_names(class_name: str) -> tuple[str, str]:
    """Names of the figures of a memory's training: its epochs, and its embeddings."""
    return f"training-{class_name}", f"embeddings-{class_name}"


def _draw(chunk: Chunk, seed: int, memory: Memory) -> None:
    """Draw the epochs of the chosen training, and where its encoder embeds held-out problems."""
    name, run = chunk.class_name, chunk.run
    trained = load_encoder(run.model(name, seed), memory.vehicle)
    problems = problems_of_memory(chunk.data, chunk.settings, name)
    shown = trained.held_out[:: -(-len(trained.held_out) // SHOWN_PROBLEMS)]  # they are sorted by plan
    grids = np.unpackbits(problems.grids[shown], axis=1).reshape(-1, GRID, GRID)
    epochs = pd.DataFrame(epoch._asdict() for epoch in trained.history)
    curves, embeddings = figure_names(name)
    save(training_curves(epochs), run.figures, curves)
    made_for = problems.plan_index[shown]
    save(embedding_map(memory.encoder(grids), made_for, memory.centroids), run.figures, embeddings)


BUILD_MEMORY: Final = Stage(
    name="build memories",
    do=build_chunk,
    result=Built,
    classes=lambda settings: settings.memory_names,
    cut=lambda data, settings, name: Cut(1, 1, TRAIN.keys(data, settings, name)),
    output=lambda chunk: chunk.run.memory(chunk.class_name),
    is_whole=is_marked,
)
