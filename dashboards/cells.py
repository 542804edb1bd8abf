"""How names and numbers are written, and tables of them, which as strings are Markdown."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import repeat
from typing import Any, Final

import numpy as np

from dashboards.statistics.panels import COMBINED
from planners.world.arrays import Floats

NOTHING: Final = "–"
NAMES: Final = {  # headings of columns that are aligned to the left
    "stage", "planner", "configuration", "panel", "class", "memory", "protocol", "recall", "setting",
    "verdict", "source", "use",
}  # fmt: skip
USES: Final = {  # of a recalled plan, as ``planners.explanation`` names them
    "answer": "the answer",
    "polished": "the answer, polished",
    "repaired": "repaired",
    "guide": "guided the search",
    "": "",
}
PLANNING_TIME: Final = (
    "Planning time is everything from receiving the obstacles to returning a plan: drawing the grid, "
    "encoding, recall, checking recalled plans, guides and repair, the planner's own structures, search. One "
    "problem at a time, one thread, compiled code warm. Failures count with the time they took."
)
_PLANNERS: Final = {"rrt": "RRT", "gust": "GUST", "follow": "Follow", "lattice": "Lattice"}

_NUMBER: Final = re.compile(r"[+-]?\d[\d,]*(?:\.\d+)?(?:e[+-]?\d+)?")


class Cell(str):
    """A number as people read it, or several, that remembers for programs what was not rounded."""

    value: Any

    def __new__(cls, text: str, number: Any = None, /, **numbers: float) -> Cell:
        """A ``text`` that says a ``number``, or several ``numbers`` by name."""
        cell = super().__new__(cls, text)
        cell.value = {name: _plain(each) for name, each in numbers.items()} if numbers else _plain(number)
        return cell


Rows = list[list[str]]


def planner_title(planner: str) -> str:
    """The name of a ``planner`` as people write it."""
    return _PLANNERS.get(planner, planner)


def panel_title(panel: str, planner: str) -> str:
    """The title of what a ``planner`` did in a ``panel``, which is a class or the combined memory."""
    return f"{planner_title(planner)}, {'combined memory' if panel == COMBINED else panel}"


def percent(fraction: float) -> str:
    """A ``fraction`` in per cent without the sign, like ``12.3``; a dash for NaN."""
    return NOTHING if math.isnan(fraction) else Cell(f"{100.0 * fraction:.1f}", 100.0 * fraction)


def p_value(value: float) -> str:
    """A p-value to three decimals; a dash for NaN."""
    if math.isnan(value):
        return NOTHING
    return Cell("< 0.001" if value < 0.001 else f"{value:.3f}", value)


def decimals_of(milliseconds: Floats) -> int:
    """How many decimals all times of a table get: two digits of the least of ``milliseconds``, 3 at most."""
    least, most = float(np.nanmin(milliseconds)), float(np.nanmax(milliseconds))
    wanted = 3 if least <= 0.0 else 1 - math.floor(math.log10(least))
    return max(0, min(wanted, 3 if most < 1000.0 else 2))


def decimal(value: float, decimals: int) -> str:
    """A ``value`` with so many ``decimals``; a dash for NaN."""
    return NOTHING if math.isnan(value) else Cell(f"{value:z,.{decimals}f}", value)


def count(value: float) -> str:
    """A mean count in at most six characters: 834, 47.3 k, 163 M."""
    for unit, size in (("G", 1e9), ("M", 1e6), ("k", 1e3)):
        if value >= 0.9995 * size:
            return Cell(f"{value / size:.3g} {unit}", value)
    return Cell(f"{value:.0f}", value)


def duration(milliseconds: float) -> str:
    """A duration with two digits that count and a unit that suits it: 43 µs, 0.54 ms, 1.2 s."""
    if math.isnan(milliseconds):
        return NOTHING
    for unit, size in (("s", 1e3), ("ms", 0.1)):
        if milliseconds >= size:
            value = milliseconds / (1e3 if unit == "s" else 1.0)
            return f"{value:.{max(0, 1 - math.floor(math.log10(value)))}f} {unit}"
    return f"{1e3 * milliseconds:.0f} µs"


def with_interval(value: float, low: float, high: float, decimals: int = 0) -> str:
    """A fraction and its interval from ``low`` to ``high`` in per cent; a dash for NaN."""
    if math.isnan(value):
        return NOTHING
    shares = {"value": 100.0 * value, "low": 100.0 * low, "high": 100.0 * high}
    ends = (f"{shares[end]:z{4 + decimals}.{decimals}f}" for end in ("low", "high"))  # they align in columns
    return Cell(f"{shares['value']:z.{decimals}f} [{', '.join(ends)}]", **shares)


def value_of(cell: str) -> Any:
    """What a ``cell`` says, for programs: what a ``Cell`` remembers, a number, None for a dash, or itself."""
    if isinstance(cell, Cell):
        return cell.value
    if cell == NOTHING or not _NUMBER.fullmatch(cell):
        return None if cell == NOTHING else cell
    digits = cell.replace(",", "")
    return int(digits) if digits.lstrip("+-").isdigit() else float(digits)


def _plain(value: Any) -> Any:
    """A number as JSON knows it; None for NaN."""
    plain = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(plain, float) and math.isnan(plain) else plain


@dataclass(frozen=True)
class CellTable:
    """A table of cells; as a string it is Markdown."""

    title: str
    headings: Sequence[str]  # one of ``NAMES`` aligns its column to the left
    groups: Sequence[Rows]  # rows that belong together stand together
    name: str = ""  # what programs know it by (docs/commands.md)
    fields: Sequence[str] = ()  # what programs know its columns by, with units; by default its headings
    panel: str | None = None  # the class that all its rows are of

    def __str__(self) -> str:
        rows = [cells for group in self.groups for cells in group]
        return f"### {self.title}\n\n{markdown_table(self.headings, rows)}"


def titled_tables(
    headings: Sequence[str],
    titled: Iterable[tuple[str, Sequence[Rows]]],
    name: str = "",
    fields: Sequence[str] = (),
    panels: Iterable[str | None] = repeat(None),
) -> list[CellTable]:
    """Tables under the same ``headings``, of pairs of a title and groups of rows, each with a panel."""
    return [
        CellTable(title, headings, groups, name, fields, panel)
        for (title, groups), panel in zip(titled, panels, strict=False)  # panels may never end
    ]


def as_markdown(tables: Iterable[CellTable]) -> str:
    """Several ``tables`` as Markdown, one below another."""
    return "\n".join(map(str, tables))


def markdown_table(headings: Sequence[str], rows: Rows) -> str:
    """A Markdown table of ``rows`` of cells whose source is aligned too."""
    widths = [max(len(cells[i]) for cells in [headings, *rows]) for i in range(len(headings))]

    def line(cells: Sequence[str]) -> str:
        padded = [
            cell.ljust(width) if heading in NAMES else cell.rjust(width)
            for heading, cell, width in zip(headings, cells, widths, strict=True)
        ]
        return f"| {' | '.join(padded)} |\n"

    rule = ["-" * w if h in NAMES else "-" * (w - 1) + ":" for h, w in zip(headings, widths, strict=True)]
    return line(headings) + line(rule) + "".join(line(cells) for cells in rows)
