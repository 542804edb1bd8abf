"""Memories whose checksums are right and whose contents are not: refused in one line when they are loaded."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from planners.memory.plans.sweeps import sweep_plans
from planners.world.vehicles.vehicle import CAR_2_TRAILERS, DIFFERENTIAL_DRIVE
from storage.archives.memories import load_memory, save_memory
from storage.errors import StorageError
from tests.storage.archives.lies import LOADERS, change_array, change_tensors, refusal
from tests.storage.archives.signing import sign
from tests.storage.samples import WEIGHTS, a_memory

many = settings(
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
    max_examples=30,
)


def moved(array: np.ndarray) -> None:
    array[0, 0] += 3.0


def nudged(array: np.ndarray) -> None:
    array[-1, -1] = np.nextafter(array[-1, -1], 9.0)


def emptied(array: np.ndarray) -> None:
    array[1] = 0


def lessened(array: np.ndarray) -> None:
    row = array[2].nonzero()[0][0]
    array[2, row] &= array[2, row] - np.uint64(1)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("boxes.npy", moved),
        ("boxes.npy", nudged),
        ("boxes.npy", emptied),
        ("masks.npy", emptied),
        ("masks.npy", lessened),
        ("states.npy", moved),
    ],
)
def test_sweeps_and_masks_that_are_not_those_of_the_plans_are_refused(
    archives: Path, name: str, change: Callable[[np.ndarray], object]
) -> None:
    change_array(archives / "memory", name, change)
    assert "do not match its plans" in refusal(archives / "memory")


def test_the_sweeps_of_another_memory_are_refused(archives: Path, tmp_path: Path) -> None:
    save_memory(tmp_path / "other", a_memory(3, seed=7))
    for names in (["boxes.npy"], ["masks.npy"], ["boxes.npy", "masks.npy"]):
        folder = archives / "memory"
        for name in names:
            shutil.copy(tmp_path / "other" / name, folder / name)
        sign(folder)
        assert "do not match its plans" in refusal(folder)


@pytest.mark.parametrize("name", sorted(WEIGHTS))
@pytest.mark.parametrize("value", [np.inf, -np.inf, 3e38, -1e37])
def test_weights_with_which_an_embedding_could_overflow_are_refused(
    archives: Path, name: str, value: float
) -> None:
    weights = np.full_like(WEIGHTS[name], value)
    change_tensors(archives / "memory", "encoder.safetensors", {name: weights})
    assert "weights" in refusal(archives / "memory")
    change_tensors(archives / "encoder", "tensors.safetensors", {f"weights.{name}": weights})
    assert "weights" in refusal(archives / "encoder")


@pytest.mark.parametrize("value", [np.inf, 3e38])
def test_a_readout_whose_scores_could_overflow_is_refused(archives: Path, value: float) -> None:
    vectors = np.full((4, 4), value, np.float32)
    change_tensors(archives / "memory", "readout.safetensors", {"vectors": vectors})
    assert "vectors" in refusal(archives / "memory")


@pytest.mark.parametrize("vehicle", [DIFFERENTIAL_DRIVE, CAR_2_TRAILERS])
def test_the_sweeps_of_every_vehicle_are_its_own(tmp_path: Path, vehicle: Any) -> None:
    memory = a_memory(3, vehicle=vehicle)
    save_memory(tmp_path / "good", memory)
    load_memory(tmp_path / "good", vehicle)
    other = vehicle._replace(dt=0.5 * vehicle.dt)  # other margins, as an older version may have taken
    save_memory(tmp_path / "older", replace(memory, sweeps=sweep_plans(memory.plans, other)))
    loaded = load_memory(tmp_path / "older", vehicle)
    assert np.array_equal(loaded.sweeps.boxes, memory.sweeps.boxes)
    assert np.array_equal(loaded.masks, memory.masks)


@pytest.mark.parametrize("name", ["states.npy", "controls.npy", "dt.npy"])
@pytest.mark.parametrize("value", [1e300, -1e9, np.nan, np.inf, 1e-320, 0.05])
def test_plans_of_senseless_numbers_are_refused(archives: Path, name: str, value: float) -> None:
    def change(array: np.ndarray) -> None:
        array.reshape(-1)[0] = value

    change_array(archives / "memory", name, change)
    if name == "controls.npy" and abs(value) < 1.0:
        load_memory(archives / "memory")
    else:
        refusal(archives / "memory")


@pytest.mark.parametrize(
    "change",
    [
        {"class": "../x"},
        {"class": ""},
        {"class": "a/b"},
        {"class": "line\nline"},
        {"objective": "x"},
        {"objective": ""},
        *[
            {"metadata": {"scales": scales}}
            for scales in (
                5,
                "1",
                None,
                [],
                [0],
                [-1.0],
                [1e-320],
                [1e9],
                ["1"],
                [True],
                [[1.0]],
                {},
                [1.0, 1.0],
            )
        ],
        {"metadata": []},
        {"metadata": [["scales", [1.0]]]},
    ],
)
def test_a_header_that_claims_what_cannot_be_is_refused(archives: Path, change: dict[str, Any]) -> None:
    sign(archives / "memory", **change)
    refusal(archives / "memory")


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=6,
)


@pytest.mark.parametrize(
    ("kind", "field"),
    [
        ("memory", "class"),
        ("memory", "objective"),
        ("memory", "metadata"),
        ("memory", "architecture"),
        ("memory", "vehicle"),
        ("encoder", "settings"),
        ("encoder", "grid"),
        ("hallucinator", "version"),
    ],
)
@given(value=VALUES)
@many
def test_whatever_a_header_claims_it_is_loaded_or_refused_in_one_line(
    whole: Path, kind: str, field: str, value: object
) -> None:
    header = whole / kind / f"{kind}.json"
    good = header.read_bytes()
    try:
        sign(whole / kind, kind, **{field: value})
        LOADERS[kind](whole / kind)
    except StorageError as error:
        assert "\n" not in str(error)  # noqa: PT017
    finally:
        header.write_bytes(good)


@pytest.mark.parametrize(("kind", "name"), [("encoder", "tensors"), ("hallucinator", "weights")])
@given(where=st.integers(0, 2_000), value=st.integers(0, 255))
@many
def test_whatever_a_signed_archive_holds_it_is_loaded_or_refused(
    whole: Path, kind: str, name: str, where: int, value: int
) -> None:
    file, header = whole / kind / f"{name}.safetensors", whole / kind / f"{kind}.json"
    good, signed = file.read_bytes(), header.read_bytes()
    try:
        file.write_bytes(good[:where] + bytes([value]) + good[where + 1 :])
        sign(whole / kind, kind)
        LOADERS[kind](whole / kind)
    except StorageError as error:
        assert "\n" not in str(error)  # noqa: PT017
    finally:
        file.write_bytes(good)
        header.write_bytes(signed)
