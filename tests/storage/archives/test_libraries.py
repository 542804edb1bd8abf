"""Libraries of plans: they come back exactly, and what is not driven by its controls is refused."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from planners.memory.library.plan_library import PlanLibrary, gathered_library
from planners.world.problem import Plan
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR, DIFFERENTIAL_DRIVE, state_size
from storage.archives.arrays import write_array
from storage.archives.libraries import (
    how_gathered,
    load_library,
    load_memory_or_library,
    save_library,
    vehicle_of,
)
from storage.errors import StorageError
from tests.storage.archives.signing import sign
from tests.storage.samples import a_memory, same_plan


def a_library(count: int) -> PlanLibrary:
    rng = np.random.default_rng(count)
    answered = []
    for number in range(count):
        controls = rng.uniform(-0.3, 0.3, (20 + number, 2))
        start = rng.uniform(-1.0, 1.0, state_size(CAR))
        answered.append((f"q-{number}", Plan(simulate(start, controls, CAR), controls, CAR.dt)))
    return gathered_library("general", CAR, answered)


def test_a_library_comes_back_exactly_and_gives_the_same_bytes(tmp_path: Path) -> None:
    library = a_library(4)
    save_library(tmp_path / "one", library)
    loaded = load_library(tmp_path / "one")
    assert (loaded.class_name, loaded.questions, loaded.scales, loaded.vehicle) == (
        *(library.class_name, library.questions, library.scales, library.vehicle),
    )
    assert all(map(same_plan, library.plans, loaded.plans))
    save_library(tmp_path / "two", loaded)
    for file in (tmp_path / "one").iterdir():
        assert file.read_bytes() == (tmp_path / "two" / file.name).read_bytes()


def test_a_library_tells_how_it_was_gathered(tmp_path: Path) -> None:
    for name, gathered in (("own", {"seconds": 0.1 + 0.2}), ("other", None)):
        save_library(tmp_path / name, a_library(2), gathered)
        assert how_gathered(tmp_path / name) == gathered
        assert len(load_library(tmp_path / name)) == 2
    assert how_gathered(tmp_path / "nowhere") is None


@pytest.mark.parametrize("read", [load_memory_or_library, vehicle_of])
def test_a_folder_with_neither_memory_nor_library_is_told_from_one_that_is_missing(
    tmp_path: Path, read: Callable[[Path], object]
) -> None:
    with pytest.raises(StorageError, match=r"no memory\.json and no library\.json"):
        read(tmp_path)
    with pytest.raises(StorageError, match="gone does not exist"):
        read(tmp_path / "gone")


def test_the_plans_of_a_memory_are_a_library_too() -> None:
    memory = a_memory(3)
    library = memory.library
    assert len(library) == 3
    assert all(map(same_plan, library.plans, memory.plans))


def swerving(controls: np.ndarray) -> None:
    controls[7, 1] += 0.1


def elsewhere(states: np.ndarray) -> None:
    states[3, 0] += 1e-3


def never(states: np.ndarray) -> None:
    states[3, 0] = np.nan


@pytest.mark.parametrize(
    ("name", "change"), [("controls.npy", swerving), ("states.npy", elsewhere), ("states.npy", never)]
)
def test_states_that_the_controls_do_not_lead_through_are_refused(
    tmp_path: Path, name: str, change: Callable[[np.ndarray], None]
) -> None:
    save_library(tmp_path / "library", a_library(3))
    array = np.load(tmp_path / "library" / name)
    change(array)
    with (tmp_path / "library" / name).open("wb") as file:
        write_array(file, array)
    with pytest.raises(StorageError, match="damaged"):
        load_library(tmp_path / "library")
    sign(tmp_path / "library", "library")
    with pytest.raises(StorageError, match="gather it again"):
        load_library(tmp_path / "library")


@pytest.mark.parametrize("questions", [None, ["one"], [1, 2, 3], "q-0q-1q-2"])
def test_a_library_without_one_question_a_plan_is_refused(tmp_path: Path, questions: object) -> None:
    save_library(tmp_path / "library", a_library(3))
    sign(tmp_path / "library", "library", questions=questions)
    with pytest.raises(StorageError, match="gather it again"):
        load_library(tmp_path / "library")


def test_another_vehicle_and_a_missing_file_are_refused(tmp_path: Path) -> None:
    save_library(tmp_path / "library", a_library(3))
    with pytest.raises(StorageError, match="was made for vehicle car"):
        load_library(tmp_path / "library", DIFFERENTIAL_DRIVE)
    shutil.copytree(tmp_path / "library", tmp_path / "less")
    (tmp_path / "less" / "dt.npy").unlink()
    with pytest.raises(StorageError):
        load_library(tmp_path / "less")


def test_a_library_without_plans_is_none() -> None:
    with pytest.raises(ValueError, match="at least one plan"):
        gathered_library("general", CAR, [])
