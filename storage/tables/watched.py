"""How useful memories are at work, compared with their benchmark: one small file per file of problems."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final
from uuid import uuid4

import pandas as pd
import pyarrow as pa

from storage.errors import StorageError
from storage.places.mirror import files_in
from storage.tables.schemas import WATCHED
from storage.tables.shards import read_table, table_of, write_table

NEWEST: Final = 300  # files that are read


def add_watched(folder: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Add what was seen just now to a ``folder``: ``rows`` of ``schemas.WATCHED`` without their time."""
    at = datetime.now(UTC)
    stamped = [{"at": at, **row} for row in rows]
    write_table(folder / f"{at:%Y%m%dT%H%M%S}-{uuid4().hex[:8]}.parquet", table_of(stamped, WATCHED, "seen"))


def read_watched(folder: Path) -> tuple[pd.DataFrame, list[str]]:
    """The rows in the newest files of a ``folder``, the oldest first, and a line for each unreadable file."""
    tables, faults = [WATCHED.empty_table()], []
    for path in files_in(folder, "[!.]*.parquet")[-NEWEST:]:
        try:
            tables.append(read_table(path, WATCHED))
        except StorageError as error:
            faults.append(str(error))
    rows: pd.DataFrame = pa.concat_tables(tables, promote_options="default").to_pandas()
    return rows.sort_values("at", kind="stable", ignore_index=True), faults
