"""Schema and profile of Parquet tables, as MLflow shows them beside a data set."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from storage.tables.shards import columns_of, row_count

_TYPES: Final = {  # of columns, in MLflow's words; all others are shown as texts
    "bool": "boolean", "int8": "integer", "int16": "integer", "int32": "integer", "int64": "long",
    "float": "float", "double": "double", "binary": "binary",
}  # fmt: skip


class TableShape(NamedTuple):
    """What MLflow shows about a data set."""

    schema: str  # the columns with their types
    profile: str  # how large it is


def table_shape(shards: Sequence[Path]) -> TableShape:
    """The shape of a table in one or more Parquet files with the same columns.

    Raises StorageError if a file is missing or damaged.
    """
    columns: list[dict[str, Any]] = []
    for name, kind in columns_of(shards[0]).items():
        columns.append({"type": _TYPES.get(kind, "string"), "name": name, "required": False})
    profile = {"num_rows": sum(map(row_count, shards)), "num_columns": len(columns), "num_files": len(shards)}
    return TableShape(json.dumps({"mlflow_colspec": columns}), json.dumps(profile))
