"""The networks of learned hallucination on disk: with them the same problems can be made again."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from planners.memory.encoder.encoder import Weights
from planners.memory.hallucination.learned_obstacles import weight_shapes
from planners.world.vehicles.vehicle import CAR, Vehicle
from storage.archives.archive import read_archive, write_archive
from storage.errors import StorageError

_KIND: Final = "hallucinator"
_WEIGHTS: Final = "weights.safetensors"


def save_hallucinator(folder: Path, weights: Weights, vehicle: Vehicle = CAR) -> None:
    """Write the weights as a folder, whole or not at all; the same ones give the same bytes."""
    data = save({name: np.ascontiguousarray(tensor) for name, tensor in weights.items()})
    write_archive(folder, _KIND, vehicle, {}, {_WEIGHTS: data})


def load_hallucinator(folder: Path, vehicle: Vehicle = CAR) -> Weights:
    """The weights in a folder.

    StorageError: missing, damaged, of a newer version, for another vehicle, or of another network.
    """
    _, files = read_archive(folder, _KIND, vehicle)
    try:
        weights: Weights = load(bytes(files[_WEIGHTS]))
    except (KeyError, SafetensorError) as error:
        raise StorageError(f"{folder} is no whole hallucinator ({error}); run hallucinate again.") from None
    if {name: weight.shape for name, weight in weights.items()} != weight_shapes():
        raise StorageError(f"{folder} holds another network than this program's; run hallucinate again.")
    return weights
