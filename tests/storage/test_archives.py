from __future__ import annotations

import errno
import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planners.memory.encoder import Architecture, initial_weights
from planners.memory.labels import sweep_plans
from planners.memory.masks import masks_of
from planners.memory.recall import Memory
from planners.memory.training import Epoch, TrainedEncoder, TrainingSettings
from planners.world.vehicle import CAR, CAR_1_TRAILER, VEHICLES, Vehicle
from storage.encoders import load_encoder, save_encoder
from storage.errors import StorageError
from storage.memories import load_memory, save_memory
from tests.storage.samples import plan, same_plan

ARCHITECTURE = Architecture(channels=(2, 3), hidden=(8,), dimensions=4)
WEIGHTS = initial_weights(ARCHITECTURE, np.random.default_rng(0))
GRID = (np.random.default_rng(1).random((64, 64)) < 0.2).astype(np.uint8)


def a_memory(plans: int = 3, seed: int = 0, vehicle: Vehicle = CAR) -> Memory:
    rng = np.random.default_rng(seed)
    stored = tuple(plan(5 + i, seed + i, vehicle) for i in range(plans))
    sweeps = sweep_plans(stored, vehicle)
    rows = (plans + 1, ARCHITECTURE.dimensions)
    return Memory(
        class_name="trap",
        vehicle=vehicle,
        plans=stored,
        sweeps=sweeps,
        masks=masks_of(sweeps),
        centroids=rng.normal(size=rows).astype(np.float32),
        vectors=rng.normal(size=rows).astype(np.float32),
        biases=np.array([-np.inf, *rng.normal(size=plans)], np.float32),
        objective="labels",
        weights=WEIGHTS,
        metadata={"run": "one", "problems": 120, "über": [1.5, None]},
    )


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


@pytest.mark.parametrize("learned", [True, False])
def test_a_trained_encoder_comes_back_exactly(tmp_path: Path, learned: bool) -> None:
    settings = TrainingSettings(objective="labels" if learned else "triplet", architecture=ARCHITECTURE)
    trained = TrainedEncoder(
        settings,
        WEIGHTS,
        np.ones((4, 4), np.float32) if learned else None,
        np.zeros(4, np.float32) if learned else None,
        (Epoch(1, float("nan"), 0.25, 0.5, 0.75, 1.5), Epoch(2, 0.1, 0.25, 0.5, 0.75, 3.0)),
        np.array([1, 5, 9], np.int32),
    )
    save_encoder(tmp_path / "model", trained)
    loaded = load_encoder(tmp_path / "model")
    assert loaded.settings == settings
    assert loaded.weights.keys() == WEIGHTS.keys()
    assert all(np.array_equal(loaded.weights[name], WEIGHTS[name]) for name in WEIGHTS)
    assert (loaded.vectors is None) == (loaded.biases is None) == (not learned)
    assert loaded.history[1] == trained.history[1]
    assert np.array_equal(loaded.history, trained.history, equal_nan=True)
    assert np.array_equal(loaded.validation, trained.validation)


@pytest.mark.parametrize("name", ["memory.json", "encoder.onnx", "tensors.safetensors"])
@pytest.mark.parametrize("damage", ["flip", "cut", "remove"])
def test_a_damaged_memory_is_refused_in_one_line(tmp_path: Path, name: str, damage: str) -> None:
    save_memory(tmp_path / "m", a_memory())
    file = tmp_path / "m" / name
    data = file.read_bytes()
    if damage == "flip":
        middle = data.index(b'"labels"') + 2 if name == "memory.json" else len(data) // 2
        file.write_bytes(data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :])
    elif damage == "cut":
        file.write_bytes(data[:-20])
    else:
        file.unlink()
    with pytest.raises(StorageError) as error:
        load_memory(tmp_path / "m")
    assert str(tmp_path / "m") in str(error.value)
    assert "\n" not in str(error.value)


def edited(folder: Path, change: dict[str, object]) -> None:
    """Change a memory's header and sign it, as another version of this program would."""
    from storage.archives import _header_checksum

    header = json.loads((folder / "memory.json").read_text())
    del header["sha256"]
    header |= change
    (folder / "memory.json").write_text(json.dumps({**header, "sha256": _header_checksum(header)}))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"version": 2}, "version 2, this program reads version 1"),
        ({"kind": "encoder"}, "does not describe a memory"),
        ({"vehicle": {**CAR._asdict(), "width": 1.5}}, "was made for vehicle"),
        ({"grid": 32}, "grids of 32 cells"),
        ({"files": {}}, "no whole memory"),
        ({"files": None}, "damaged"),
        ({"files": {"../secret": ""}}, "damaged"),
    ],
)
def test_a_memory_of_another_version_robot_or_grid_is_refused(
    tmp_path: Path, change: dict[str, object], reason: str
) -> None:
    save_memory(tmp_path / "m", a_memory())
    edited(tmp_path / "m", change)
    with pytest.raises(StorageError, match=reason) as error:
        load_memory(tmp_path / "m")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", VEHICLES)
def test_a_memory_is_only_loaded_for_its_vehicle(tmp_path: Path, name: str) -> None:
    memory = a_memory(vehicle=VEHICLES[name])
    save_memory(tmp_path / "m", memory)
    assert all(map(same_plan, memory.plans, load_memory(tmp_path / "m", VEHICLES[name]).plans))
    for other in VEHICLES:
        if other != name:
            told = f"made for vehicle {name}, wanted was {other}; ask for --vehicle {name}, or make one"
            with pytest.raises(StorageError, match=told):
                load_memory(tmp_path / "m", VEHICLES[other])


def test_an_encoder_is_only_loaded_for_its_vehicle(tmp_path: Path) -> None:
    trained = TrainedEncoder(
        TrainingSettings(architecture=ARCHITECTURE), WEIGHTS, None, None, (), np.array([], np.int32)
    )
    save_encoder(tmp_path / "model", trained, CAR_1_TRAILER)
    assert load_encoder(tmp_path / "model", CAR_1_TRAILER).settings == trained.settings
    with pytest.raises(StorageError, match="made for vehicle car-1-trailer, wanted was car;"):
        load_encoder(tmp_path / "model")


def test_a_vehicle_that_is_no_longer_known_is_told_by_its_settings(tmp_path: Path) -> None:
    save_memory(tmp_path / "m", a_memory(vehicle=CAR._replace(width=1.5)))
    with pytest.raises(StorageError, match=r'"width": 1.5.*wanted was car; this program knows no such'):
        load_memory(tmp_path / "m")


def test_a_folder_without_a_memory_is_said_so(tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "gone"):
        with pytest.raises(StorageError, match="holds no memory"):
            load_memory(folder)


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

    def full(*_: object, **__: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
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
        if source.name.startswith(".m."):
            raise OSError(errno.EIO, "Input/output error")
        return rename(source, target)

    monkeypatch.setattr(Path, "replace", stumble)
    with pytest.raises(StorageError, match="Input/output error"):
        save_memory(tmp_path / "m", a_memory(5))
    assert contents(tmp_path / "m") == before
    assert [file.name for file in tmp_path.iterdir()] == ["m"]


def test_a_memory_can_be_copied_elsewhere(tmp_path: Path) -> None:
    save_memory(tmp_path / "m", a_memory())
    shutil.copytree(tmp_path / "m", tmp_path / "copy")
    assert len(load_memory(tmp_path / "copy").plans) == 3
