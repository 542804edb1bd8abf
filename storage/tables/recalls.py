"""Recalls: which plans a memory ranks first for a problem, and which are really free."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from storage.tables.columns import bits_column, bits_of, list_column, lists_of
from storage.tables.hallucinated import plans_of
from storage.tables.schemas import recalls
from storage.tables.shards import read_table, sound, write_table


def write_recalls(path: Path, rows: Sequence[dict[str, Any]], *, plans: int, key: str = "") -> None:
    """Write ``rows`` of ``schemas.recalls`` of a memory of so many ``plans``.

    In a row, ``order`` holds the numbers of the first plans, best first, and ``free`` one truth value a plan.

    Args:
        path: the file to write.
        rows: values by column.
        plans: number of plans in the memory.
        key: what the rows were made from.

    Raises:
        KeyError: a row lacks a field.
    """
    schema = recalls(plans)
    columns = {name: [row[name] for row in rows] for name in schema.names}
    free = np.array(columns["free"], bool).reshape(-1, plans)
    arrays = {
        "order": list_column(columns["order"], np.int32),
        "free": bits_column(np.packbits(free, axis=1)),
    }
    write_table(path, pa.table(columns | arrays, schema=schema), key)


def read_recalls(paths: Sequence[Path]) -> pd.DataFrame:
    """The rows of the shards at ``paths``; ``order`` holds int32 arrays, ``free`` bool arrays."""
    return pd.concat([_read(path) for path in paths], ignore_index=True)


def _read(path: Path) -> pd.DataFrame:
    plans = plans_of(path)
    table = read_table(path, recalls(plans))
    with sound(path):
        orders = lists_of(table["order"])
        if any(order.min(initial=0) < 0 or order.max(initial=0) >= plans for order in orders):
            raise ValueError(f"order has plans outside 0 to {plans - 1}")
        frame: pd.DataFrame = table.drop_columns(["order", "free"]).to_pandas()
        free = np.unpackbits(bits_of(table["free"]), axis=1, count=plans).astype(bool)
        return frame.assign(order=pd.Series(orders, dtype=object), free=list(free))
