"""Whether two runs left the same rows, timings aside."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq

from storage.places.run_folder import RunFolder


def rows_of(path: Path) -> pd.DataFrame:
    """The rows of one Parquet file."""
    rows: pd.DataFrame = pq.read_table(path, partitioning=None).to_pandas()
    return rows


def assert_same_rows(one: RunFolder, other: RunFolder) -> list[Path]:
    """The Parquet files of both runs, which hold the same rows but for columns of seconds."""
    files = sorted(path.relative_to(one.path) for path in one.path.rglob("*.parquet"))
    assert files == sorted(path.relative_to(other.path) for path in other.path.rglob("*.parquet"))
    for file in files:
        ours, theirs = rows_of(one.path / file), rows_of(other.path / file)
        different = columns_that_differ(ours, theirs)
        assert not different, f"{file}: {different}"
    return files


def columns_that_differ(ours: pd.DataFrame, theirs: pd.DataFrame) -> list[str]:
    """Columns, but those of seconds, in which two tables are not the same."""
    if list(ours.columns) != list(theirs.columns) or len(ours) != len(theirs):
        return ["which there are, or how many rows"]
    return [
        name
        for name in ours.columns
        if not name.endswith("_seconds")
        and not all(_equal(a, b) for a, b in zip(ours[name], theirs[name], strict=True))
    ]


def equal_but_for_seconds(ours: pd.DataFrame, theirs: pd.DataFrame) -> bool:
    """Whether two tables hold the same rows, timings aside."""
    return not columns_that_differ(ours, theirs)


def _equal(one: object, other: object) -> bool:
    return bool(np.array_equal(np.asarray(one), np.asarray(other))) or (one != one and other != other)
