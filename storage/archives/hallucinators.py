"""Networks of learned hallucination on disk, with which the same problems can be made again."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from planners.memory.encoder.encoder import Weights
from planners.memory.hallucination.learned_obstacles import weight_shapes
from planners.world.vehicles.vehicle import CAR, Vehicle
from storage.archives.archive import read_archive, write_archive
from storage.archives.tensors import check_floats, packed, unpacked
from storage.errors import StorageError

_KIND: Final = "hallucinator"
_WEIGHTS: Final = "weights.safetensors"


def save_hallucinator(folder: Path, weights: Weights, vehicle: Vehicle = CAR) -> None:
    """Write ``weights`` as a ``folder``, whole or not at all; the same ones give the same bytes."""
    write_archive(folder, _KIND, vehicle, {}, {_WEIGHTS: packed(weights)})


def load_hallucinator(folder: Path, vehicle: Vehicle = CAR) -> Weights:
    """The weights in a ``folder``, made for a ``vehicle``.

    Raises StorageError if they are missing, damaged, of another version, vehicle or network.
    """
    _, files = read_archive(folder, _KIND, vehicle)
    try:
        weights = unpacked(files[_WEIGHTS])
        check_floats(weights, weight_shapes())
    except (KeyError, ValueError) as error:
        raise StorageError(
            f"{folder} is not a complete hallucinator ({error}); run hallucinate again."
        ) from None
    return weights
