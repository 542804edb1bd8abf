"""Train: one encoder a class, on all its hallucinated problems but those held out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from planners.memory.training import Epoch, TrainingSettings, train
from planners.world.vehicle import vehicle_named
from storage.encoders import save_encoder
from storage.hallucinated import Labelled, read_labelled
from tasks.caching import Chunk, chunk_task, chunks_of, is_marked, mark_done, run_folder
from tasks.hallucinate import hallucination_chunks, relabel_chunks
from tasks.settings import COMBINED, RunSettings


def memory_names(settings: RunSettings) -> tuple[str, ...]:
    """Names of the memories of a run: its classes, then the combined one if wanted."""
    return settings.class_names + ((COMBINED,) if settings.combined else ())


def train_chunk(chunk: Chunk) -> dict[str, Any]:
    """Train the encoder of one memory; its epochs appear one by one in a file that the parent watches."""
    problems = problems_of_memory(chunk.data, chunk.settings, chunk.class_name)
    log = _epoch_log(chunk)
    log.parent.mkdir(parents=True, exist_ok=True)
    log.write_text(f"{chunk.key}\n")

    def on_epoch(epoch: Epoch) -> None:
        with log.open("a") as sink:
            sink.write(f"{epoch.epoch} {epoch.loss:.6g}\n")

    settings = TrainingSettings(
        objective=chunk.settings.objective, epochs=chunk.settings.epochs, seed=chunk.settings.seed
    )
    labels = np.unpackbits(problems.labels, axis=1, count=problems.plans).astype(bool)
    trained = train(problems.grids, problems.plan_index, labels, settings, on_epoch)
    save_encoder(chunk.run.model(chunk.class_name), trained, vehicle_named(chunk.settings.vehicle))
    mark_done(chunk.run.model(chunk.class_name), chunk.key)
    return {
        "problems": len(problems.plan_index),
        "plans": problems.plans,
        "epochs": [epoch._asdict() for epoch in trained.history],
    }


train_encoder = chunk_task(train_chunk)


def is_trained(chunk: Chunk) -> bool:
    """Whether the encoder is there."""
    return is_marked(chunk.run.model(chunk.class_name), chunk.key)


def train_chunks(data: str, settings: RunSettings) -> list[Chunk]:
    """One chunk for each memory; its units are epochs."""
    made = [*hallucination_chunks(data, settings), *relabel_chunks(data, settings)]
    return [
        chunk
        for name in memory_names(settings)
        for chunk in chunks_of(
            data,
            settings,
            "train",
            name,
            settings.epochs,
            settings.epochs,
            [settings.objective, settings.seed, *(part.key for part in made if part.class_name == name)],
        )
    ]


def epochs_done(chunks: Sequence[Chunk]) -> int:
    """How many epochs of these trainings are over."""
    return sum(_epochs_logged(chunk) for chunk in chunks)


def _epochs_logged(chunk: Chunk) -> int:
    try:
        key, *epochs = _epoch_log(chunk).read_text().splitlines()
    except (FileNotFoundError, ValueError):  # not begun
        return 0
    return len(epochs) if key == chunk.key else 0


def problems_of_memory(data: str, settings: RunSettings, name: str) -> Labelled:
    """All labelled problems that a memory is made from."""
    made = [*hallucination_chunks(data, settings), *relabel_chunks(data, settings)]
    run = run_folder(data, settings)
    return read_labelled(
        [run.shard("hallucinated", name, part.index) for part in made if part.class_name == name]
    )


def _epoch_log(chunk: Chunk) -> Path:
    return chunk.run.path / "models" / f"{chunk.class_name}.epochs"
