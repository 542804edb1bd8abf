"""NumPy files whose headers are malformed: that file is skipped in one line, the others are imported."""

from __future__ import annotations

import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from storage.errors import StorageError
from storage.worlds.importing import ImportSettings, import_part
from storage.worlds.sources import source_at
from tests.storage.samples import quick

GOOD = "{'descr': '|b1', 'fortran_order': False, 'shape': (1, 201, 201), }"
MALFORMED = (
    "", "(", "{", "'''", "{'descr': ", GOOD[:-4], "[" * 2_000, "{'a': 1}", "0x", "\\",
    GOOD.replace("'|b1'", "()"), GOOD.replace("'|b1'", "None"), GOOD.replace("'|b1'", "'<M8[x]'"),
    GOOD.replace("'|b1'", "'|O'"), GOOD.replace("201", "-201"), GOOD.replace("201", "1" + 30 * "0"),
    GOOD.replace("201", "9999999999"), GOOD.replace("'|b1'", "[('a', '<f8', (4611686018427387904,))]"),
)  # fmt: skip


def with_header(text: str, version: int = 1) -> bytes:
    """A file of a world without obstacles, with another header."""
    header = text.encode("latin-1") + b"\n"
    size = len(header).to_bytes(2 if version == 1 else 4, "little")
    return b"\x93NUMPY" + bytes([version, 0]) + size + header + bytes(201 * 201)


def test_the_header_that_is_not_malformed_is_read(tmp_path: Path) -> None:
    (tmp_path / "a.npy").write_bytes(with_header(GOOD))
    assert not np.load(tmp_path / "a.npy").any()
    assert len(import_part(source_at(tmp_path / "a.npy"), "train").problems) == 1


@pytest.mark.parametrize("version", [1, 2, 3, 9])
def test_a_file_with_a_malformed_header_is_skipped_and_the_others_are_not(
    tmp_path: Path, version: int
) -> None:
    folder = tmp_path / "worlds"
    folder.mkdir()
    for number, text in enumerate(MALFORMED):
        (folder / f"{number}.npy").write_bytes(with_header(text, version))
        (folder / f"good-{number}.npy").write_bytes(with_header(GOOD))
    found = import_part(source_at(folder), "train", ImportSettings())
    other = import_part(source_at(folder), "test", ImportSettings())
    assert len(found.problems) + len(other.problems) == len(MALFORMED)
    reasons = [reason for _, reason in found.skipped + other.skipped]
    assert len(reasons) == len(MALFORMED)
    assert all(reason and "\n" not in reason for reason in reasons)


@pytest.mark.parametrize(
    "beginning", [b"\x01\x00\xff\xff", b"\x02\x00" + b"\xff" * 4, b"\x03\x00\x00\x00\x00\x08"]
)
def test_a_header_that_claims_to_be_long_is_refused_unread(tmp_path: Path, beginning: bytes) -> None:
    path = tmp_path / "bomb.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("a.npy", "w") as member:
        member.write(b"\x93NUMPY" + beginning)
        for _ in range(40):
            member.write(bytes(1_000_000))
    tracemalloc.start()
    try:
        with pytest.raises(StorageError, match="header") as error:
            source_at(path)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert "\n" not in str(error.value)
    assert peak < 2_000_000


@pytest.mark.filterwarnings("ignore:Reading `.npy`")
@quick
@given(
    where=st.integers(0, len(GOOD)),
    cut=st.integers(0, 12),
    put=st.text("{}[]()'\",:\\ \n#01eLx<|-=\xff", max_size=3),
    version=st.integers(1, 3),
)
def test_any_header_is_read_or_refused_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, where: int, cut: int, put: str, version: int
) -> None:
    path = tmp_path_factory.getbasetemp() / "a.npy"
    path.write_bytes(with_header(GOOD[:where] + put + GOOD[where + cut :], version))
    try:
        import_part(source_at(path), "train")
    except StorageError as error:
        assert "\n" not in str(error)  # noqa: PT017
