"""A chart as a file of its own: SVG that needs nothing else, or the numbers behind it."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from importlib.resources import files
from typing import Final

from dashboards.report.tables import as_csv
from dashboards.web.charts import Chart, Panel
from dashboards.web.svg import element, text

_GAP: Final = 18.0
_COLUMNS: Final = 3
_LETTER: Final = 5.9  # pixels of a note's letter


def svg_file(chart: Chart) -> str:
    """The chart with its title, legend and note, in the colours of a white page."""
    columns = 1 if chart.wide else min(_COLUMNS, len(chart.panels) or 1)
    rows = [chart.panels[i : i + columns] for i in range(0, len(chart.panels), columns)]
    width = max((_width(row) for row in rows), default=0.0)
    width = max(width, 480.0)
    drawn = [text(chart.title, _GAP, 28.0, class_="title")]
    y = 44.0
    at = _GAP
    for colour, label in chart.legend:
        room = 24.0 + 6.4 * len(label)
        if at + room > width:
            at, y = _GAP, y + 18.0
        drawn.append(element("rect", x=at, y=y, width=11.0, height=11.0, rx=2.0, class_=f"f{colour}"))
        drawn.append(text(label, at + 16.0, y + 10.0, class_="label"))
        at += room
    y += 28.0 if chart.legend else 8.0
    for row in rows:
        at = _GAP
        for panel in row:
            drawn.append(text(panel.title, at, y + 8.0, class_="panel"))
            body = panel.body
            drawn.append(
                element("svg", body, x=at, y=y + 14.0, width=panel.width, height=panel.height,
                        viewBox=f"0 0 {panel.width:g} {panel.height:g}")
            )  # fmt: skip
            at += panel.width + _GAP
        y += max(panel.height for panel in row) + 28.0
    for line in textwrap.wrap(chart.note, int((width - 2 * _GAP) / _LETTER)):
        drawn.append(text(line, _GAP, y + 10.0, class_="tick"))
        y += 15.0
    height = y + _GAP
    ground = element("rect", width=width, height=height, class_="ground")
    return element(
        "svg", element("style", _style()), ground, *drawn, xmlns="http://www.w3.org/2000/svg", width=width,
        height=height, viewBox=f"0 0 {width:g} {height:g}",
    )  # fmt: skip


def csv_file(chart: Chart) -> str:
    """The chart's numbers, unrounded."""
    return as_csv(chart.table)


def _width(row: Sequence[Panel]) -> float:
    return sum(panel.width for panel in row) + _GAP * (len(row) + 1)


def _style() -> str:
    style = files("dashboards.web").joinpath("static", "charts.css").read_text("utf-8")
    colours = files("dashboards.web").joinpath("static", "light.css").read_text("utf-8")
    return f"{colours}{style}svg{{font-family:system-ui,'DejaVu Sans',sans-serif}}"
