"""Small named arrays as one safetensors file, and checks of such arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from mmap import mmap

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from planners.memory.encoder.training import Epoch
from planners.world.arrays import Array

Shapes = Mapping[str, tuple[int, ...]]


def packed(tensors: Mapping[str, Array]) -> bytes:
    """The content of a file with the arrays ``tensors`` by name; the same arrays give the same bytes."""
    return save({name: np.ascontiguousarray(tensor) for name, tensor in tensors.items()})


def unpacked(contents: mmap | bytes) -> dict[str, Array]:
    """The arrays by name in the ``contents`` of a file. Raises ValueError if it is not such a file."""
    try:
        return dict(load(bytes(contents)))
    except (SafetensorError, KeyError, TypeError) as error:  # KeyError: a type that NumPy does not have
        raise ValueError(f"not safetensors: {error}") from None


def check_floats(tensors: Mapping[str, Array], shapes: Shapes) -> None:
    """Raise ValueError unless ``tensors`` are float32 arrays with the names and shapes of ``shapes``.

    Infinite numbers are allowed, for centroids that cannot win; NaN is not, because it compares as anything.
    """
    different = ", ".join(sorted(tensors.keys() ^ shapes.keys()))
    if different:
        raise ValueError(f"missing or too many: {different}")
    for name, shape in shapes.items():
        tensor = tensors[name]
        if tensor.dtype != np.float32 or tensor.shape != shape or np.isnan(tensor).any():
            raise ValueError(
                f"{name} is {tensor.dtype} {list(tensor.shape)}, expected float32 numbers {list(shape)}"
            )


def packed_epochs(epochs: Sequence[Epoch]) -> Array:
    """The history of a training as an array ``[n, metrics]``."""
    return np.array(epochs, np.float64).reshape(-1, len(Epoch._fields))


def unpacked_epochs(history: Array) -> tuple[Epoch, ...]:
    """The epochs in the array ``history`` of ``packed_epochs``. Raises ValueError if it is not one."""
    shape = (max(1, len(history)), len(Epoch._fields))
    if history.shape != shape or not np.isfinite(history[:, 2:]).all():
        raise ValueError("history does not consist of epochs")
    return tuple(Epoch(int(epoch), *metrics) for epoch, *metrics in history.tolist())
