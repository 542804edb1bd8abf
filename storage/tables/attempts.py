"""Attempts: one row for every time a planner was asked."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from storage.errors import StorageError
from storage.places.mirror import files_in
from storage.tables.schemas import ATTEMPTS
from storage.tables.shards import columns_of, read_table, table_of, write_table, write_tables

if TYPE_CHECKING:  # pandas takes a fifth of a second to import, and who only writes rows needs none
    import pandas as pd


def write_attempts(path: Path, rows: Sequence[dict[str, Any]], key: str = "") -> None:
    """Write attempt rows (``schemas.ATTEMPTS``); a StorageError where a row has other fields or types."""
    write_table(path, table_of(rows, ATTEMPTS, "attempt"), key)


def join_attempts(path: Path, shards: Sequence[Path]) -> None:
    """Write the rows of many files as one, a file at a time."""
    write_tables(path, (read_table(shard, ATTEMPTS) for shard in shards), ATTEMPTS)


def attempt_columns(path: Path, names: Sequence[str]) -> dict[str, list[Any]]:
    """Some columns of a file of attempts, as Python values."""
    columns: dict[str, list[Any]] = read_table(path, ATTEMPTS, names).to_pydict()
    return columns


def read_attempts(place: Path, without: Sequence[str] = ()) -> pd.DataFrame:
    """All attempts of a file, or of every file below a folder in the order of their names.

    Missing texts are None, missing numbers NaN; ``recalled`` holds one int32 array a row, which takes most of
    the time: columns ``without`` which one can do are left out.
    """
    frame: pd.DataFrame = pa.concat_tables(list(_tables(place, without))).to_pandas()
    pa.default_memory_pool().release_unused()  # what the files were decoded in: as much again
    return frame


def distinct_values(place: Path, name: str) -> list[str]:
    """The texts in a column of all attempts below a folder."""
    columns = (read_table(path, ATTEMPTS, [name])[name] for path in tables_below(place, "benchmark"))
    return sorted({str(each) for column in columns for each in column.unique().drop_null().to_pylist()})


def attempt_frames(place: Path, without: Sequence[str] = ()) -> Iterator[pd.DataFrame]:
    """The same a file at a time, for who cannot hold them all."""
    return (table.to_pandas() for table in _tables(place, without))


def _tables(place: Path, without: Sequence[str]) -> Iterator[pa.Table]:
    for path in tables_below(place, "benchmark"):
        yield read_table(path, ATTEMPTS, [name for name in columns_of(path) if name not in without])


def tables_below(place: Path, stage: str) -> list[Path]:
    """The file, or all Parquet files below a folder by name; a StorageError that names the stage if none."""
    if place.suffix == ".parquet" or place.is_file():
        return [place]
    paths = files_in(place, "[!.]*.parquet", below=True)
    if not paths:
        raise StorageError(f"{place} holds no rows; run {stage}.")
    return paths


def readable_attempts(place: Path, names: Sequence[str]) -> tuple[pd.DataFrame, list[str]]:
    """Some columns of all attempts below a folder that can be read, and a line for each file that cannot.

    Texts are categories: a run of half a million rows takes tens of megabytes. A column that a file lacks is
    missing values. StorageError: there is no file, or none can be read.
    """
    tables, faults = [], []
    for path in tables_below(place, "benchmark"):
        try:
            tables.append(read_table(path, ATTEMPTS, [name for name in names if name in columns_of(path)]))
        except StorageError as error:
            faults.append(str(error))
    if not tables:
        raise StorageError(f"none of the files in {place} can be read; the first: {faults[0]}")
    rows = pa.concat_tables(tables, promote_options="default")
    for number, field in enumerate(rows.schema):
        if pa.types.is_string(field.type):
            column = rows.column(number).combine_chunks().dictionary_encode()
            rows = rows.set_column(number, field.name, column)
    frame: pd.DataFrame = rows.to_pandas()
    return frame.reindex(columns=list(names)), faults
