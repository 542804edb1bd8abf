"""Train: encoders of each memory, one a training seed, on all its problems but those held out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from planners.memory.encoder.encoder import Architecture, Weights, architecture_of
from planners.memory.encoder.training import Checkpoint, train
from planners.world.vehicles.vehicle import vehicle_named
from storage.archives.checkpoints import epochs_kept, load_checkpoint, save_checkpoint
from storage.archives.encoders import save_encoder
from storage.archives.memories import load_memory
from storage.places.mirror import remove
from storage.tables.hallucinated import Labelled, read_labelled
from tasks.fan_out.stage import Chunk, chunk_task, chunks_of, is_marked, mark_done, run_folder
from tasks.settings.retraining_settings import champions_of
from tasks.settings.run_settings import COMBINED, RunSettings
from tasks.stages.hallucinate import hallucination_chunks, relabel_chunks


def memory_names(settings: RunSettings) -> tuple[str, ...]:
    """Names of the memories of a run: its classes, then the combined one if wanted."""
    return settings.class_names + ((COMBINED,) if settings.combined else ())


def train_chunk(chunk: Chunk) -> dict[str, Any]:
    """Train one encoder, from where it stood if it was interrupted.

    A retraining begins with the encoder of the champion, where that has the same sizes.
    """
    asked = chunk.settings
    problems = problems_of_memory(chunk.data, asked, chunk.class_name)
    settings = asked.learning.settings(asked.objective, asked.epochs, asked.seed + chunk.index)
    place = _checkpoint(chunk)

    def on_epoch(checkpoint: Checkpoint) -> None:
        save_checkpoint(place, checkpoint, chunk.key)

    before = load_checkpoint(place, chunk.key)
    warm = _champion_weights(chunk, settings.architecture)
    trained = train(problems.grids, problems.plan_index, problems.free, settings, on_epoch, before, warm)
    model = chunk.run.model(chunk.class_name, chunk.index)
    save_encoder(model, trained, vehicle_named(asked.vehicle))
    mark_done(model, chunk.key)
    remove(place)
    return {
        "problems": len(problems.plan_index),
        "plans": problems.plans,
        "epochs": [epoch._asdict() for epoch in trained.history],
    }


train_encoder = chunk_task(train_chunk)


def is_trained(chunk: Chunk) -> bool:
    """Whether the encoder is there."""
    return is_marked(chunk.run.model(chunk.class_name, chunk.index), chunk.key)


def train_chunks(data: str, settings: RunSettings) -> list[Chunk]:
    """One chunk for each memory and training seed; its units are epochs. The largest memory comes first."""
    made = [*hallucination_chunks(data, settings), *relabel_chunks(data, settings)]
    return [
        chunk
        for name in reversed(memory_names(settings))  # the longest training would end alone if it came last
        for chunk in chunks_of(
            data,
            settings,
            "train",
            name,
            settings.learning.seeds * settings.epochs,
            settings.epochs,
            [
                settings.objective,
                settings.seed,
                asdict(settings.learning),
                *champions_of([name], settings.retraining),
                *(part.key for part in made if part.class_name == name),
            ],
        )
    ]


def class_epochs(chunk: Chunk) -> int:
    """How long a training may take: its epochs, times the classes whose problems it has."""
    return (chunk.last - chunk.first) * _classes(chunk)


def class_epochs_done(chunks: Sequence[Chunk]) -> int:
    """How much of these trainings is over."""
    return sum(_epochs_done(chunk) * _classes(chunk) for chunk in chunks)


def _classes(chunk: Chunk) -> int:
    return len(chunk.settings.class_names) if chunk.class_name == COMBINED else 1


def _epochs_done(chunk: Chunk) -> int:
    if is_trained(chunk):
        return chunk.last - chunk.first
    return epochs_kept(_checkpoint(chunk), chunk.key)


def problems_of_memory(data: str, settings: RunSettings, name: str) -> Labelled:
    """All labelled problems that a memory is made from."""
    made = [*hallucination_chunks(data, settings), *relabel_chunks(data, settings)]
    run = run_folder(data, settings)
    return read_labelled(
        [run.shard("hallucinated", name, part.index) for part in made if part.class_name == name]
    )


def _champion_weights(chunk: Chunk, architecture: Architecture) -> Weights | None:
    if not champions_of([chunk.class_name], chunk.settings.retraining):
        return None
    place = chunk.run.champion(chunk.class_name)
    weights = load_memory(place, vehicle_named(chunk.settings.vehicle)).weights
    return weights if architecture_of(weights) == architecture else None


def _checkpoint(chunk: Chunk) -> Path:
    model = chunk.run.model(chunk.class_name, chunk.index)
    return model.with_name(f"{model.name}.checkpoint.safetensors")
