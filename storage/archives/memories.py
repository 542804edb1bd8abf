"""Memories on disk: an archive of the encoder, of what reads it out, and of the plans as plain arrays.

Small things are safetensors; what grows with the plans lies in ``.npy`` files that stay on the disk until
they are used. ``encoder.onnx`` is the same network for other programs; recall makes its own from the weights.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from planners.memory.encoder.encoder import Architecture, architecture_of, to_onnx
from planners.memory.plans.stored_plans import StoredPlans, store_plans
from planners.memory.plans.sweeps import PlanSweeps, sweeps_with
from planners.memory.ranking.inverted_lists import lists_with
from planners.memory.recall import Memory
from planners.world.arrays import Floats32
from planners.world.geometry.occupancy import GRID
from planners.world.vehicles.bodies import body_count
from planners.world.vehicles.vehicle import CAR, Vehicle, state_size
from storage.archives.archive import Contents, Files, read_archive, write_archive
from storage.archives.arrays import array_of
from storage.errors import StorageError
from storage.tables.columns import Array

_KIND: Final = "memory"
_WEIGHTS: Final = "encoder.safetensors"
_ONNX: Final = "encoder.onnx"
_READOUT: Final = "readout.safetensors"
_FILES: Final = {
    _WEIGHTS, _ONNX, _READOUT,
    "states.npy", "controls.npy", "plan_starts.npy", "dt.npy", "masks.npy", "boxes.npy",
}  # fmt: skip
_LISTS: Final = "lists.safetensors"  # of very many plans only


def save_memory(folder: Path, memory: Memory) -> None:
    """Write a memory as a folder, whole or not at all; the same memory gives the same bytes."""
    plans = store_plans(memory.plans, state_size(memory.vehicle))
    header = {
        "class": memory.class_name,
        "objective": memory.objective,
        "architecture": _sizes(architecture_of(memory.weights)),
        "metadata": memory.metadata,
    }
    files: Files = {
        _WEIGHTS: _tensors(memory.weights),
        _ONNX: to_onnx(memory.weights),
        _READOUT: _tensors(
            {"centroids": memory.centroids, "vectors": memory.vectors, "biases": memory.biases}
        ),
        "states.npy": plans.states,
        "controls.npy": plans.controls,
        "plan_starts.npy": plans.starts,
        "dt.npy": plans.dt,
        "masks.npy": memory.masks,
        "boxes.npy": memory.sweeps.boxes,
    }
    if memory.lists is not None:
        kept = {name: getattr(memory.lists, name) for name in ("centres", "starts", "plans")}
        files = {**files, _LISTS: _tensors(kept)}
    write_archive(folder, _KIND, memory.vehicle, header, files)


def load_memory(folder: Path, vehicle: Vehicle = CAR) -> Memory:
    """The memory in a folder; its plans and masks are read from the disk as they are used.

    StorageError: missing, damaged, not as long as it says, of another version, for another vehicle or grid.
    """
    header, files = read_archive(folder, _KIND, vehicle)
    try:
        if files.keys() - {_LISTS} != _FILES:
            odd = ", ".join(sorted((files.keys() - {_LISTS}) ^ _FILES))
            raise ValueError(f"it lacks or has too much of: {odd}")
        weights, readout = load(bytes(files[_WEIGHTS])), load(bytes(files[_READOUT]))
        sizes = _sizes(architecture_of(weights))
        plans = _plans(files, state_size(vehicle))
        rows = (len(plans) + 1, sizes["dimensions"])
        shapes = {"centroids": rows, "vectors": rows, "biases": rows[:1]}
        fitting = {name: tensor.shape for name, tensor in readout.items()} == shapes
        if header["architecture"] != sizes or not fitting:
            raise ValueError("its encoder, readout and plans do not fit each other")
        _check_numbers(weights | readout)
        return Memory(
            class_name=_text(header["class"]),
            vehicle=vehicle,
            plans=plans,
            sweeps=_sweeps(files, plans, vehicle),
            masks=array_of(files["masks.npy"], "<u8", (GRID,)),
            centroids=readout["centroids"],
            vectors=readout["vectors"],
            biases=readout["biases"],
            objective=_text(header["objective"]),
            weights=weights,
            metadata=dict(header["metadata"]),
            lists=(
                lists_with(**load(bytes(files[_LISTS])), vectors=readout["vectors"], biases=readout["biases"])
                if _LISTS in files
                else None
            ),
        )
    except (KeyError, TypeError, ValueError, SafetensorError) as error:
        raise StorageError(f"{folder} is no whole memory ({error}); build it again.") from None


def _plans(files: Mapping[str, Contents], size: int) -> StoredPlans:
    plans = StoredPlans(
        array_of(files["states.npy"], "<f8", (size,)),
        array_of(files["controls.npy"], "<f8", (2,)),
        array_of(files["plan_starts.npy"], "<i8"),
        array_of(files["dt.npy"], "<f8"),
    )
    for numbers in (plans.states, plans.controls, plans.dt):
        _check_finite(numbers)
    return plans


def _sweeps(files: Mapping[str, Contents], plans: StoredPlans, vehicle: Vehicle) -> PlanSweeps:
    boxes = array_of(files["boxes.npy"], "<f8", (6,))
    if len(boxes) != body_count(vehicle) * len(plans.states):
        raise ValueError(f"it has {len(boxes)} swept boxes of {len(plans.states)} states")
    _check_finite(boxes)
    return sweeps_with(boxes, plans)


def _check_finite(numbers: Array) -> None:
    if not (np.isfinite(numbers.min(initial=0.0)) and np.isfinite(numbers.max(initial=0.0))):
        raise ValueError("its plans have numbers that are not finite")


def _check_numbers(tensors: Mapping[str, Floats32]) -> None:
    """Infinitely far centroids and impossible rows are fine; what is no number would compare as anything."""
    for name, tensor in tensors.items():
        if tensor.dtype != np.float32 or np.isnan(tensor).any():
            raise ValueError(f"{name} is no array of float32 numbers")


def _tensors(tensors: Mapping[str, Array]) -> bytes:
    return save({name: np.ascontiguousarray(tensor) for name, tensor in tensors.items()})


def _sizes(architecture: Architecture) -> dict[str, Any]:
    """The architecture as JSON values."""
    return {
        name: list(size) if isinstance(size, tuple) else size for name, size in asdict(architecture).items()
    }


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise ValueError(f"{value!r:.40} is no text")
    return value
