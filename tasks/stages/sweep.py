"""Sweep: encoders of several sizes and learning rates, trained on the same problems, side by side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final

import pandas as pd

from planners.memory.encoder.training import train
from storage.errors import StorageError
from storage.places.files import read_json, write_json
from tasks.fan_out.stage import Chunk, chunk_task, chunks_of
from tasks.settings.encoder_training import Learning
from tasks.settings.run_settings import RunSettings
from tasks.stages.train import memory_names, problems_of_memory, train_chunks

RATES: Final = (1e-3, 3e-3, 1e-2)
SIZES: Final = (  # channels of the convolution, width of the hidden layer
    ((8,), (64,)),
    ((16,), (64,)),
    ((16,), (128,)),
    ((16,), (256,)),
    ((32,), (128,)),
    ((16, 16), (128,)),
    ((16,), (128, 64)),
)


def variants(settings: RunSettings) -> list[Learning]:
    """What is tried: every size with the run's learning rate, and every rate with the run's size."""
    base = replace(settings.learning, seeds=1)
    sizes = [replace(base, channels=channels, hidden=hidden) for channels, hidden in SIZES]
    rates = [replace(base, learning_rate=rate) for rate in RATES]
    return list(dict.fromkeys([base, *sizes, *rates]))


def sweep_chunk(chunk: Chunk) -> dict[str, Any]:
    """Train one variant for one memory, and note how well it ranks the validation problems."""
    settings = chunk.settings
    problems = problems_of_memory(chunk.data, settings, chunk.class_name)
    learning = variants(settings)[chunk.index]
    asked = learning.settings(settings.objective, settings.epochs, settings.seed)
    trained = train(problems.grids, problems.plan_index, problems.free, asked)
    best = max(trained.history, key=lambda epoch: epoch.hit_1)
    row = {
        "class": chunk.class_name,
        "learning_rate": learning.learning_rate,
        "channels": " ".join(map(str, learning.channels)),
        "hidden": " ".join(map(str, learning.hidden)),
        "parameters": sum(math.prod(weight.shape) for weight in trained.weights.values()),
        "hit@1": best.hit_1 / best.oracle,
        "hit@5": best.hit_5 / best.oracle,
        "seconds": trained.history[-1].seconds,
    }
    history = [epoch._asdict() for epoch in trained.history]
    write_json(_place(chunk), {"key": chunk.key, "row": row, "epochs": history})
    return {}


sweep_variant = chunk_task(sweep_chunk)


def is_swept(chunk: Chunk) -> bool:
    """Whether a variant was trained."""
    try:
        return bool(read_json(_place(chunk))["key"] == chunk.key)
    except (StorageError, KeyError, TypeError):
        return False


def sweep_chunks(data: str, settings: RunSettings) -> list[Chunk]:
    """One chunk for each memory and variant; its units are epochs."""
    keys = {chunk.class_name: chunk.key for chunk in train_chunks(data, settings)}
    tried = variants(settings)
    return [
        chunk
        for name in memory_names(settings)
        for chunk in chunks_of(
            data,
            settings,
            "sweep",
            name,
            len(tried) * settings.epochs,
            settings.epochs,
            [keys[name], *(asdict(each) for each in tried)],
        )
    ]


def swept(chunk: Chunk) -> tuple[dict[str, Any], list[dict[str, float]]]:
    """What a variant came to, and its epochs."""
    found = read_json(_place(chunk))
    return found["row"], found["epochs"]


def sweep_rows(chunks: Sequence[Chunk]) -> pd.DataFrame:
    """A row a memory and variant; hit@k as a share of what the stored plans can solve."""
    return pd.DataFrame([swept(chunk)[0] for chunk in chunks])


def _place(chunk: Chunk) -> Path:
    return chunk.run.path / "sweep" / chunk.class_name / f"{chunk.index:02d}.json"
