"""Memories on disk: archives of the encoder, its readout, and the plans as plain arrays.

Small arrays are safetensors. Arrays that grow with the plans are ``.npy`` files, which stay on the disk until
they are used.
"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np

from planners.memory.encoder.encoder import (
    LARGEST_VALUE,
    Architecture,
    architecture_of,
    described_architecture,
    embedding_bound,
    magnitude,
    weight_shapes,
)
from planners.memory.encoder.training import OBJECTIVES
from planners.memory.memory import Memory
from planners.memory.plans.cell_masks import masks_of
from planners.memory.plans.plan_arrays import StoredPlans, store_plans
from planners.memory.plans.sweeps import PlanSweeps, sweep_plans, sweeps_with
from planners.memory.ranking.inverted_lists import lists_with
from planners.world.arrays import Floats, Floats32
from planners.world.geometry.occupancy import GRID, Bits
from planners.world.vehicles.vehicle import CAR, Vehicle, state_size
from storage.archives.archive import Files, read_archive, write_archive
from storage.archives.arrays import array_of
from storage.archives.plan_files import PLAN_FILES, files_of_plans, plans_in
from storage.archives.tensors import check_floats, packed, unpacked
from storage.errors import StorageError
from storage.fields import scale_of, short, text_of
from storage.places.run_folder import checked_name

_KIND: Final = "memory"
_WEIGHTS: Final = "encoder.safetensors"
_READOUT: Final = "readout.safetensors"
_FILES: Final = {
    _WEIGHTS, _READOUT, *PLAN_FILES, "masks.npy", "boxes.npy",
}  # fmt: skip
SWEPT_AT_ONCE: Final = 1_000  # plans; their boxes take 10 MB
_LISTS: Final = "lists.safetensors"  # only in a memory with very many plans
_UNREAD: Final = "encoder.onnx"  # earlier versions wrote it for other programs


def save_memory(folder: Path, memory: Memory) -> None:
    """Write a ``memory`` as a ``folder``, whole or not at all; the same memory gives the same bytes."""
    plans = store_plans(memory.plans, state_size(memory.vehicle))
    header = {
        "class": memory.class_name,
        "objective": memory.objective,
        "architecture": _sizes(architecture_of(memory.weights)),
        "metadata": memory.metadata,
    }
    files: Files = {
        _WEIGHTS: packed(memory.weights),
        _READOUT: packed({"centroids": memory.centroids, "vectors": memory.vectors, "biases": memory.biases}),
        **files_of_plans(plans),
        "masks.npy": memory.masks,
        "boxes.npy": memory.sweeps.boxes,
    }
    if memory.lists is not None:
        lists = {name: getattr(memory.lists, name) for name in ("centres", "starts", "plans")}
        files = {**files, _LISTS: packed(lists)}
    write_archive(folder, _KIND, memory.vehicle, header, files)


def load_memory(folder: Path, vehicle: Vehicle = CAR) -> Memory:
    """The memory of a ``vehicle`` in a ``folder``; its plans and boxes are read from the disk when used.

    Checksums show that files are unchanged, not that they are true. Therefore every plan is swept again, and
    its boxes and masks must be the same to the last bit (kernels give the same bits everywhere). No plan may
    count as free because of boxes that are not its own, or that an older program made smaller. This takes
    4 ms for 100 plans and a quarter of a second for 10,000 (hashing the files takes a sixth). Boxes are
    compared, not replaced, so that processes keep sharing the files' memory, unless all boxes have other
    sizes because an older version used other margins.

    Raises StorageError if it is missing or damaged, contradicts its header, has another version, or is for
    another vehicle or grid.
    """
    header, files = read_archive(folder, _KIND, vehicle)
    try:
        if files.keys() - {_LISTS, _UNREAD} != _FILES:
            different = ", ".join(sorted((files.keys() - {_LISTS, _UNREAD}) ^ _FILES))
            raise ValueError(f"missing or too many: {different}")
        weights, readout = unpacked(files[_WEIGHTS]), unpacked(files[_READOUT])
        architecture = architecture_of(weights)
        if described_architecture(header["architecture"]) != architecture:
            raise ValueError("its encoder does not have the architecture that its header states")
        plans = plans_in(files, vehicle)
        rows = (len(plans) + 1, architecture.dimensions)
        check_floats(weights, weight_shapes(architecture))
        check_floats(readout, {"centroids": rows, "vectors": rows, "biases": rows[:1]})
        _check_scores(readout["vectors"], embedding_bound(weights))
        boxes, masks = array_of(files["boxes.npy"], "<f8", (6,)), array_of(files["masks.npy"], "<u8", (GRID,))
        sweeps, masks = _swept(boxes, masks, plans, vehicle)
        rows_of_lists = {"vectors": readout["vectors"], "biases": readout["biases"]}
        return Memory(
            class_name=checked_name(text_of(header["class"], "class")),
            vehicle=vehicle,
            plans=plans,
            sweeps=sweeps,
            masks=masks,
            centroids=readout["centroids"],
            vectors=readout["vectors"],
            biases=readout["biases"],
            objective=_objective(header["objective"]),
            weights=weights,
            metadata=_metadata(header["metadata"]),
            lists=lists_with(**unpacked(files[_LISTS]), **rows_of_lists) if _LISTS in files else None,
        )
    except (KeyError, TypeError, ValueError, StorageError) as error:
        reason = str(error).rstrip(".")
        raise StorageError(f"{folder} is not a complete memory ({reason}); build it again.") from None


def _swept(boxes: Floats, masks: Bits, plans: StoredPlans, vehicle: Vehicle) -> tuple[PlanSweeps, Bits]:
    """The sweeps with the stored boxes, and the masks; computed if all stored boxes have other sizes.

    Raises ValueError if boxes or masks do not match the plans.
    """
    sweeps = sweeps_with(boxes, plans)
    anew: list[tuple[Floats, Bits]] = []
    for first in range(0, len(plans), SWEPT_AT_ONCE):
        some = slice(first, first + SWEPT_AT_ONCE)
        again = sweep_plans(plans[some], vehicle)
        cells = masks_of(again)
        stored = boxes[sweeps.starts[first] : sweeps.starts[first] + len(again.boxes)]
        if np.array_equal(stored[:, :4], again.boxes[:, :4]) and (stored != again.boxes)[:, 4:].all():
            anew.append((again.boxes, cells))
        elif anew or not (np.array_equal(stored, again.boxes) and np.array_equal(masks[some], cells)):
            raise ValueError("its swept boxes or cells do not match its plans")
    if not anew:
        return sweeps, masks
    boxes, masks = (np.concatenate(parts) for parts in zip(*anew, strict=True))
    return sweeps_with(boxes, plans), masks


def _check_scores(vectors: Floats32, largest: float) -> None:
    """Raise ValueError if ``vectors [n, D]`` times embeddings of entries up to ``largest`` could overflow."""
    if not magnitude(vectors) * largest * vectors.shape[1] <= LARGEST_VALUE:
        raise ValueError("the vectors of its readout are so large that scores could overflow")


def _objective(value: object) -> str:
    if value not in OBJECTIVES:
        raise ValueError(f"its objective is {short(value)}, expected one of {', '.join(OBJECTIVES)}")
    return str(value)


def _metadata(value: object) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"its metadata are {short(value)}, expected an object")
    scales = value.get("scales", [1.0])
    if not isinstance(scales, list) or not scales or len({scale_of(scale) for scale in scales}) < len(scales):
        raise ValueError(f"its scales are {short(scales)}, expected distinct numbers")
    return value


def _sizes(architecture: Architecture) -> dict[str, Any]:
    """The architecture as JSON values."""
    return {
        name: list(size) if isinstance(size, tuple) else size for name, size in asdict(architecture).items()
    }
