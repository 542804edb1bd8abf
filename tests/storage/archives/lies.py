"""Archives whose checksums are right and whose contents are not."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import load_file, save_file

from planners.memory.encoder.training import Epoch, TrainedEncoder, TrainingSettings
from planners.memory.hallucination.learned_obstacles import weight_shapes
from storage.archives.arrays import write_array
from storage.archives.encoders import load_encoder, save_encoder
from storage.archives.hallucinators import load_hallucinator, save_hallucinator
from storage.archives.memories import load_memory, save_memory
from storage.errors import StorageError
from tests.storage.archives.signing import sign
from tests.storage.samples import ARCHITECTURE, WEIGHTS, a_memory

ROWS = (4, ARCHITECTURE.dimensions)
TRAINED = TrainedEncoder(
    settings=TrainingSettings(architecture=ARCHITECTURE),
    weights=WEIGHTS,
    centroids=np.zeros(ROWS, np.float32),
    vectors=np.ones(ROWS, np.float32),
    biases=np.array([-np.inf, 0.0, 1.0, 2.0], np.float32),
    popularity=np.array([0.1, 0.2, 0.3], np.float32),
    history=(Epoch(1, float("nan"), 0.25, 0.5, 0.75, 1.5),),
    held_out=np.array([1, 5, 9], np.int32),
)
LEARNED = {name: np.zeros(shape, np.float32) for name, shape in weight_shapes().items()}
LOADERS: dict[str, Callable[[Path], object]] = {
    "memory": load_memory,
    "encoder": load_encoder,
    "hallucinator": load_hallucinator,
}


def write_archives(folder: Path) -> Path:
    """One of each kind, as it should be."""
    save_memory(folder / "memory", a_memory(3))
    save_encoder(folder / "encoder", TRAINED)
    save_hallucinator(folder / "hallucinator", LEARNED)
    return folder


def refusal(folder: Path) -> str:
    with pytest.raises(StorageError) as error:
        LOADERS[folder.name](folder)
    text = str(error.value)
    assert str(folder) in text
    assert "\n" not in text
    return text


def change_array(folder: Path, name: str, change: Callable[[np.ndarray], object]) -> None:
    array = np.load(folder / name).copy()
    change(array)
    with (folder / name).open("wb") as file:
        write_array(file, array)
    sign(folder)


def change_tensors(folder: Path, name: str, tensors: Mapping[str, np.ndarray | None]) -> None:
    changed = {**load_file(folder / name), **tensors}
    save_file({key: tensor for key, tensor in changed.items() if tensor is not None}, folder / name)
    sign(folder, folder.name)
