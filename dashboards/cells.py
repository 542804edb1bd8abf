"""Tables and their cells: how a figure is written, for a terminal and as Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np
from rich import box
from rich.console import Group
from rich.table import Table

from planners.world.arrays import Floats

NOTHING: Final = "–"
NAMES: Final = {  # headings of columns to the left
    "stage", "planner", "configuration", "panel", "class", "memory", "protocol", "recall", "setting",
    "verdict",
}  # fmt: skip

Rows = list[list[str]]


def percent(fraction: float) -> str:
    """A fraction in per cent, without the sign."""
    return f"{100.0 * fraction:.1f}"


def share(fraction: float) -> str:
    """The same, where there may be none."""
    return NOTHING if math.isnan(fraction) else percent(fraction)


def p_value(value: float) -> str:
    """A p-value to three places."""
    if math.isnan(value):
        return NOTHING
    return "< 0.001" if value < 0.001 else f"{value:.3f}"


def decimals_of(milliseconds: Floats) -> int:
    """Decimals for all times of a panel, so that their points align: two digits of the least, 3 at most."""
    least, most = float(np.nanmin(milliseconds)), float(np.nanmax(milliseconds))
    wanted = 3 if least <= 0.0 else 1 - math.floor(math.log10(least))
    return max(0, min(wanted, 3 if most < 1000.0 else 2))


def count(value: float) -> str:
    """A mean count in at most six places: 834, 47.3 k, 163 M."""
    for unit, size in (("G", 1e9), ("M", 1e6), ("k", 1e3)):
        if value >= 0.9995 * size:
            return f"{value / size:.3g} {unit}"
    return f"{value:.0f}"


def reduction(value: float, low: float, high: float) -> str:
    """A reduction in per cent and its interval, where there is one."""
    if math.isnan(value):
        return NOTHING
    return f"{100.0 * value:.1f} [{100.0 * low:5.1f}, {100.0 * high:5.1f}]"


def rich_table(title: str, headings: Sequence[str], groups: Sequence[Rows]) -> Table:
    """A table with numbers to the right and a gap after groups of several lines, named on the first only."""
    table = Table(
        title=title,
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        padding=(0, 1, 0, 0),
    )
    for heading in headings:
        table.add_column(heading, justify="left" if heading in NAMES else "right", no_wrap=True)
    for group in groups:
        for i, cells in enumerate(group):
            table.add_row(cells[0] if i == 0 else "", *cells[1:], end_section=i == len(group) - 1 > 0)
    return table


def titled_tables(headings: Sequence[str], titled: Iterable[tuple[str, Sequence[Rows]]]) -> Group:
    """For a terminal: a table under each title."""
    return Group(*[rich_table(title, headings, groups) for title, groups in titled])


def titled_markdown(headings: Sequence[str], titled: Iterable[tuple[str, Sequence[Rows]]]) -> str:
    """As Markdown: a heading and a table for each title."""
    return "\n".join(
        f"### {title}\n\n{markdown_table(headings, [cells for group in groups for cells in group])}"
        for title, groups in titled
    )


def markdown_table(headings: Sequence[str], rows: Rows) -> str:
    """A Markdown table whose source is aligned too."""
    widths = [max(len(cells[i]) for cells in [headings, *rows]) for i in range(len(headings))]

    def line(cells: Sequence[str]) -> str:
        padded = [
            cell.ljust(width) if heading in NAMES else cell.rjust(width)
            for heading, cell, width in zip(headings, cells, widths, strict=True)
        ]
        return f"| {' | '.join(padded)} |\n"

    rule = ["-" * w if h in NAMES else "-" * (w - 1) + ":" for h, w in zip(headings, widths, strict=True)]
    return line(headings) + line(rule) + "".join(line(cells) for cells in rows)
