from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from planners.memory.hallucination.learned_obstacles import weight_shapes
from planners.world.vehicles.vehicle import CAR_1_TRAILER
from storage.archives.hallucinators import load_hallucinator, save_hallucinator
from storage.errors import StorageError

RNG = np.random.default_rng(1)
WEIGHTS = {name: RNG.normal(size=shape).astype(np.float32) for name, shape in weight_shapes().items()}


def test_weights_come_back(tmp_path: Path) -> None:
    save_hallucinator(tmp_path / "one", WEIGHTS)
    loaded = load_hallucinator(tmp_path / "one")
    assert loaded.keys() == WEIGHTS.keys()
    assert all(np.array_equal(loaded[name], WEIGHTS[name]) for name in WEIGHTS)
    save_hallucinator(tmp_path / "other", WEIGHTS)
    for file in (tmp_path / "one").iterdir():
        assert file.read_bytes() == (tmp_path / "other" / file.name).read_bytes()


def test_what_does_not_fit_is_refused_in_one_line(tmp_path: Path) -> None:
    save_hallucinator(tmp_path / "trailer", WEIGHTS, CAR_1_TRAILER)
    save_hallucinator(tmp_path / "narrow", WEIGHTS | {"linear.bias": np.zeros(3, np.float32)})
    save_hallucinator(tmp_path / "damaged", WEIGHTS)
    file = tmp_path / "damaged" / "weights.safetensors"
    file.write_bytes(file.read_bytes()[:-1] + b"!")
    for name, told in (
        ("trailer", "car-1-trailer"),
        ("narrow", "linear.bias is float32"),
        ("damaged", "damaged"),
        ("missing", "holds no hallucinator"),
    ):
        with pytest.raises(StorageError, match=told) as refused:
            load_hallucinator(tmp_path / name)
        assert "\n" not in str(refused.value)
