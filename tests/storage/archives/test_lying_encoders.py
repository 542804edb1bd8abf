"""Encoders, hallucinators and checkpoints whose contents do not fit: refused in one line."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors.numpy import load_file, save_file

from planners.memory.encoder.training import Checkpoint
from storage.archives.checkpoints import load_checkpoint, save_checkpoint
from tests.storage.archives.lies import LEARNED, TRAINED, change_tensors, refusal
from tests.storage.archives.signing import sign


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"epochs": "x"},
        {"epochs": 1e9},
        {"threads": True},
        {"learning_rate": "0.1"},
        {"objective": "x"},
        {"objective": ["labels"]},
        {"semi_hard": 1},
        {"held_out_share": None},
        {"seed": 0.5},
        {"unknown": 1},
        {"architecture": {}},
        {"architecture": {"channels": 2, "hidden": [8], "dimensions": 4}},
        {"architecture": {"channels": [2, 3], "hidden": [8], "dimensions": 5}},
        {"architecture": {"channels": [2, 3], "hidden": [8], "dimensions": "4"}},
    ],
)
def test_settings_that_no_training_had_are_refused(archives: Path, change: dict[str, Any]) -> None:
    claimed = json.loads(json.dumps(asdict(TRAINED.settings))) | change
    sign(archives / "encoder", "encoder", settings=claimed if change else [])
    refusal(archives / "encoder")


@pytest.mark.parametrize(
    "tensors",
    [
        {"centroids": np.zeros((3, 4), np.float32)},
        {"centroids": np.zeros((4, 4), np.float64)},
        {"vectors": np.full((4, 4), np.nan, np.float32)},
        {"biases": np.zeros(5, np.float32)},
        {"popularity": np.zeros(4, np.float32)},
        {"held_out": np.array([-1], np.int32)},
        {"held_out": np.array([0.5], np.float32)},
        {"held_out": np.zeros((2, 2), np.int32)},
        {"history": np.zeros((0, 6))},
        {"history": np.zeros((1, 5))},
        {"history": np.full((1, 6), np.nan)},
        {"history": None},
        {"extra": np.zeros(3, np.float32)},
        {"weights.linear.0.bias": np.zeros(3, np.float32)},
        {"weights.linear.0.bias": np.full(8, np.nan, np.float32)},
    ],
)
def test_an_encoder_whose_arrays_do_not_fit_is_refused(
    archives: Path, tensors: dict[str, np.ndarray | None]
) -> None:
    change_tensors(archives / "encoder", "tensors.safetensors", tensors)
    refusal(archives / "encoder")


@pytest.mark.parametrize(
    "tensors",
    [
        {"linear.bias": np.full(LEARNED["linear.bias"].shape, np.nan, np.float32)},
        {"linear.bias": LEARNED["linear.bias"].astype(np.float64)},
        {"linear.bias": None},
        {"more": np.zeros(3, np.float32)},
    ],
)
def test_a_hallucinator_whose_arrays_do_not_fit_is_refused(
    archives: Path, tensors: dict[str, np.ndarray | None]
) -> None:
    change_tensors(archives / "hallucinator", "weights.safetensors", tensors)
    refusal(archives / "hallucinator")


@pytest.mark.parametrize(
    "change",
    [
        {"values": np.zeros(4, np.float32)},
        {"mean": np.zeros(5, np.float64)},
        {"best": np.full(5, np.nan, np.float32)},
        {"square": None},
        {"history": np.zeros((0, 6))},
        {"history": np.zeros((1, 5))},
        {"history": np.zeros(6)},
        {name: np.zeros((), np.float32) for name in ("values", "mean", "square", "best")},
        {"history": np.full((1, 6), np.nan)},
        {},
    ],
)
def test_a_checkpoint_that_lies_is_none(tmp_path: Path, change: dict[str, np.ndarray | None]) -> None:
    path = tmp_path / "0.checkpoint.safetensors"
    states = [np.zeros(5, np.float32)] * 4
    save_checkpoint(path, Checkpoint(TRAINED.history, *states), "key")
    assert load_checkpoint(path, "key") is not None
    kept = {name: tensor for name, tensor in (load_file(path) | change).items() if tensor is not None}
    save_file(kept, path, {"key": "key"} if change else None)
    assert load_checkpoint(path, "key") is None
