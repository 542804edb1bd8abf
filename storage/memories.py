"""Memories on disk: weights, plans and centroids as safetensors, the encoder as ONNX, the rest as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from planners.memory.labels import sweep_plans
from planners.memory.masks import masks_of
from planners.memory.recall import Memory
from planners.world.problem import Plan
from planners.world.vehicle import CAR, Vehicle, state_size
from storage.archives import read_archive, write_archive
from storage.columns import Array
from storage.errors import StorageError

_KIND: Final = "memory"
_TENSORS: Final = "tensors.safetensors"
_ENCODER: Final = "encoder.safetensors"
_ONNX: Final = "encoder.onnx"  # the same network for other programs


def save_memory(folder: Path, memory: Memory) -> None:
    """Write a memory as a folder, whole or not at all; the same memory gives the same bytes."""
    header = {"class": memory.class_name, "objective": memory.objective, "metadata": memory.metadata}
    tensors = {
        "centroids": memory.centroids,
        "vectors": memory.vectors,
        "biases": memory.biases,
        **_plan_tensors(memory.plans, state_size(memory.vehicle)),
    }
    files = {
        _TENSORS: save({name: np.ascontiguousarray(tensor) for name, tensor in tensors.items()}),
        _ENCODER: save({name: np.ascontiguousarray(tensor) for name, tensor in memory.weights.items()}),
        _ONNX: memory.encoder.model,
    }
    write_archive(folder, _KIND, memory.vehicle, header, files)


def load_memory(folder: Path, vehicle: Vehicle = CAR) -> Memory:
    """The memory in a folder.

    StorageError: missing, damaged, of a newer version, for another vehicle or another grid.
    """
    header, files = read_archive(folder, _KIND, vehicle)
    try:
        tensors = load(files[_TENSORS])
        plans = _plans(tensors)
        sweeps = sweep_plans(plans, vehicle)
        return Memory(
            class_name=header["class"],
            vehicle=vehicle,
            plans=plans,
            sweeps=sweeps,
            masks=masks_of(sweeps),
            centroids=tensors["centroids"],
            vectors=tensors["vectors"],
            biases=tensors["biases"],
            objective=header["objective"],
            weights=load(files[_ENCODER]),
            metadata=header["metadata"],
        )
    except (KeyError, ValueError, SafetensorError) as error:
        raise StorageError(f"{folder} is no whole memory ({error}); build it again.") from None


def _plan_tensors(plans: Sequence[Plan], size: int) -> dict[str, Array]:
    """All plans end to end; ``plan_starts [N + 1]`` says where each plan's states begin."""
    return {
        "states": np.concatenate([np.empty((0, size)), *(plan.states for plan in plans)]),
        "controls": np.concatenate([np.empty((0, 2)), *(plan.controls for plan in plans)]),
        "plan_starts": np.cumsum([0] + [len(plan.states) for plan in plans], dtype=np.int64),
        "dt": np.array([plan.dt for plan in plans]),
    }


def _plans(tensors: dict[str, Array]) -> tuple[Plan, ...]:
    starts = tensors["plan_starts"][1:-1]
    before = np.arange(1, len(starts) + 1)  # each plan has one control fewer than states
    states = np.split(tensors["states"], starts)
    controls = np.split(tensors["controls"], starts - before)
    durations = tensors["dt"].tolist()
    return tuple(Plan(*parts) for parts in zip(states, controls, durations, strict=False))
