"""Charts as SVG: dots with intervals, stacked bars, lines, maps; each with its legend and its numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
import pandas as pd

from dashboards.palette import GREY
from dashboards.statistics.embedding_plane import axis_ends
from dashboards.web.svg import Axis, LogScale, Scale, element, linked, points, short, span, text, tooltip
from planners.world.arrays import Floats

FAINT: Final = "var(--line)"  # a colour that hardly shows, on a light screen or a dark one
WIDTH: Final = 360.0  # pixels of a drawing: fits a phone
_ROW: Final = 21.0  # pixels a row
_LETTER: Final = 6.1  # pixels, widest
_LAYERS: Final = ("dot", "cross", "disc", "star", "ring")  # of a map, from below


class Drawing(NamedTuple):
    """One of the drawings of a chart."""

    title: str
    width: float  # pixels
    height: float
    body: str  # markup


class Chart(NamedTuple):
    """What a page shows and gives away as SVG, PNG and CSV."""

    name: str  # in addresses and file names
    title: str  # says what it shows
    note: str  # says what it is made of, and what counts as planning time
    drawings: Sequence[Drawing]
    table: pd.DataFrame  # the numbers behind it
    legend: Sequence[tuple[str, str]] = ()  # colours, and what they stand for


class Dot(NamedTuple):
    """A row of a chart: a dot with its 95 % interval, if that is finite."""

    label: str
    estimate: tuple[float, float, float]  # the value and the ends of its interval
    colour: str
    tooltip: str
    address: str | None = None


class Line(NamedTuple):
    """A line through points, with a band from ``low`` to ``high`` if these are given."""

    label: str
    x: Floats
    y: Floats
    colour: str
    low: Floats | None = None
    high: Floats | None = None
    dots: bool = False


class Mark(NamedTuple):
    """A mark on a map."""

    place: list[float]  # x, y
    kind: str  # one of _LAYERS
    colour: str
    tooltip: str
    address: str | None = None


def dots(
    titled: Iterable[tuple[str, Sequence[Dot]]],
    axis: str,
    ends: tuple[float, float],
    of_axis: type[Axis] = Scale,
) -> list[Drawing]:
    """Drawings of dots with their intervals, one a row, and a line where nothing differs: at 0, or at 1.

    An arrow stands for a dot beyond the axis, and for an interval that goes on beyond it. The axes of all
    drawings are equally long.

    Args:
        titled: of each drawing its title, and the dots from top to bottom.
        axis: name of the axis.
        ends: lowest and highest value on the axis.
        of_axis: the kind of axis; LogScale for ratios, among which nothing differs at 1.
    """
    drawn = list(titled)
    left = _beside([row.label for _, rows in drawn for row in rows])
    return [_dots(title, rows, left, axis, ends, of_axis) for title, rows in drawn]


def _dots(
    title: str,
    rows: Sequence[Dot],
    left: float,
    axis: str,
    ends: tuple[float, float],
    of_axis: type[Axis],
) -> Drawing:
    scale, bottom, marks = _rows_with_axis(len(rows), left, axis, ends, of_axis)
    same = 1.0 if of_axis is LogScale else 0.0
    if ends[0] < same < ends[1]:
        marks.append(element("line", x1=scale.at(same), x2=scale.at(same), y1=4.0, y2=bottom, class_="zero"))
    for i, row in enumerate(rows):
        y = 8.0 + _ROW * (i + 0.5)
        value, low, high = row.estimate
        parts = [
            element("rect", x=0.0, y=y - _ROW / 2, width=WIDTH, height=_ROW, class_="row"),
            text(row.label, scale.first - 8.0, y + 4.0, class_="label", text_anchor="end"),
        ]
        if np.isfinite([low, high]).all():
            bar = {"x1": scale.at(low), "x2": scale.at(high), "y1": y, "y2": y}
            parts.append(element("line", **bar, class_="interval", stroke=row.colour))
            for x, length, is_cut in ((scale.first, -4, low < ends[0]), (scale.last, 4, high > ends[1])):
                if is_cut:
                    arrow = f"M{x:.1f} {y - 3.5:.1f}l{length} 3.5l{-length} 3.5z"
                    parts.append(element("path", d=arrow, fill=row.colour))
        if np.isfinite(value):
            x, beyond = scale.at(value), not ends[0] <= value <= ends[1]
            length = 7 if value > ends[1] else -7
            arrow = f"M{x - length / 2:.1f} {y - 5:.1f}l{length} 5l{-length} 5z"
            shape: dict[str, object] = {"d": arrow} if beyond else {"cx": x, "cy": y, "r": 4.5}
            parts.append(element("path" if beyond else "circle", **shape, fill=row.colour))
        marks.append(
            linked(row.address, tooltip(row.tooltip), *parts, label=row.tooltip if row.address else None)
        )
    return Drawing(title, WIDTH, bottom + 46.0, "".join(marks))


def stacks(
    titled: Mapping[str, Mapping[str, Sequence[tuple[str, float]]]],
    colours: Mapping[str, str],
    axis: str,
    unit: str,
) -> list[Drawing]:
    """Drawings of bars made of parts, one a row; their axes are equally long, each with ends of its own.

    Args:
        titled: of each drawing, by title, the names and sizes of the parts by label.
        colours: colour of each part, by its name.
        axis: name of the axis.
        unit: unit of the sizes, in tooltips.
    """
    left = _beside([label for rows in titled.values() for label in rows])
    return [_stacks(title, rows, left, colours, axis, unit) for title, rows in titled.items()]


def _stacks(
    title: str,
    rows: Mapping[str, Sequence[tuple[str, float]]],
    left: float,
    colours: Mapping[str, str],
    axis: str,
    unit: str,
) -> Drawing:
    end = 1.05 * max((sum(size for _, size in parts) for parts in rows.values()), default=1.0)
    scale, bottom, marks = _rows_with_axis(len(rows), left, axis, (0.0, end))
    for i, (label, parts) in enumerate(rows.items()):
        y = 11.5 + _ROW * i
        marks.append(text(label, scale.first - 8.0, y + 11.0, class_="label", text_anchor="end"))
        before = 0.0
        for name, size in parts:
            first, last = scale.at(before), scale.at(before + size)
            words = tooltip(f"{label}: {name} {size:.3g} {unit}")
            place = {"x": first, "y": y, "width": last - first, "height": _ROW - 7.0}
            marks.append(element("rect", words, **place, fill=colours[name]))
            before += size
    return Drawing(title, WIDTH, bottom + 46.0, "".join(marks))


def lines(
    title: str,
    drawn: Sequence[Line],
    x_axis: str,
    y_axis: str,
    *,
    height: float = 220.0,
    x_ends: tuple[float, float] | None = None,
    y_ends: tuple[float, float] | None = None,
    x_ticks: Sequence[float] | None = None,
    ratios: bool = False,
    has_cursor: bool = False,
) -> Drawing:
    """Lines over a common axis.

    Args:
        title: title of the drawing.
        drawn: the lines.
        x_axis: name of the x axis.
        y_axis: name of the y axis.
        height: pixels.
        x_ends: lowest and highest x; None if the lines decide.
        y_ends: lowest and highest y; None if the lines decide.
        x_ticks: the ticks of the x axis; None if the lines decide.
        ratios: whether y are ratios, whose axis is logarithmic, with a line at 1.
        has_cursor: whether there is a vertical line that the page's script moves.
    """
    bands = [band for line in drawn for band in (line.y, line.low, line.high) if band is not None]
    x_low, x_high = x_ends or span(np.concatenate([line.x for line in drawn]).tolist(), margin=0.0)
    y_low, y_high = y_ends or span(np.concatenate(bands).tolist())
    left, right, top, bottom = 50.0, WIDTH - 14.0, 22.0, height - 36.0
    of_axis: type[Scale] | type[LogScale] = LogScale if ratios else Scale
    across, up = Scale(x_low, x_high, left, right), of_axis(y_low, y_high, bottom, top)
    marks = [_x_axis(across, bottom, x_axis, x_ticks), *_y_axis(up, left, right)]
    marks.append(text(y_axis, 2.0, 12.0, class_="name"))
    if ratios:
        marks.append(element("line", x1=left, x2=right, y1=up.at(1.0), y2=up.at(1.0), class_="zero"))
    for line in drawn:
        sound = np.isfinite(line.y)
        x, y = across.pixels(line.x[sound]), up.pixels(line.y[sound])
        if line.low is not None and line.high is not None:
            low, high = up.pixels(line.low[sound]), up.pixels(line.high[sound])
            band = np.concatenate([np.column_stack([x, high]), np.column_stack([x, low])[::-1]])
            marks.append(element("polygon", points=points(band), class_="band", fill=line.colour))
        way = points(np.column_stack([x, y]))
        marks.append(element("polyline", tooltip(line.label), points=way, class_="line", stroke=line.colour))
        if line.dots:
            values = zip(line.x[sound].tolist(), line.y[sound].tolist(), strict=True)
            words = [tooltip(f"{line.label}: {short(value)} at {short(place)}") for place, value in values]
            marks += [
                element("circle", said, cx=cx, cy=cy, r=3.5, fill=line.colour)
                for said, cx, cy in zip(words, x.tolist(), y.tolist(), strict=True)
            ]
    if has_cursor:
        ends = {"data_first": left, "data_last": right, "data_low": x_low, "data_high": x_high}
        marks.append(element("line", x1=left, x2=left, y1=top, y2=bottom, class_="cursor", **ends))
    return Drawing(title, WIDTH, height, "".join(marks))


def map_of(marks: Sequence[Mark], x_axis: str, y_axis: str, size: float = 560.0) -> Drawing:
    """A square map of ``marks``, ``size`` pixels wide; one mark in a hundred may lie beyond an axis.

    Args:
        marks: what is drawn, in order.
        x_axis: name of the horizontal axis.
        y_axis: name of the vertical axis.
        size: width and height in pixels.
    """
    places = np.array([mark.place for mark in marks])
    left, right, top, bottom = 46.0, size - 10.0, 10.0, size - 36.0
    across, up = (
        Scale(*axis_ends(places[:, 0]), left, right),
        Scale(*axis_ends(places[:, 1]), bottom, top),
    )
    turn = f"translate(12 {0.5 * (top + bottom):.0f}) rotate(-90)"
    drawn = [
        _x_axis(across, bottom, x_axis),
        *_y_axis(up, left, right),
        text(y_axis, 0.0, 0.0, class_="name", text_anchor="middle", transform=turn),
    ]
    for mark in sorted(marks, key=lambda mark: _LAYERS.index(mark.kind)):
        drawn.append(
            linked(
                mark.address,
                _drawn(mark, across.at(mark.place[0]), up.at(mark.place[1])),
                label=mark.tooltip if mark.address else None,
            )
        )
    return Drawing("", size, size, "".join(drawn))


def _drawn(mark: Mark, x: float, y: float) -> str:
    words = tooltip(mark.tooltip)
    match mark.kind:
        case "dot":
            return element("circle", words, cx=x, cy=y, r=2.2, fill=mark.colour)
        case "cross":
            cross = f"M{x - 2:.1f} {y - 2:.1f}l4 4m0 -4l-4 4"
            return element("path", words, d=cross, class_="line thin", stroke=GREY)
        case "disc":
            return element("circle", words, cx=x, cy=y, r=6.0, class_="rim", fill=mark.colour)
        case "ring":
            return element("circle", words, cx=x, cy=y, r=9.0, class_="ring")
        case _:
            turns = np.arange(10) * np.pi / 5 - np.pi / 2
            radii = np.where(np.arange(10) % 2, 4.0, 10.0)
            corners = np.column_stack([x + radii * np.cos(turns), y + radii * np.sin(turns)])
            return element("polygon", words, points=points(corners), class_="star")


def _beside(labels: Sequence[str]) -> float:
    """Where an axis begins that stands beside ``labels``, in pixels."""
    return 14.0 + _LETTER * max((len(label) for label in labels), default=0)


def _rows_with_axis(
    rows: int, left: float, axis: str, ends: tuple[float, float], of_axis: type[Axis] = Scale
) -> tuple[Axis, float, list[str]]:
    """The scale that begins at ``left`` below so many ``rows``, where it lies, and its marks."""
    scale, bottom = of_axis(*ends, left, WIDTH - 16.0), 8.0 + _ROW * rows
    return scale, bottom, [_x_axis(scale, bottom, axis)]


def _x_axis(scale: Axis, y: float, title: str, ticks: Sequence[float] | None = None) -> str:
    about = max(2, int((scale.last - scale.first) / 62.0))
    marks = [element("line", x1=scale.first, x2=scale.last, y1=y, y2=y, class_="axis")]
    for value, fine in _ticks(scale, about) if ticks is None else [(each, "") for each in ticks]:
        x = scale.at(value)
        marks.append(element("line", x1=x, x2=x, y1=y, y2=y + 4.0, class_=f"axis{fine}"))
        marks.append(text(short(value), x, y + 16.0, class_=f"tick{fine}", text_anchor="middle"))
    middle, half = 0.5 * (scale.first + scale.last), 0.5 * 5.6 * len(title)
    middle = min(max(middle, half), WIDTH - half) if scale.last <= WIDTH and half < WIDTH / 2 else middle
    marks.append(text(title, middle, y + 32.0, class_="name", text_anchor="middle"))
    return "".join(marks)


def _y_axis(scale: Axis, left: float, right: float) -> list[str]:
    marks = []
    for value, fine in _ticks(scale, 4):
        y = scale.at(value)
        marks.append(element("line", x1=left, x2=right, y1=y, y2=y, class_=f"grid{fine}"))
        marks.append(text(short(value), left - 6.0, y + 4.0, class_=f"tick{fine}", text_anchor="end"))
    return marks


def _ticks(scale: Axis, about: int) -> list[tuple[float, str]]:
    """``about`` as many values as wanted, then those that only show in a part of the drawing, and a class."""
    shown = scale.ticks(about)
    finer = [value for value in scale.ticks(4 * about) if not np.isclose(value, shown).any()]
    return [*((value, "") for value in shown), *((value, " fine") for value in finer)]
