"""A chart as an SVG file that needs no other file."""

from __future__ import annotations

import textwrap
from importlib.resources import files
from typing import Final

from dashboards.palette import style_sheet
from dashboards.web.charts import Chart
from dashboards.web.svg import element, text

_GAP: Final = 18.0
_COLUMNS: Final = 3
_LETTER: Final = 5.9  # pixels of a note's letter


def svg_file(chart: Chart) -> str:
    """A ``chart`` with its title, legend and note, in the colours of a white page."""
    columns = min(_COLUMNS, len(chart.drawings) or 1)
    rows = [chart.drawings[i : i + columns] for i in range(0, len(chart.drawings), columns)]
    width = max([480.0, *(sum(each.width for each in row) + _GAP * (len(row) + 1) for row in rows)])
    marks = [text(chart.title, _GAP, 28.0, class_="title")]
    x, y = _GAP, 44.0
    for colour, label in chart.legend:
        room = 24.0 + 6.4 * len(label)
        if x + room > width:
            x, y = _GAP, y + 18.0
        marks.append(element("rect", x=x, y=y, width=11.0, height=11.0, rx=2.0, fill=colour))
        marks.append(text(label, x + 16.0, y + 10.0, class_="label"))
        x += room
    y += 28.0 if chart.legend else 8.0
    for row in rows:
        x = _GAP
        for drawing in row:
            box = f"0 0 {drawing.width:g} {drawing.height:g}"
            place = {"x": x, "y": y + 14.0, "width": drawing.width, "height": drawing.height}
            marks.append(text(drawing.title, x, y + 8.0, class_="heading"))
            marks.append(element("svg", drawing.body, **place, viewBox=box))
            x += drawing.width + _GAP
        y += max(drawing.height for drawing in row) + 28.0
    for line in textwrap.wrap(chart.note, int((width - 2 * _GAP) / _LETTER)):
        marks.append(text(line, _GAP, y + 10.0, class_="tick"))
        y += 15.0
    height = y + _GAP
    ground = element("rect", width=width, height=height, class_="ground")
    style = files("dashboards.web").joinpath("static", "charts.css").read_text("utf-8")
    style = f"{style_sheet(dark=False)}{style}svg{{font-family:system-ui,'DejaVu Sans',sans-serif}}"
    return element(
        "svg", element("style", style), ground, *marks, xmlns="http://www.w3.org/2000/svg", width=width,
        height=height, viewBox=f"0 0 {width:g} {height:g}",
    )  # fmt: skip
