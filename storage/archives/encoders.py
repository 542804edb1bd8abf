"""Trained encoders on disk: everything needed to build a memory or to compare trainings."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Final

import numpy as np

from planners.memory.encoder.encoder import described_architecture, embedding_bound, weight_shapes
from planners.memory.encoder.training import TrainedEncoder, TrainingSettings
from planners.world.vehicles.vehicle import CAR, Vehicle
from storage.archives.archive import read_archive, write_archive
from storage.archives.tensors import check_floats, packed, packed_epochs, unpacked, unpacked_epochs
from storage.errors import StorageError
from storage.fields import short

_KIND: Final = "encoder"
_TENSORS: Final = "tensors.safetensors"
_WEIGHT: Final = "weights."  # before the names of the network's own tensors
_FLOATS: Final = ("centroids", "vectors", "biases", "popularity")


def save_encoder(folder: Path, trained: TrainedEncoder, vehicle: Vehicle = CAR) -> None:
    """Write a ``trained`` encoder as a ``folder``, whole or not at all; the same one gives the same bytes."""
    tensors = {_WEIGHT + name: tensor for name, tensor in trained.weights.items()}
    tensors |= {name: getattr(trained, name) for name in (*_FLOATS, "held_out")}
    data = packed({**tensors, "history": packed_epochs(trained.history)})
    write_archive(folder, _KIND, vehicle, {"settings": asdict(trained.settings)}, {_TENSORS: data})


def load_encoder(folder: Path, vehicle: Vehicle = CAR) -> TrainedEncoder:
    """The encoder in a ``folder``, trained for a ``vehicle``.

    Raises StorageError if it is missing or damaged, contradicts its header, has another version, or is for
    another vehicle or grid.
    """
    header, files = read_archive(folder, _KIND, vehicle)
    try:
        tensors = unpacked(files[_TENSORS])
        settings = _settings(header["settings"])
        history, held_out = unpacked_epochs(tensors.pop("history")), tensors.pop("held_out")
        if held_out.dtype != np.int32 or held_out.ndim != 1 or (held_out < 0).any():
            raise ValueError("held_out does not consist of problem numbers")
        shapes = {_WEIGHT + name: shape for name, shape in weight_shapes(settings.architecture).items()}
        rows = (len(tensors["biases"]), settings.architecture.dimensions)
        readout = {"centroids": rows, "vectors": rows, "biases": rows[:1], "popularity": (rows[0] - 1,)}
        check_floats(tensors, shapes | readout)
        weights = {name.removeprefix(_WEIGHT): tensors[name] for name in shapes}
        embedding_bound(weights)
        return TrainedEncoder(
            settings=settings,
            weights=weights,
            **{name: tensors[name] for name in _FLOATS},
            history=history,
            held_out=held_out,
        )
    except (KeyError, TypeError, ValueError) as error:
        raise StorageError(f"{folder} is not a complete encoder ({error}); train it again.") from None


def _settings(described: object) -> TrainingSettings:
    """The settings that a header describes. Raises ValueError or TypeError if they are impossible."""
    if not isinstance(described, dict):
        raise ValueError(f"its settings are {short(described)}, expected an object")
    others = {name: value for name, value in described.items() if name != "architecture"}
    for name, usual in asdict(TrainingSettings()).items():
        value = others.get(name, usual)
        if not (type(value) is type(usual) or (type(value) is int and type(usual) is float)):
            raise ValueError(f"its setting {name} is {short(value)}")
    return TrainingSettings(**others, architecture=described_architecture(described["architecture"]))
