"""Training as a stage: what is killed goes on from its last epoch, and ends as if nothing had happened."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planners.memory.encoder.training import Checkpoint
from storage.archives.encoders import load_encoder
from storage.tables.hallucinated import Labelled
from tasks.fan_out.chunk import Chunk
from tasks.settings.presets import for_preset
from tasks.stages import train

SETTINGS = for_preset("smoke", classes=["trap"], epochs=3, learning={"seeds": 2, "hidden": [8]})
PLANS = 4


def problems(*_: object) -> Labelled:
    rng = np.random.default_rng(0)
    labels = rng.random((200, PLANS)) < 0.4
    made_for = np.where(labels.any(1), labels.argmax(1), -1).astype(np.int32)
    grids = rng.integers(0, 256, (200, 512), np.uint8)
    return Labelled(grids, made_for, np.packbits(labels, axis=1), PLANS)


def chunk_in(folder: Path, seed: int = 0) -> Chunk:
    return Chunk(str(folder), SETTINGS, "trap", seed, 0, SETTINGS.epochs, "key")


@pytest.fixture(autouse=True)
def _given_problems(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(train, "problems_of_memory", problems)
    monkeypatch.setattr(train, "taught_masks", lambda *_: np.zeros((4, 64), np.uint64))


@pytest.mark.parametrize("epochs", [1, 2, 3])
def test_a_training_killed_after_any_epoch_ends_with_the_same_encoder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, epochs: int
) -> None:
    train.train_chunk(chunk_in(tmp_path / "whole"))
    save = train.save_checkpoint

    def save_and_die(path: Path, checkpoint: Checkpoint, key: str) -> None:
        save(path, checkpoint, key)
        if len(checkpoint.history) == epochs:
            raise KeyboardInterrupt

    chunk = chunk_in(tmp_path / "killed")
    with monkeypatch.context() as patched:
        patched.setattr(train, "save_checkpoint", save_and_die)
        with pytest.raises(KeyboardInterrupt):
            train.train_chunk(chunk)
    assert train.TRAIN.units_done(chunk) == epochs
    assert not train.TRAIN.is_written(chunk)
    result = train.train_chunk(chunk)
    assert [epoch["epoch"] for epoch in result.epochs] == [1, 2, 3]
    assert train.TRAIN.is_written(chunk)
    assert train.TRAIN.units_done(chunk) == 3
    whole, resumed = (
        load_encoder(chunk_in(tmp_path / name).run.model("trap")) for name in ("whole", "killed")
    )
    for name in whole.weights:
        assert np.array_equal(whole.weights[name], resumed.weights[name])
    assert np.array_equal(whole.biases, resumed.biases)


def test_a_checkpoint_of_other_problems_is_not_gone_on_from(tmp_path: Path) -> None:
    train.train_chunk(chunk_in(tmp_path))
    other = replace(chunk_in(tmp_path), key="another")
    assert train.TRAIN.units_done(other) == 0
    assert not train.TRAIN.is_written(other)


def test_each_seed_has_an_encoder_of_its_own(tmp_path: Path) -> None:
    for seed in (0, 1):
        train.train_chunk(chunk_in(tmp_path, seed))
    one, other = (load_encoder(chunk_in(tmp_path).run.model("trap", seed)) for seed in (0, 1))
    assert (one.settings.seed, other.settings.seed) == (SETTINGS.seed, SETTINGS.seed + 1)
    assert np.array_equal(one.held_out, other.held_out)
    assert not np.array_equal(one.weights["linear.0.weight"], other.weights["linear.0.weight"])
