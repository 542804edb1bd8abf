from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from storage.errors import StorageError
from storage.tables.shards import (
    ROW_GROUP_ROWS,
    metadata_of,
    read_table,
    shard_is_done,
    table_of,
    write_table,
)
from tests.storage.samples import quick

SCHEMA = pa.schema([("n", pa.int64()), ("word", pa.string())], metadata={"schema": "numbers/1"})


def table(count: int) -> pa.Table:
    return pa.table({"n": range(count), "word": [f"w{i % 7}" for i in range(count)]}, schema=SCHEMA)


@quick
@given(numbers=st.lists(st.integers(-(2**63), 2**63 - 1), max_size=50), key=st.text(max_size=20))
def test_rows_come_back_as_they_were(
    tmp_path_factory: pytest.TempPathFactory, numbers: list[int], key: str
) -> None:
    path = tmp_path_factory.getbasetemp() / "round" / "numbers.parquet"
    rows = pa.table({"n": numbers, "word": [str(n) for n in numbers]}, schema=SCHEMA)
    write_table(path, rows, key)
    assert read_table(path, SCHEMA).equals(rows)
    assert read_table(path, SCHEMA, ["word"]).column_names == ["word"]
    assert shard_is_done(path, key)
    assert not shard_is_done(path, key + "x")


def test_the_same_rows_give_the_same_bytes(tmp_path: Path) -> None:
    one, two = tmp_path / "one.parquet", tmp_path / "two.parquet"
    rows = table(10_000)
    write_table(one, rows, "k")
    write_table(two, pa.concat_tables([rows.slice(0, 123), rows.slice(123)]), "k")
    assert one.read_bytes() == two.read_bytes()
    with pq.ParquetFile(one) as file:
        assert file.metadata.row_group(0).num_rows == ROW_GROUP_ROWS
        assert file.metadata.row_group(0).column(0).compression == "ZSTD"


def test_a_file_has_the_permissions_that_the_user_set(tmp_path: Path) -> None:
    write_table(tmp_path / "t.parquet", table(1))
    (tmp_path / "plain").touch()
    assert (tmp_path / "t.parquet").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_a_missing_file_is_said_so(tmp_path: Path) -> None:
    with pytest.raises(
        StorageError, match=r"^.*gone.parquet does not exist; run the stage that writes it\.$"
    ):
        read_table(tmp_path / "gone.parquet", SCHEMA)
    assert not shard_is_done(tmp_path / "gone.parquet", "")


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.99])
def test_a_truncated_file_is_said_so_and_not_done(tmp_path: Path, share: float) -> None:
    path = tmp_path / "t.parquet"
    write_table(path, table(5000), "k")
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(StorageError, match=r"t\.parquet is not a complete Parquet file") as error:
        read_table(path, SCHEMA)
    assert "\n" not in str(error.value)
    assert not shard_is_done(path, "k")


@pytest.mark.parametrize("share", [0.1, 0.4, 0.7])
def test_a_flipped_bit_among_the_rows_is_noticed(tmp_path: Path, share: float) -> None:
    path = tmp_path / "t.parquet"
    write_table(path, pa.table({"n": range(9000), "word": [f"w{i * i}" for i in range(9000)]}, schema=SCHEMA))
    data = bytearray(path.read_bytes())
    data[int(share * len(data))] ^= 4
    path.write_bytes(data)
    with pytest.raises(StorageError, match=r"t\.parquet is not a complete Parquet file") as error:
        read_table(path, SCHEMA)
    assert "\n" not in str(error.value)


def test_a_folder_or_a_table_of_another_kind_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "t.parquet"
    write_table(path, table(3))
    other = SCHEMA.with_metadata({"schema": "numbers/2"})
    with pytest.raises(StorageError, match=r"holds table numbers/1, expected numbers/2"):
        read_table(path, other)
    pq.write_table(pa.table({"n": [1]}), path)
    with pytest.raises(StorageError, match="holds table an unknown one"):
        read_table(path, SCHEMA)
    with pytest.raises(StorageError, match="not a complete Parquet file"):
        metadata_of(tmp_path)


def test_a_full_disk_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "t.parquet"
    write_table(path, table(3), "old")
    before = path.read_bytes()

    def full(writer: pq.ParquetWriter, rows: pa.Table, *_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(pq.ParquetWriter, "write_table", full)
    with pytest.raises(StorageError, match="cannot be written: No space left on device"):
        write_table(path, table(4), "new")
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


ENDLESS_WRITER = """
import sys
from pathlib import Path
from tests.storage.tables.test_shards import table
from storage.tables.shards import write_table
print("ready", flush=True)
while True:
    write_table(Path(sys.argv[1]), table(20_000), "k")
"""


def test_a_writer_killed_at_any_moment_leaves_a_whole_file_or_none(tmp_path: Path) -> None:
    path = tmp_path / "t.parquet"
    for pause in (0.0, 0.013, 0.037):
        command = [sys.executable, "-c", ENDLESS_WRITER, str(path)]
        writer = subprocess.Popen(command, stdout=subprocess.PIPE, cwd=Path(__file__).parents[3])
        assert writer.stdout is not None
        assert writer.stdout.readline() == b"ready\n"
        time.sleep(pause)
        os.kill(writer.pid, signal.SIGKILL)
        writer.wait()
        writer.stdout.close()
        if path.exists():
            assert read_table(path, SCHEMA).equals(table(20_000))


@pytest.mark.parametrize(
    "row", [{"n": 1}, {"n": 1, "word": "a", "more": 2}, {"n": "one", "word": "a"}, {"n": 2**70, "word": ""}]
)
def test_a_row_that_does_not_fit_the_table_is_refused(row: dict[str, object]) -> None:
    with pytest.raises(StorageError, match=r"^attempt") as error:
        table_of([{"n": 1, "word": "a"}, row], SCHEMA, "attempt")
    assert "\n" not in str(error.value)
