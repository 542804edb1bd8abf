"""Sweep: compare encoders of several sizes and learning rates, trained on the same problems."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final

import pandas as pd

from planners.memory.encoder.training import train
from storage.errors import StorageError
from storage.places.files import read_json, write_json
from tasks.fan_out.chunk import Chunk, Cut
from tasks.fan_out.stage import Stage
from tasks.inputs.taught_experiences import taught_masks
from tasks.settings.encoder_training import Learning
from tasks.settings.run_settings import RunSettings
from tasks.stages.relabel import problems_of_memory
from tasks.stages.train import TRAIN

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
    """The variants: every size with the run's learning rate, and every rate with the run's size."""
    base = replace(settings.learning, seeds=1)
    sizes = [replace(base, channels=channels, hidden=hidden) for channels, hidden in SIZES]
    rates = [replace(base, learning_rate=rate) for rate in RATES]
    return list(dict.fromkeys([base, *sizes, *rates]))


def sweep_chunk(chunk: Chunk) -> None:
    """Train one variant for one memory, and write how well it ranks the validation problems."""
    settings = chunk.settings
    problems = problems_of_memory(chunk.data, settings, chunk.class_name)
    learning = variants(settings)[chunk.index]
    training = settings.training(learning, settings.seed)
    masks = taught_masks(chunk.run, settings, chunk.class_name)
    trained = train(problems.grids, problems.plan_index, problems.free, masks, training)
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
    write_json(_path(chunk), {"key": chunk.key, "row": row, "epochs": history})


def swept(chunk: Chunk) -> tuple[dict[str, Any], list[dict[str, float]]]:
    """The row of a variant, and the figures of its epochs."""
    written = read_json(_path(chunk))
    return written["row"], written["epochs"]


def sweep_rows(chunks: Iterable[Chunk]) -> pd.DataFrame:
    """A row for each memory and variant; hit@k is a share of what the stored plans can solve."""
    return pd.DataFrame([swept(chunk)[0] for chunk in chunks])


def _path(chunk: Chunk) -> Path:
    return chunk.run.sweep(chunk.class_name, chunk.index)


def _is_whole(path: Path, key: str) -> bool:
    try:
        return bool(read_json(path)["key"] == key)
    except (StorageError, KeyError, TypeError):
        return False


def _cut(data: str, settings: RunSettings, name: str) -> Cut:
    """A chunk for each variant; its items are epochs."""
    tried = variants(settings)
    inputs = [*TRAIN.keys(data, settings, name), *map(asdict, tried)]
    return Cut(len(tried) * settings.epochs, settings.epochs, inputs)


SWEEP: Final = Stage(
    name="sweep",
    do=sweep_chunk,
    classes=lambda settings: settings.memory_names,
    cut=_cut,
    output=_path,
    is_whole=_is_whole,
    unit="epochs",
)
