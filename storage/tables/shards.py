"""How every Parquet file is written and read: atomically, compressed, stamped, with reproducible bytes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from storage.errors import DamagedError, StorageError
from storage.places.files import whole_file
from storage.places.mirror import fetch, note_of
from storage.tables.earlier_versions import EARLIER, RENAMED

ROW_GROUP_ROWS: Final = 4096  # 2,000 to 8,000 measured best for 64 x 64 grids
SCHEMA_KEY: Final = b"schema"
SHARD_KEY: Final = b"key"


def write_table(path: Path, table: pa.Table, key: str = "") -> None:
    """Write a ``table`` to ``path`` atomically; the same table and key give the same bytes.

    Args:
        path: the file to write.
        table: of one of the schemas of ``schemas.py``.
        key: what the rows were made from, so that a finished shard need not be made again.

    Raises:
        StorageError: it cannot be written; ``path`` is then unchanged.
    """
    write_tables(path, [table], table.schema, key)


def write_tables(path: Path, tables: Iterable[pa.Table], schema: pa.Schema, key: str = "") -> None:
    """Write ``tables`` of one ``schema`` into one file, with one of them in memory at a time.

    Args:
        path: the file to write.
        tables: tables of the schema, written one after the other.
        schema: one of ``schemas.py``.
        key: as in ``write_table``.

    Raises:
        StorageError: as for ``write_table``.
    """
    described = schema.with_metadata({**(schema.metadata or {}), SHARD_KEY: key.encode()})
    with (
        whole_file(path, key) as temporary,
        pq.ParquetWriter(temporary, described, compression="zstd", write_page_checksum=True) as file,
    ):
        for table in tables:
            file.write_table(table.replace_schema_metadata(described.metadata), ROW_GROUP_ROWS)


def read_table(path: Path, schema: pa.Schema, columns: Sequence[str] | None = None) -> pa.Table:
    """The rows of the file at ``path``, which was written with a ``schema`` of ``schemas.py``.

    Args:
        path: the file to read.
        schema: the schema that it was written with.
        columns: those to read; None for all. An optional one that the file lacks, since an earlier version
            wrote it, holds nulls.

    Raises:
        StorageError: the file is missing, damaged, of another kind or version, or has a column of another
            type.
    """
    wanted, written = schema.metadata[SCHEMA_KEY].decode(), _schema_in(path)
    name = (written.metadata or {}).get(SCHEMA_KEY, b"").decode(errors="replace") or "an unknown one"
    if name not in (wanted, EARLIER.get(wanted)):
        raise StorageError(
            f"{path} holds table {name}, expected {wanted}; is it the right file, written by this version?"
        )
    lacking = [name for name in _optional_names(schema) if name not in written.names]
    with sound(path):
        table = pq.read_table(
            fetch(path),
            columns=None if columns is None else [each for each in columns if each not in lacking],
            partitioning=None,
            page_checksum_verification=True,
        )
        for field in table.schema:
            if field.name in schema.names and field.type != schema.field(field.name).type:
                raise ValueError(
                    f"column {field.name} holds {field.type}, expected {schema.field(field.name).type}"
                )
        table = table if name == wanted else _renamed(table)
        return _with_nulls(table, schema, lacking, columns) if lacking else table


def _optional_names(schema: pa.Schema) -> list[str]:
    return [field.name for field in schema if (field.metadata or {}).get(b"optional")]


def _with_nulls(
    table: pa.Table, schema: pa.Schema, lacking: Sequence[str], columns: Sequence[str] | None
) -> pa.Table:
    """A ``table`` with nulls in the columns that it is ``lacking``, in the order of a file that has them."""
    for name in lacking:
        table = table.append_column(schema.field(name), pa.nulls(len(table), schema.field(name).type))
    in_order = [*schema.names, *table.column_names] if columns is None else columns
    return table.select([name for name in dict.fromkeys(in_order) if name in table.column_names])


def _renamed(table: pa.Table) -> pa.Table:
    """A ``table`` of the earlier version with today's names."""
    for column, names in RENAMED.items():
        if column in table.column_names:
            values = table[column]
            for old, new in names.items():
                values = pc.if_else(pc.equal(values, old), new, values)
            table = table.set_column(table.column_names.index(column), column, values)
    return table


@contextmanager
def sound(path: Path) -> Iterator[None]:
    """Raise DamagedError instead of any error that unsound rows in the file at ``path`` raise."""
    try:
        yield
    except (pa.ArrowException, OSError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise DamagedError(
            f"{path} is not a complete Parquet file of its kind ({_first_line(error)})",
            "delete it and run its stage again.",
        ) from None


def row_count(path: Path) -> int:
    """The number of rows in the Parquet file at ``path``. Raises StorageError if it is missing or damaged."""
    with sound(path):
        try:
            return int(pq.read_metadata(fetch(path)).num_rows)
        except FileNotFoundError:
            raise StorageError(f"{path} does not exist; run the stage that writes it.") from None


def columns_of(path: Path) -> dict[str, str]:
    """The columns of the Parquet file at ``path`` with their Arrow types.

    Raises StorageError if it is missing or damaged.
    """
    return {field.name: str(field.type) for field in _schema_in(path)}


def metadata_of(path: Path) -> dict[bytes, bytes]:
    """The metadata of the Parquet file at ``path``. Raises StorageError if it is missing or damaged."""
    return dict(_schema_in(path).metadata or {})


def _schema_in(path: Path) -> pa.Schema:
    with sound(path):
        try:
            return pq.read_schema(fetch(path))
        except FileNotFoundError:
            raise StorageError(f"{path} does not exist; run the stage that writes it.") from None


def shard_is_done(path: Path, key: str) -> bool:
    """Whether a readable shard at ``path`` was made from the same ``key``; it is not fetched to find out."""
    noted = note_of(path)
    if noted is not None:
        return noted == key
    try:
        return metadata_of(path).get(SHARD_KEY) == key.encode()
    except StorageError:
        return False


def table_of(rows: Sequence[dict[str, Any]], schema: pa.Schema, what: str) -> pa.Table:
    """``rows`` as a table of a ``schema``; fields that the schema marks as optional may be missing.

    Args:
        rows: values by column.
        schema: one of ``schemas.py``.
        what: what a row is, for messages.

    Raises:
        StorageError: a row's fields or types do not fit.
    """
    names = set(schema.names)
    required = names - set(_optional_names(schema))
    for number, row in enumerate(rows):
        wrong = sorted(set(row) - names) + sorted(required - set(row))
        if wrong:
            raise StorageError(
                f"{what} {number} has unknown or missing fields: {', '.join(wrong)}; "
                f"expected {', '.join(schema.names)}."
            )
    try:
        return pa.Table.from_pylist(list(rows), schema=schema)
    except (pa.ArrowException, TypeError, ValueError, OverflowError) as error:
        raise StorageError(f"{what} rows have a value of the wrong type: {_first_line(error)}.") from None


def _first_line(error: Exception) -> str:
    return str(error).partition("\n")[0].rstrip(".")
