"""Where a training stands, on disk after each epoch: a killed one goes on from there."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file

from planners.memory.encoder.training import Checkpoint, Epoch
from storage.archives.tensors import check_floats
from storage.places.files import whole_file
from storage.places.mirror import fetch, note_of
from storage.tables.columns import Array

_KEY: Final = "key"


def save_checkpoint(path: Path, checkpoint: Checkpoint, key: str) -> None:
    """Write a checkpoint, whole or not at all; ``key`` says which training it belongs to."""
    history = np.array(checkpoint.history, np.float64).reshape(-1, len(Epoch._fields))
    tensors = {**checkpoint._asdict(), "history": history}
    with whole_file(path, f"{len(checkpoint.history)} {key}") as temporary:
        save_file(tensors, temporary, {_KEY: key})


def load_checkpoint(path: Path, key: str) -> Checkpoint | None:
    """The checkpoint of the training that ``key`` names; None where there is none: training begins anew."""
    tensors = _tensors(path, key, Checkpoint._fields)
    if tensors is None:
        return None
    history = tensors.pop("history")
    try:
        check_floats(tensors, dict.fromkeys(tensors, (len(tensors["values"]),)))
    except (TypeError, ValueError):
        return None
    shape = (max(1, len(history)), len(Epoch._fields))
    if history.shape != shape or not np.isfinite(history[:, 2:]).all():
        return None
    rows = history.tolist()
    return Checkpoint(**tensors, history=tuple(Epoch(int(epoch), *metrics) for epoch, *metrics in rows))


def epochs_kept(path: Path, key: str) -> int:
    """How many epochs of the training that ``key`` names are over; cheap enough to be asked all the time."""
    note = note_of(path)
    if note is not None:
        epochs, _, noted = note.partition(" ")
        return int(epochs) if noted == key else 0
    tensors = _tensors(path, key, ("history",))
    return 0 if tensors is None else len(tensors["history"])


def _tensors(path: Path, key: str, names: Sequence[str]) -> dict[str, Array] | None:
    try:
        with safe_open(fetch(path), "np") as kept:
            if (kept.metadata() or {}).get(_KEY) != key:
                return None
            return {name: kept.get_tensor(name) for name in names}
    except (OSError, SafetensorError):
        return None
