"""The summaries of a run as tables: for a terminal, for a Markdown page, for a spreadsheet."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import pandas as pd
from rich import box
from rich.console import Group
from rich.table import Table

from dashboards.statistics import ASSISTS, PLANNERS, RECALLS, ranked
from planners.world.problem import Floats

NOTHING: Final = "–"
_HEADINGS: Final = (
    "planner", "assist", "solved %", "mean ms", "median", "90 %", "reduction % [95 %]", "recalled",
    "checks",
)  # fmt: skip
_RETRIEVAL_HEADINGS: Final = (
    "class", "memory", "protocol", "recall", "origin@1", "origin@5", "hit@1", "hit@5", "oracle", "none",
    "count",
)  # fmt: skip
_NAMES: Final = {
    "planner",
    "assist",
    "class",
    "memory",
    "protocol",
    "recall",
}  # words, set to the left

_Rows = list[list[str]]


def configuration(assist: str, recall: str, top_k: int) -> str:
    """The name of a configuration in tables, as ``closed 5 centroid``, ``random-open 5``, or ``none``."""
    strategy = f" {recall}" if recall not in ("", "random") else ""  # the assist says that it is random
    return f"{assist} {top_k}{strategy}" if top_k else assist


def summary_table(summary: pd.DataFrame) -> Group:
    """The summary (``statistics.summarise``) for a terminal at least 110 columns wide: a table a class."""
    return Group(*[_rich(title, _HEADINGS, groups) for title, groups in _panels(summary)])


def summary_markdown(summary: pd.DataFrame) -> str:
    """The summary as Markdown: a heading and a table a class."""
    return "\n".join(
        f"### {title}\n\n{_markdown(_HEADINGS, [cells for group in groups for cells in group])}"
        for title, groups in _panels(summary)
    )


def retrieval_table(retrieval: pd.DataFrame) -> Table:
    """Retrieval (``retrieval.summarise_retrieval``) for a terminal, in per cent of the problems."""
    return _rich("Retrieval, % of problems", _RETRIEVAL_HEADINGS, _retrieval_groups(retrieval))


def retrieval_markdown(retrieval: pd.DataFrame) -> str:
    """Retrieval as a Markdown table, in per cent of the problems."""
    lines = [cells for group in _retrieval_groups(retrieval) for cells in group]
    return _markdown(_RETRIEVAL_HEADINGS, lines)


def as_csv(table: pd.DataFrame) -> str:
    """Either summary as comma-separated values, unrounded."""
    return str(table.to_csv(index=False, lineterminator="\n"))


def _panels(summary: pd.DataFrame) -> list[tuple[str, list[_Rows]]]:
    """Per panel its title and its rows of cells, grouped by planner.

    Every planner appears in every panel with every configuration that any panel has for it, so that what was
    not attempted is seen to be missing.
    """
    titled = []
    for panel in summary["panel"].unique():
        rows = summary[summary["panel"] == panel]
        decimals = _decimals(rows[["mean_ms", "median_ms"]].to_numpy(dtype=float))
        by_key = {
            (row["planner"], row["assist"], row["recall"], row["top_k"]): row for _, row in rows.iterrows()
        }
        groups = []
        for planner in ranked(summary["planner"], PLANNERS):
            wanted = summary[summary["planner"] == planner]
            assists, recalls = ranked(wanted["assist"], ASSISTS), ranked(wanted["recall"], RECALLS)
            keys = {
                (assists.index(assist), recalls.index(recall), assist, recall, k)
                for assist, recall, k in zip(wanted["assist"], wanted["recall"], wanted["top_k"], strict=True)
            }
            groups.append(
                [
                    [planner, configuration(*key), *_cells(by_key.get((planner, *key)), decimals)]
                    for _, _, *key in sorted(keys)
                ]
            )
        titled.append((f"{panel}, {int(rows['problems'].max()):,} problems", groups))
    return titled


def _cells(row: pd.Series[Any] | None, decimals: int) -> list[str]:
    """The figures of one configuration."""
    if row is None:
        return [NOTHING] * (len(_HEADINGS) - 2)
    baseline = row["assist"] == "none"
    return [
        _percent(row["solved"]),
        *[f"{row[column]:,.{decimals}f}" for column in ("mean_ms", "median_ms", "p90_ms")],
        NOTHING if baseline else _reduction(row["reduction"], row["reduction_low"], row["reduction_high"]),
        NOTHING if baseline else _percent(row["recalled"]),
        _count(row["collision_checks"]),
    ]


def _retrieval_groups(retrieval: pd.DataFrame) -> list[_Rows]:
    """Lines of a class and memory; under the ways to recall, what plans picked blindly reach."""
    groups = []
    for _, of_memory in retrieval.groupby(["panel", "memory"], sort=False):
        lines = []
        for _, rows in of_memory.groupby("protocol", sort=False):
            blind = rows.iloc[0].copy()
            origin = [math.nan if math.isnan(blind["origin@1"]) else k / blind["plans"] for k in (1, 5)]
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
    rest = [_percent(row["oracle"]), _percent(row["nothing_recalled"]), f"{row['problems']:,}"]
    return [*names, *shares, *rest]


def _with_deviation(share: float, deviation: float) -> str:
    """A share in per cent, and its standard deviation over training seeds where there are several."""
    if math.isnan(share):
        return NOTHING
    digits = 1 if deviation < 0.0995 else 0
    return _percent(share) + ("" if math.isnan(deviation) else f"±{100.0 * deviation:.{digits}f}")


def _percent(fraction: float) -> str:
    return f"{100.0 * fraction:.1f}"


def _decimals(milliseconds: Floats) -> int:
    """Decimals for all times of a panel, so that their points align: two digits of the least, 3 at most."""
    least, most = float(np.nanmin(milliseconds)), float(np.nanmax(milliseconds))
    wanted = 3 if least <= 0.0 else 1 - math.floor(math.log10(least))
    return max(0, min(wanted, 3 if most < 1000.0 else 2))


def _count(value: float) -> str:
    """A mean count in at most six places: 834, 47.3 k, 163 M."""
    for unit, size in (("G", 1e9), ("M", 1e6), ("k", 1e3)):
        if value >= 0.9995 * size:
            return f"{value / size:.3g} {unit}"
    return f"{value:.0f}"


def _reduction(value: float, low: float, high: float) -> str:
    if math.isnan(value):
        return NOTHING
    return f"{100.0 * value:.1f} [{100.0 * low:5.1f}, {100.0 * high:5.1f}]"


def _rich(title: str, headings: Sequence[str], groups: Sequence[_Rows]) -> Table:
    """A table with numbers to the right and a gap between groups, each named on its first line only."""
    table = Table(
        title=title,
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        padding=(0, 1, 0, 0),
    )
    for heading in headings:
        table.add_column(heading, justify="left" if heading in _NAMES else "right", no_wrap=True)
    for group in groups:
        for i, cells in enumerate(group):
            table.add_row(cells[0] if i == 0 else "", *cells[1:], end_section=i == len(group) - 1)
    return table


def _markdown(headings: Sequence[str], rows: _Rows) -> str:
    """A Markdown table whose source is aligned too."""
    widths = [max(len(cells[i]) for cells in [headings, *rows]) for i in range(len(headings))]

    def line(cells: Sequence[str]) -> str:
        padded = [
            cell.ljust(width) if heading in _NAMES else cell.rjust(width)
            for heading, cell, width in zip(headings, cells, widths, strict=True)
        ]
        return f"| {' | '.join(padded)} |\n"

    rule = ["-" * w if h in _NAMES else "-" * (w - 1) + ":" for h, w in zip(headings, widths, strict=True)]
    return line(headings) + line(rule) + "".join(line(cells) for cells in rows)
