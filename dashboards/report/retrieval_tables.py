"""The tables of what recall finds, in per cent of the problems."""

from __future__ import annotations

import math
from typing import Any, Final

import pandas as pd

from dashboards.cells import NOTHING, Cell, CellTable, Rows, markdown_table, percent

RETRIEVAL_HEADINGS: Final = (
    "class", "memory", "protocol", "recall", "origin@1", "origin@5", "hit@1", "hit@5", "oracle", "none",
    "count",
)  # fmt: skip
_RETRIEVAL_FIELDS: Final = (
    "class", "memory", "protocol", "recall", "origin_1_percent", "origin_5_percent", "hit_1_percent",
    "hit_5_percent", "oracle_percent", "none_percent", "problems",
)  # fmt: skip


def retrieval_table(retrieval: pd.DataFrame) -> CellTable:
    """The rows of ``retrieval_rates.summarise_retrieval``, in per cent of the problems."""
    groups = retrieval_groups(retrieval)
    return CellTable("Retrieval, % of problems", RETRIEVAL_HEADINGS, groups, "retrieval", _RETRIEVAL_FIELDS)


def retrieval_markdown(retrieval: pd.DataFrame) -> str:
    """The rows of ``retrieval_rates.summarise_retrieval`` as Markdown, in per cent of the problems."""
    lines = [cells for group in retrieval_groups(retrieval) for cells in group]
    return markdown_table(RETRIEVAL_HEADINGS, lines)


def retrieval_groups(retrieval: pd.DataFrame) -> list[Rows]:
    """The cells of ``retrieval_rates.summarise_retrieval``, a group a class and memory.

    After the rankings of a protocol comes a row of what plans picked blindly reach.
    """
    groups = []
    for _, of_memory in retrieval.groupby(["panel", "memory"], sort=False):
        lines = []
        for _, rows in of_memory.groupby("protocol", sort=False):
            blind = rows.iloc[0].copy()
            plans = blind["plans"]
            origin = [math.nan if math.isnan(blind["origin@1"]) else min(k, plans) / plans for k in (1, 5)]
            blind[["origin@1", "origin@5"]] = origin
            blind[["hit@1", "hit@5"]] = blind[["random@1", "random@5"]].to_numpy()
            blind[[f"{name}_sd@{k}" for name in ("origin", "hit") for k in (1, 5)]] = math.nan
            blind[["recall", "nothing_recalled"]] = "random", 0.0
            lines += [_retrieval_cells(row) for _, row in rows.iterrows()] + [_retrieval_cells(blind)]
        groups.append(lines)
    return groups


def _retrieval_cells(row: pd.Series[Any]) -> list[str]:
    names = [str(row[column]) for column in ("panel", "memory", "protocol", "recall")]
    names[1] = "own" if names[0] == names[1] else names[1]
    shares = [
        _with_deviation(row[f"{name}@{k}"], row[f"{name}_sd@{k}"])
        for name in ("origin", "hit")
        for k in (1, 5)
    ]
    rest = [percent(row["oracle"]), percent(row["nothing_recalled"]), f"{row['problems']:,}"]
    return [*names, *shares, *rest]


def _with_deviation(share: float, deviation: float) -> str:
    """A share in per cent, and its standard deviation over training seeds where there are several."""
    if math.isnan(share):
        return NOTHING
    if math.isnan(deviation):
        return percent(share)
    value, spread = 100.0 * share, 100.0 * deviation
    return Cell(f"{percent(share)}±{spread:.{1 if spread < 9.95 else 0}f}", value=value, deviation=spread)
