"""Where a training stands, on disk after each epoch: a killed one goes on from there."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file

from planners.memory.training import Checkpoint, Epoch
from storage.files import whole_file

_KEY: Final = "key"


def save_checkpoint(path: Path, checkpoint: Checkpoint, key: str) -> None:
    """Write a checkpoint, whole or not at all; ``key`` says which training it belongs to."""
    history = np.array(checkpoint.history, np.float64).reshape(-1, len(Epoch._fields))
    tensors = {**checkpoint._asdict(), "history": history}
    with whole_file(path) as temporary:
        save_file(tensors, temporary, {_KEY: key})


def load_checkpoint(path: Path, key: str) -> Checkpoint | None:
    """The checkpoint of the training that ``key`` names; None where there is none: training begins anew."""
    try:
        with safe_open(path, "np") as kept:
            if kept.metadata().get(_KEY) != key:
                return None
            tensors = {name: kept.get_tensor(name) for name in Checkpoint._fields}
    except (OSError, SafetensorError):
        return None
    rows = tensors.pop("history").tolist()
    return Checkpoint(**tensors, history=tuple(Epoch(int(epoch), *metrics) for epoch, *metrics in rows))
