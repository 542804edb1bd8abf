"""What is not an archive as it was written is refused, in one line."""

from __future__ import annotations

import io
import json
import shutil
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from planners.memory.ranking.inverted_lists import list_readout
from storage.archives.arrays import HEADER_BYTES, array_of, write_array
from storage.archives.memories import load_memory, save_memory
from storage.errors import StorageError
from tests.storage.archives.signing import sign
from tests.storage.samples import a_memory

FILES = (
    "memory.json",
    "encoder.safetensors",
    "readout.safetensors",
    "states.npy",
    "controls.npy",
    "plan_starts.npy",
    "dt.npy",
    "masks.npy",
    "boxes.npy",
    "lists.safetensors",
)
many = settings(
    deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("archives") / "whole"
    memory = a_memory(2)
    save_memory(folder, replace(memory, lists=list_readout(memory.vectors, memory.biases)))
    assert {file.name for file in folder.iterdir()} == set(FILES)
    return folder


@pytest.fixture
def archive(whole: Path, tmp_path: Path) -> Path:
    shutil.copytree(whole, tmp_path / "m")
    return tmp_path / "m"


def refusal(folder: Path) -> str:
    with pytest.raises(StorageError) as error:
        load_memory(folder)
    text = str(error.value)
    assert str(folder) in text
    assert "\n" not in text
    return text


@pytest.mark.parametrize("name", FILES)
@given(where=st.floats(0.0, 1.0, exclude_max=True), flip=st.integers(1, 255))
@many
def test_one_other_byte_anywhere_is_refused(whole: Path, name: str, where: float, flip: int) -> None:
    file = whole / name
    good = file.read_bytes()
    position = int(where * len(good))
    try:
        file.write_bytes(good[:position] + bytes([good[position] ^ flip]) + good[position + 1 :])
        assert name in refusal(whole) or name == "memory.json"
    finally:
        file.write_bytes(good)


@pytest.mark.parametrize("name", FILES)
@given(share=st.floats(0.0, 1.0, exclude_max=True))
@many
def test_a_file_cut_off_anywhere_is_refused(whole: Path, name: str, share: float) -> None:
    file = whole / name
    good = file.read_bytes()
    try:
        file.write_bytes(good[: int(share * len(good))])
        assert name in refusal(whole)
    finally:
        file.write_bytes(good)


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_is_missing_renamed_longer_or_not_plain_is_refused(archive: Path, name: str) -> None:
    file = archive / name
    elsewhere = archive.parent / name
    file.rename(elsewhere)
    assert name in refusal(archive)
    shutil.copy(elsewhere, archive / f"x{name}")
    assert name in refusal(archive)
    (archive / f"x{name}").unlink()
    file.symlink_to(elsewhere)
    assert name in refusal(archive)
    file.unlink()
    file.mkdir()
    assert name in refusal(archive)
    file.rmdir()
    file.write_bytes(elsewhere.read_bytes() + b"\n")
    assert name in refusal(archive)


def test_the_onnx_file_that_earlier_versions_wrote_is_left_unread(archive: Path) -> None:
    (archive / "encoder.onnx").write_bytes(b"x")
    assert "encoder.onnx" in refusal(archive)
    sign(archive)
    save_memory(archive, load_memory(archive))
    assert not (archive / "encoder.onnx").exists()


def test_any_two_files_swapped_are_refused(archive: Path) -> None:
    def swap(one: str, other: str) -> None:
        (archive / one).rename(archive.parent / "aside")
        (archive / other).rename(archive / one)
        (archive.parent / "aside").rename(archive / other)

    for one, other in combinations(FILES, 2):
        swap(one, other)
        refusal(archive)
        swap(one, other)
    load_memory(archive)


def test_a_file_of_another_archive_is_refused(archive: Path, tmp_path: Path) -> None:
    save_memory(tmp_path / "other", a_memory(2, seed=5))
    for name in ("encoder.safetensors", "masks.npy", "states.npy", "readout.safetensors"):
        if (archive / name).read_bytes() != (tmp_path / "other" / name).read_bytes():
            good = (archive / name).read_bytes()
            shutil.copy(tmp_path / "other" / name, archive / name)
            assert "damaged" in refusal(archive)
            (archive / name).write_bytes(good)


@pytest.mark.parametrize("name", ["extra.npy", "__init__.py", ".hidden", "index.usearch"])
@pytest.mark.parametrize("signed", [False, True])
def test_a_file_too_many_is_refused(archive: Path, name: str, signed: bool) -> None:
    (archive / name).write_bytes(b"anything")
    if signed:
        sign(archive)
    refusal(archive)


@pytest.mark.parametrize("name", ["../secret.npy", "/etc/passwd", "..", "a/b.npy", "dt.npy\0", "", "ÿ.npy"])
def test_a_name_that_reaches_out_of_the_folder_is_never_opened(archive: Path, name: str) -> None:
    header = json.loads((archive / "memory.json").read_text())
    sign(archive, files={**header["files"], name: header["files"]["dt.npy"]})
    assert "memory.json is damaged" in refusal(archive)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"version": 1}, "version 1, this program reads version 2; build it again"),
        ({"version": 3}, "version 3, this program reads version 2; update the program or build it again"),
        ({"version": None}, "version None"),
        ({"version": "9" * 1000}, "this program reads version 2"),
        ({"kind": "encoder"}, "does not describe a memory"),
        ({"grid": 32}, "grids of 32 cells"),
        ({"files": {}}, "the memory again"),
        ({"files": None}, "damaged"),
        ({"files": {"dt.npy": "x"}}, "damaged"),
        ({"files": {"dt.npy": {"bytes": -1, "sha256": ""}}}, "damaged"),
        ({"files": {"dt.npy": {"bytes": 2**80, "sha256": ""}}}, "damaged"),
        ({"architecture": {"channels": [2], "hidden": [8], "dimensions": 4}}, "architecture"),
        (
            {"architecture": {"channels": [2], "hidden": [8], "dimensions": 4, "network": "dense"}},
            "Unknown network 'dense'; choose one of patches, pooled",
        ),
        ({"class": 7}, "class must be printable text"),
        ({"objective": ["labels"]}, "objective is ['labels']"),
        ({"metadata": 3}, "not a complete memory"),
    ],
)
def test_a_header_that_says_what_cannot_be_is_refused(
    archive: Path, change: dict[str, object], reason: str
) -> None:
    sign(archive, **change)
    assert reason in refusal(archive)


