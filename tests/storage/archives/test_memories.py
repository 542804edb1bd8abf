from __future__ import annotations

import errno
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planners.memory.encoder.training import Checkpoint, Epoch, TrainedEncoder, TrainingSettings
from planners.memory.ranking.inverted_lists import list_readout
from planners.memory.recall import STRATEGIES, recall
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, VEHICLES
from planners.world.view import View
from storage.archives.checkpoints import epochs_kept, load_checkpoint, save_checkpoint
from storage.archives.encoders import load_encoder, save_encoder
from storage.archives.memories import load_memory, save_memory
from storage.errors import StorageError
from storage.places import files
from tests.storage.samples import ARCHITECTURE, WEIGHTS, a_memory, same_plan
from tests.worlds import strewn

GRID = (np.random.default_rng(1).random((64, 64)) < 0.2).astype(np.uint8)


def contents(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir()}


@pytest.mark.parametrize("plans", [1, 2, 7])
def test_a_memory_comes_back_exactly_and_gives_the_same_bytes(tmp_path: Path, plans: int) -> None:
    memory = a_memory(plans)
    save_memory(tmp_path / "one", memory)
    loaded = load_memory(tmp_path / "one")
    for name in ("class_name", "vehicle", "objective", "metadata", "encoder"):
        assert getattr(loaded, name) == getattr(memory, name)
    for name in ("centroids", "vectors", "biases", "masks"):
        assert np.array_equal(getattr(loaded, name), getattr(memory, name))
    assert all(map(same_plan, memory.plans, loaded.plans))
    assert all(np.array_equal(a, b) for a, b in zip(memory.sweeps, loaded.sweeps, strict=True))
    assert np.array_equal(loaded.encoder(GRID), memory.encoder(GRID))
    save_memory(tmp_path / "two", loaded)
    assert contents(tmp_path / "one") == contents(tmp_path / "two")


def test_a_memory_from_the_disk_answers_exactly_as_the_one_that_was_saved(tmp_path: Path) -> None:
    memory = a_memory(5)
    memory = replace(memory, lists=list_readout(memory.vectors, memory.biases))
    save_memory(tmp_path / "m", memory)
    loaded = load_memory(tmp_path / "m")
    assert all(np.array_equal(a, b) for a, b in zip(memory.lists, loaded.lists, strict=True))
    for seed in range(20):
        problem = strewn(seed, 20)
        for strategy in STRATEGIES:
            ours, theirs = (
                recall(each, View(problem), strategy, 3, np.random.default_rng(seed))
                for each in (memory, loaded)
            )
            assert ours == theirs


def trained_encoder() -> TrainedEncoder:
    rng = np.random.default_rng(2)
    rows = (4, ARCHITECTURE.dimensions)
    return TrainedEncoder(
        settings=TrainingSettings(semi_hard=True, architecture=ARCHITECTURE),
        weights=WEIGHTS,
        centroids=rng.normal(size=rows).astype(np.float32),
        vectors=rng.normal(size=rows).astype(np.float32),
        biases=np.array([-np.inf, *rng.normal(size=3)], np.float32),
        popularity=rng.random(3).astype(np.float32),
        history=(Epoch(1, float("nan"), 0.25, 0.5, 0.75, 1.5), Epoch(2, 0.1, 0.25, 0.5, 0.75, 3.0)),
        held_out=np.array([1, 5, 9], np.int32),
    )


def test_a_trained_encoder_comes_back_exactly(tmp_path: Path) -> None:
    trained = trained_encoder()
    save_encoder(tmp_path / "model", trained)
    loaded = load_encoder(tmp_path / "model")
    assert loaded.settings == trained.settings
    assert loaded.weights.keys() == WEIGHTS.keys()
    assert all(np.array_equal(loaded.weights[name], WEIGHTS[name]) for name in WEIGHTS)
    for name in ("centroids", "vectors", "biases", "popularity", "held_out"):
        assert np.array_equal(getattr(loaded, name), getattr(trained, name))
    assert loaded.history[1] == trained.history[1]
    assert np.array_equal(loaded.history, trained.history, equal_nan=True)
    assert loaded.score == 0.25


