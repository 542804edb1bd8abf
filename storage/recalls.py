"""Recalls: what a memory says to a problem, beside which plans are really free."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from storage.columns import bits_of, lists_of
from storage.hallucinated import plans_of
from storage.results import tables_below
from storage.schemas import recalls
from storage.shards import read_table, table_of, write_table


def write_recalls(path: Path, rows: Sequence[dict[str, Any]], *, plans: int, key: str = "") -> None:
    """Write recall rows: ``problem_id, class, memory, protocol, order, free, nothing_recalled``.

    ``order``: the numbers of all plans, best first. ``free``: one truth value a plan.
    """
    packed = [{**row, "free": np.packbits(np.asarray(row["free"], bool)).tobytes()} for row in rows]
    write_table(path, table_of(packed, recalls(plans), "recall"), key)


def read_recalls(place: Path) -> pd.DataFrame:
    """All recall rows of a file or below a folder; ``order`` holds int16 arrays, ``free`` bool arrays."""
    return pd.concat([_read(path) for path in tables_below(place, "benchmark")], ignore_index=True)


def _read(path: Path) -> pd.DataFrame:
    plans = plans_of(path)
    table = read_table(path, recalls(plans))
    frame: pd.DataFrame = table.drop_columns(["order", "free"]).to_pandas()
    free = np.unpackbits(bits_of(table["free"]), axis=1, count=plans).astype(bool)
    return frame.assign(order=pd.Series(lists_of(table["order"]), dtype=object), free=list(free))