@pytest.mark.parametrize("text", ["", "[]", "{", "null", "NaN", '{"kind": "memory", "version": 2, "x": NaN}'])
def test_a_header_that_is_none_is_refused(archive: Path, text: str) -> None:
    (archive / "memory.json").write_text(text)
    refusal(archive)
    (archive / "memory.json").write_text("[" * 100_000)
    refusal(archive)
    (archive / "memory.json").write_bytes(b" " * (1 << 24) + b"{}")
    assert "too long" in refusal(archive)


def saved(array: object, **options: object) -> bytes:
    file = io.BytesIO()
    np.save(file, array, **options)  # type: ignore[arg-type]
    return file.getvalue()


def claiming(shape: tuple[int, ...], descr: str = "<f8", fortran: bool = False) -> bytes:
    text = f"{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00v\x00" + text.encode() + bytes(80)


LIES = {
    "objects": saved(np.array([{"a": 1}], dtype=object), allow_pickle=True),
    "float32": saved(np.zeros((3, 5), np.float32)),
    "columns": saved(np.zeros((3, 4))),
    "fortran": saved(np.asfortranarray(np.zeros((3, 5)))),
    "scalar": saved(np.float64(1.0)),
    "huge": claiming((2**62, 5)),
    "negative": claiming((-1, 5)),
    "structure": claiming((2,), "[('a', '<f8')]"),
    "code": claiming((), "'+__import__('os').system('true')+'"),
    "zip": b"PK\x03\x04" + bytes(200),
    "short": b"\x93NUMPY",
}


@pytest.mark.parametrize("name", [name for name in FILES if name.endswith(".npy")])
@pytest.mark.parametrize("lie", LIES)
def test_an_array_that_lies_about_itself_is_refused(archive: Path, name: str, lie: str) -> None:
    (archive / name).write_bytes(LIES[lie])
    sign(archive)
    assert "not a complete memory" in refusal(archive)


@pytest.mark.parametrize("name", ["encoder.safetensors", "readout.safetensors"])
@pytest.mark.parametrize("length", [0, 2, 2**40, 2**63, 2**64 - 1])
def test_tensors_that_claim_to_be_huge_are_refused(archive: Path, name: str, length: int) -> None:
    shape = b'{"biases":{"dtype":"F32","shape":[1099511627776],"data_offsets":[0,4398046511104]}}'
    (archive / name).write_bytes(length.to_bytes(8, "little") + shape)
    sign(archive)
    assert "not a complete memory" in refusal(archive)
    (archive / name).write_bytes(len(shape).to_bytes(8, "little") + shape + bytes(64))
    sign(archive)
    assert "not a complete memory" in refusal(archive)


@pytest.mark.parametrize("name", FILES[1:])
@given(where=st.floats(0.0, 1.0, exclude_max=True), value=st.integers(0, 255))
@many
def test_whatever_a_signed_archive_holds_it_loads_or_is_refused_in_one_line(
    whole: Path, name: str, where: float, value: int
) -> None:
    file, header = whole / name, whole / "memory.json"
    good, signed = file.read_bytes(), header.read_bytes()
    position = int(where * len(good))
    try:
        file.write_bytes(good[:position] + bytes([value]) + good[position + 1 :])
        sign(whole)
        try:
            load_memory(whole)
        except StorageError as error:
            assert "\n" not in str(error)  # noqa: PT017
    finally:
        file.write_bytes(good)
        header.write_bytes(signed)


@given(rows=st.integers(0, 30), columns=st.lists(st.integers(1, 6), max_size=2), seed=st.integers(0, 99))
@pytest.mark.parametrize("dtype", ["<f8", "<i8", "<u8", "<f4"])
def test_numpy_reads_our_arrays_and_we_read_what_numpy_writes(
    dtype: str, rows: int, columns: list[int], seed: int
) -> None:
    array = np.random.default_rng(seed).integers(0, 200, (rows, *columns)).astype(dtype)
    file = io.BytesIO()
    write_array(file, array)
    assert file.getvalue() == saved(array)
    assert np.array_equal(np.load(io.BytesIO(file.getvalue()), allow_pickle=False), array)
    again = array_of(file.getvalue(), dtype, tuple(columns))
    assert again.dtype == array.dtype
    assert np.array_equal(again, array)
    assert len(file.getvalue()) == HEADER_BYTES + array.nbytes