def test_a_checkpoint_comes_back_for_its_own_training_only(tmp_path: Path) -> None:
    states = [np.arange(5, dtype=np.float32) * i for i in range(4)]
    checkpoint = Checkpoint((Epoch(1, 0.5, 0.25, 0.5, 0.75, 1.5),), *states)
    path = tmp_path / "0.checkpoint.safetensors"
    assert load_checkpoint(path, "a") is None
    save_checkpoint(path, checkpoint, "a")
    loaded = load_checkpoint(path, "a")
    assert loaded is not None
    assert loaded.history == checkpoint.history
    assert all(map(np.array_equal, loaded[1:], checkpoint[1:]))
    assert load_checkpoint(path, "b") is None
    assert (epochs_kept(path, "a"), epochs_kept(path, "b")) == (1, 0)
    path.write_bytes(path.read_bytes()[:-1])
    assert load_checkpoint(path, "a") is None


@pytest.mark.parametrize("name", VEHICLES)
def test_a_memory_is_only_loaded_for_its_vehicle(tmp_path: Path, name: str) -> None:
    memory = a_memory(vehicle=VEHICLES[name])
    save_memory(tmp_path / "m", memory)
    assert all(map(same_plan, memory.plans, load_memory(tmp_path / "m", VEHICLES[name]).plans))
    for other in VEHICLES:
        if other != name:
            told = f"made for vehicle {name}, expected {other}: .*; use --vehicle {name}, or make one"
            with pytest.raises(StorageError, match=told):
                load_memory(tmp_path / "m", VEHICLES[other])


def test_an_encoder_is_only_loaded_for_its_vehicle(tmp_path: Path) -> None:
    trained = trained_encoder()
    save_encoder(tmp_path / "model", trained, CAR_1_TRAILER)
    assert load_encoder(tmp_path / "model", CAR_1_TRAILER).settings == trained.settings
    with pytest.raises(StorageError, match="made for vehicle car-1-trailer, expected car: trailers"):
        load_encoder(tmp_path / "model")


def test_a_vehicle_of_the_same_name_is_refused_with_what_is_different(tmp_path: Path) -> None:
    save_memory(tmp_path / "m", a_memory(vehicle=CAR._replace(width=1.5)))
    with pytest.raises(StorageError, match=r"vehicle car, expected car: body is .*0\.75.* there and"):
        load_memory(tmp_path / "m")


def test_a_folder_without_a_memory_is_said_so(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match=r"holds no memory \(it has no memory\.json\)"):
        load_memory(tmp_path)
    with pytest.raises(StorageError, match="gone does not exist"):
        load_memory(tmp_path / "gone")


def test_a_memory_replaces_the_one_before_whole(tmp_path: Path) -> None:
    save_memory(tmp_path / "m", a_memory(3))
    (tmp_path / "m" / "stray").touch()
    save_memory(tmp_path / "m", a_memory(5))
    assert len(load_memory(tmp_path / "m").plans) == 5
    assert [file.name for file in tmp_path.iterdir()] == ["m"]
    assert not (tmp_path / "m" / "stray").exists()


def test_a_full_disk_leaves_the_memory_that_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_memory(tmp_path / "m", a_memory())
    before = contents(tmp_path / "m")

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("storage.archives.archive.write_array", full)
    with pytest.raises(StorageError, match="No space left"):
        save_memory(tmp_path / "m", replace(a_memory(5), class_name="curves"))
    assert contents(tmp_path / "m") == before
    assert [file.name for file in tmp_path.iterdir()] == ["m"]


def test_a_memory_comes_back_to_its_place_when_its_successor_cannot_take_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_memory(tmp_path / "m", a_memory())
    before = contents(tmp_path / "m")
    rename = Path.replace

    def stumble(source: Path, target: Path) -> Path:
        if source.name.startswith(".m.") and ".old." not in source.name:
            raise OSError(errno.EIO, "Input/output error")
        return rename(source, target)

    monkeypatch.setattr(Path, "replace", stumble)
    monkeypatch.setattr(files, "swap", lambda *_: False)
    with pytest.raises(StorageError, match="Input/output error"):
        save_memory(tmp_path / "m", a_memory(5))
    assert contents(tmp_path / "m") == before
    assert [file.name for file in tmp_path.iterdir()] == ["m"]


def test_a_memory_can_be_copied_elsewhere(tmp_path: Path) -> None:
    save_memory(tmp_path / "m", a_memory())
    shutil.copytree(tmp_path / "m", tmp_path / "copy")
    assert len(load_memory(tmp_path / "copy").plans) == 3
