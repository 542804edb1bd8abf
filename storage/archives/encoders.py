"""Trained encoders on disk: all that training leaves, for building a memory later or comparing trainings."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Final

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from planners.memory.encoder.encoder import Architecture
from planners.memory.encoder.training import Epoch, TrainedEncoder, TrainingSettings
from planners.world.vehicles.vehicle import CAR, Vehicle
from storage.archives.archive import read_archive, write_archive
from storage.errors import StorageError

_KIND: Final = "encoder"
_TENSORS: Final = "tensors.safetensors"
_WEIGHT: Final = "weights."  # before the names of the network's own tensors
_ARRAYS: Final = ("centroids", "vectors", "biases", "popularity", "held_out")


def save_encoder(folder: Path, trained: TrainedEncoder, vehicle: Vehicle = CAR) -> None:
    """Write a trained encoder as a folder, whole or not at all; the same one gives the same bytes."""
    tensors = {_WEIGHT + name: tensor for name, tensor in trained.weights.items()}
    tensors |= {name: getattr(trained, name) for name in _ARRAYS}
    history = np.array(trained.history, np.float64).reshape(-1, len(Epoch._fields))
    arrays = {**tensors, "history": history}
    data = save({name: np.ascontiguousarray(array) for name, array in arrays.items()})
    write_archive(folder, _KIND, vehicle, {"settings": asdict(trained.settings)}, {_TENSORS: data})


def load_encoder(folder: Path, vehicle: Vehicle = CAR) -> TrainedEncoder:
    """The trained encoder in a folder.

    StorageError: missing, damaged, of a newer version, for another vehicle or another grid.
    """
    header, files = read_archive(folder, _KIND, vehicle)
    try:
        tensors = load(bytes(files[_TENSORS]))
        sizes = header["settings"].pop("architecture")
        architecture = Architecture(tuple(sizes["channels"]), tuple(sizes["hidden"]), sizes["dimensions"])
        return TrainedEncoder(
            settings=TrainingSettings(**header["settings"], architecture=architecture),
            weights={
                name.removeprefix(_WEIGHT): tensor
                for name, tensor in tensors.items()
                if name.startswith(_WEIGHT)
            },
            **{name: tensors[name] for name in _ARRAYS},
            history=tuple(Epoch(int(epoch), *metrics) for epoch, *metrics in tensors["history"].tolist()),
        )
    except (KeyError, TypeError, ValueError, SafetensorError) as error:
        raise StorageError(f"{folder} is no whole encoder ({error}); train it again.") from None
