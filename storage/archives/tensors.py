"""Small named arrays as one safetensors file, and what is asked of those that somebody hands in."""

from __future__ import annotations

from collections.abc import Mapping
from mmap import mmap

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from storage.tables.columns import Array

Shapes = Mapping[str, tuple[int, ...]]


def packed(tensors: Mapping[str, Array]) -> bytes:
    """The file of some arrays; the same arrays give the same bytes."""
    return save({name: np.ascontiguousarray(tensor) for name, tensor in tensors.items()})


def unpacked(contents: mmap | bytes) -> dict[str, Array]:
    """The arrays of a file; ValueError where it is none."""
    try:
        return dict(load(bytes(contents)))
    except (SafetensorError, KeyError, TypeError) as error:  # KeyError: a type that NumPy does not have
        raise ValueError(f"no safetensors: {error}") from None


def check_floats(tensors: Mapping[str, Array], shapes: Shapes) -> None:
    """Refuse all but float32 arrays of these names and shapes.

    Infinitely far centroids and impossible rows are fine; what is no number would compare as anything.

    Raises:
        ValueError: there is another array, one too few, or one that does not fit.

    """
    odd = ", ".join(sorted(tensors.keys() ^ shapes.keys()))
    if odd:
        raise ValueError(f"it lacks or has too much of: {odd}")
    for name, shape in shapes.items():
        tensor = tensors[name]
        if tensor.dtype != np.float32 or tensor.shape != shape or np.isnan(tensor).any():
            raise ValueError(
                f"{name} is {tensor.dtype} {list(tensor.shape)}, wanted were float32 numbers {list(shape)}"
            )
