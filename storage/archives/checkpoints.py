"""Checkpoints: the state of a training after its last finished epoch, from which a killed one resumes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file

from planners.memory.encoder.training import Checkpoint
from planners.world.arrays import Array
from storage.archives.tensors import check_floats, packed_epochs, unpacked_epochs
from storage.places.files import whole_file
from storage.places.mirror import fetch, note_of

_KEY: Final = "key"


def save_checkpoint(path: Path, checkpoint: Checkpoint, key: str) -> None:
    """Write a ``checkpoint`` to ``path`` atomically; ``key`` says which training it belongs to."""
    tensors = {**checkpoint._asdict(), "history": packed_epochs(checkpoint.history)}
    with whole_file(path, f"{len(checkpoint.history)} {key}") as temporary:
        save_file(tensors, temporary, {_KEY: key})


def load_checkpoint(path: Path, key: str) -> Checkpoint | None:
    """The checkpoint at ``path`` of the training ``key``; None if there is none to resume from."""
    tensors = _tensors(path, key, Checkpoint._fields)
    if tensors is None:
        return None
    try:
        history = unpacked_epochs(tensors.pop("history"))
        check_floats(tensors, dict.fromkeys(tensors, (len(tensors["values"]),)))
    except (TypeError, ValueError):
        return None
    return Checkpoint(**tensors, history=history)


def epochs_kept(path: Path, key: str) -> int:
    """How many epochs of the training ``key`` the checkpoint at ``path`` holds; cheap enough to ask often."""
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
