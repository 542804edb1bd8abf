"""Attempts: one row for each time a planner tried a problem."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import pyarrow as pa

from storage.errors import StorageError
from storage.places.mirror import files_in
from storage.tables.schemas import ATTEMPTS
from storage.tables.shards import read_table, table_of, write_table, write_tables

BATCH_ROWS: Final = 4096

if TYPE_CHECKING:  # pandas takes a fifth of a second to import, and writing rows does not need it
    import pandas as pd


def write_attempts(path: Path, rows: Sequence[dict[str, Any]], key: str = "") -> None:
    """Write ``rows`` of ``schemas.ATTEMPTS``, made from what ``key`` says.

    Raises StorageError if a row has other fields or types.
    """
    write_table(path, table_of(rows, ATTEMPTS, "attempt"), key)


def join_attempts(path: Path, shards: Sequence[Path], key: str = "") -> None:
    """Write the rows of many ``shards`` as one file, with one of them in memory at a time.

    ``key`` says what they were made from.
    """
    write_tables(path, (read_table(shard, ATTEMPTS) for shard in shards), ATTEMPTS, key)


def attempt_columns(path: Path, names: Sequence[str]) -> dict[str, list[Any]]:
    """The columns ``names`` of the file of attempts at ``path``, as Python values."""
    columns: dict[str, list[Any]] = read_table(path, ATTEMPTS, names).to_pydict()
    return columns


def attempt_batches(path: Path, names: Sequence[str]) -> Iterator[dict[str, list[Any]]]:
    """Like ``attempt_columns``, some thousand rows at a time as Python values."""
    for batch in read_table(path, ATTEMPTS, names).to_batches(BATCH_ROWS):
        yield batch.to_pydict()


def attempt_records(path: Path) -> list[dict[str, Any]]:
    """The rows of the file of attempts at ``path`` as ``write_attempts`` takes them."""
    rows: list[dict[str, Any]] = read_table(path, ATTEMPTS).to_pylist()
    return rows


def read_attempts(path: Path, without: Sequence[str] = ()) -> pd.DataFrame:
    """All attempts of a file, or of every file below a folder, in the order of their names.

    Args:
        path: the file or folder.
        without: columns to leave out; ``recalled``, which holds one int32 array a row, takes most of the
            time.

    Returns:
        the rows; missing texts are None, missing numbers NaN.

    Raises:
        StorageError: there are none.
    """
    frame: pd.DataFrame = pa.concat_tables(list(_tables(path, without))).to_pandas()
    pa.default_memory_pool().release_unused()  # the files were decoded there, which takes as much again
    return frame


def distinct_values(folder: Path, name: str) -> list[str]:
    """The distinct texts in the column ``name`` of all attempts below a ``folder``."""
    columns = (read_table(path, ATTEMPTS, [name])[name] for path in tables_below(folder, "benchmark"))
    return sorted({str(value) for column in columns for value in column.unique().drop_null().to_pylist()})


def attempt_frames(path: Path, without: Sequence[str] = ()) -> Iterator[pd.DataFrame]:
    """Like ``read_attempts``, one file at a time, for runs too large to hold in memory."""
    return (table.to_pandas() for table in _tables(path, without))


def _tables(path: Path, without: Sequence[str]) -> Iterator[pa.Table]:
    for file in tables_below(path, "benchmark"):
        yield read_table(file, ATTEMPTS, [name for name in ATTEMPTS.names if name not in without])


def tables_below(path: Path, stage: str) -> list[Path]:
    """The file at a ``path``, or all Parquet files below the folder there, by name.

    Raises StorageError if there are none; its message names the ``stage`` that makes them.
    """
    if path.suffix == ".parquet" or path.is_file():
        return [path]
    files = files_in(path, "[!.]*.parquet", below=True)
    if not files:
        raise StorageError(f"{path} holds no rows; run {stage}.")
    return files


def readable_attempts(folder: Path, names: Sequence[str]) -> tuple[pd.DataFrame, list[str]]:
    """The columns ``names`` of all attempts below a ``folder`` that can be read.

    Texts are categories, so a run of half a million rows takes tens of megabytes.

    Returns the rows, and a line for each file that cannot be read. Raises StorageError if no file can.
    """
    tables, faults = [], []
    for path in tables_below(folder, "benchmark"):
        try:
            tables.append(read_table(path, ATTEMPTS, names))
        except StorageError as error:
            faults.append(str(error))
    if not tables:
        raise StorageError(f"none of the files in {folder} can be read; the first fault: {faults[0]}")
    rows = pa.concat_tables(tables)
    for number, field in enumerate(rows.schema):
        if pa.types.is_string(field.type):
            column = rows.column(number).combine_chunks().dictionary_encode()
            rows = rows.set_column(number, field.name, column)
    frame: pd.DataFrame = rows.to_pandas()
    return frame, faults
