"""Charts as SVG: dots with intervals, stacked bars, lines, places; each with its legend and its numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
import pandas as pd

from dashboards.web.svg import Scale, element, linked, points, short, span, text, told
from planners.world.arrays import Floats

WIDTH: Final = 360.0  # pixels of a panel: fits a phone
_ROW: Final = 21.0  # pixels a category
_LETTER: Final = 6.1  # pixels, widest


class Panel(NamedTuple):
    """One drawing of a chart."""

    title: str
    width: float
    height: float
    body: str  # markup


class Chart(NamedTuple):
    """What a page shows and gives away as SVG, PNG and CSV."""

    name: str  # in addresses and file names
    title: str  # says what it shows
    note: str  # what it is made of; what counts as planning time
    panels: Sequence[Panel]
    table: pd.DataFrame  # the numbers behind it
    legend: Sequence[tuple[str, str]] = ()  # class of a colour, and what it stands for
    wide: bool = False  # one panel as wide as the page


class Interval(NamedTuple):
    """A dot with its 95 % interval."""

    label: str
    value: float
    low: float
    high: float
    colour: str
    told: str
    address: str | None = None


class Line(NamedTuple):
    """A line through places, with a band where ``low`` and ``high`` are given."""

    label: str
    x: Floats
    y: Floats
    colour: str
    low: Floats | None = None
    high: Floats | None = None
    dots: bool = False


def intervals(
    title: str,
    rows: Sequence[Interval],
    axis: str,
    ends: tuple[float, float],
    written: Callable[[float], str] = short,
) -> Panel:
    """A row each: a dot, its interval, a line at 0 where the axis has one; arrows where it goes beyond."""
    left = 14.0 + _LETTER * max((len(row.label) for row in rows), default=0)
    height = 14.0 + _ROW * len(rows) + 40.0
    scale = Scale(*ends, left, WIDTH - 16.0)
    bottom = 8.0 + _ROW * len(rows)
    drawn = [_x_axis(scale, bottom, axis, written)]
    if ends[0] < 0.0 < ends[1]:
        drawn.append(element("line", x1=scale.at(0.0), x2=scale.at(0.0), y1=4.0, y2=bottom, class_="zero"))
    for i, row in enumerate(rows):
        y = 8.0 + _ROW * (i + 0.5)
        parts = [
            element("rect", x=0.0, y=y - _ROW / 2, width=WIDTH, height=_ROW, class_="row"),
            text(row.label, left - 8.0, y + 4.0, class_="label", text_anchor="end"),
        ]
        if np.isfinite([row.low, row.high]).all():
            parts.append(
                element("line", x1=scale.at(row.low), x2=scale.at(row.high), y1=y, y2=y,
                        class_=f"interval s{row.colour}")
            )  # fmt: skip
        if np.isfinite(row.value):
            x = scale.at(row.value)
            if ends[0] <= row.value <= ends[1]:
                parts.append(element("circle", cx=x, cy=y, r=4.5, class_=f"f{row.colour}"))
            else:
                parts.append(element("path", d=_arrow(x, y, row.value > ends[1]), class_=f"f{row.colour}"))
        drawn.append(linked(row.address, told(row.told), *parts, label=row.told if row.address else None))
    return Panel(title, WIDTH, height, "".join(drawn))


def stacks(
    title: str,
    rows: Mapping[str, Sequence[tuple[str, float]]],
    colours: Mapping[str, str],
    axis: str,
    end: float,
    unit: str,
) -> Panel:
    """A bar a row, its parts one after another."""
    left = 14.0 + _LETTER * max((len(label) for label in rows), default=0)
    scale = Scale(0.0, end, left, WIDTH - 16.0)
    bottom = 8.0 + _ROW * len(rows)
    drawn = [_x_axis(scale, bottom, axis, short)]
    for i, (label, parts) in enumerate(rows.items()):
        y = 8.0 + _ROW * i + 3.5
        drawn.append(text(label, left - 8.0, y + 11.0, class_="label", text_anchor="end"))
        at = 0.0
        for name, value in parts:
            first, last = scale.at(at), scale.at(at + value)
            at += value
            said = told(f"{label}: {name} {value:.3g} {unit}")
            drawn.append(
                element("rect", said, x=first, y=y, width=max(last - first, 0.0), height=_ROW - 7.0,
                        class_=f"f{colours[name]}")
            )  # fmt: skip
    return Panel(title, WIDTH, 14.0 + _ROW * len(rows) + 40.0, "".join(drawn))


def lines(
    title: str,
    drawn: Sequence[Line],
    x_axis: str,
    y_axis: str,
    *,
    height: float = 220.0,
    width: float = WIDTH,
    x_ends: tuple[float, float] | None = None,
    y_ends: tuple[float, float] | None = None,
    log_x: bool = False,
    name: str | None = None,
    x_written: Callable[[float], str] = short,
    x_ticks: Sequence[float] | None = None,
) -> Panel:
    """Lines over a common axis; ``name`` marks the panel for the page's script."""
    every_x = np.concatenate([line.x for line in drawn]) if drawn else np.zeros(1)
    bands = [band for line in drawn for band in (line.y, line.low, line.high) if band is not None]
    every_y = np.concatenate(bands) if bands else np.zeros(1)
    x_low, x_high = x_ends or span(every_x.tolist(), margin=0.0)
    y_low, y_high = y_ends or span(every_y.tolist())
    left, right, top, bottom = 50.0, width - 14.0, 22.0, height - 36.0
    across = Scale(x_low, x_high, left, right, log_x)
    up = Scale(y_low, y_high, bottom, top)
    marks = [_x_axis(across, bottom, x_axis, x_written, x_ticks), _y_axis(up, left, right, y_axis)]
    for line in drawn:
        sound = np.isfinite(line.y)
        x, y = across.places(line.x[sound]), up.places(line.y[sound])
        if line.low is not None and line.high is not None:
            low, high = up.places(line.low[sound]), up.places(line.high[sound])
            band = np.concatenate([np.column_stack([x, high]), np.column_stack([x, low])[::-1]])
            marks.append(element("polygon", points=points(band), class_=f"f{line.colour} band"))
        marks.append(
            element("polyline", told(line.label), points=points(np.column_stack([x, y])),
                    class_=f"line s{line.colour}")
        )  # fmt: skip
        if line.dots:
            marks += [
                element("circle", told(f"{line.label}: {short(value)} at {x_written(at)}"), cx=cx, cy=cy,
                        r=3.5, class_=f"f{line.colour}")
                for cx, cy, at, value in zip(
                    x.tolist(), y.tolist(), line.x[sound].tolist(), line.y[sound].tolist(), strict=True
                )
            ]  # fmt: skip
    if name is not None:
        marks.append(
            element("line", x1=left, x2=left, y1=top, y2=bottom, class_="cursor", data_first=left,
                    data_last=right, data_low=x_low, data_high=x_high)
        )  # fmt: skip
    return Panel(title, width, height, "".join(marks))


class Place(NamedTuple):
    """A mark on a map of places."""

    x: float
    y: float
    kind: str  # dot, cross, disc, star
    colour: str
    told: str = ""
    address: str | None = None


def places(title: str, found: Sequence[Place], x_axis: str, y_axis: str, size: float = 560.0) -> Panel:
    """Marks on a square, its ends so that one in two hundred may lie beyond."""
    everything = np.array([(each.x, each.y) for each in found] or [(0.0, 0.0)])
    low, high = np.percentile(everything, [0.5, 99.5], axis=0)
    room = 0.08 * np.maximum(high - low, 1e-9)
    (x_low, y_low), (x_high, y_high) = (low - room).tolist(), (high + room).tolist()
    left, right, top, bottom = 46.0, size - 10.0, 10.0, size - 36.0
    across, up = Scale(x_low, x_high, left, right), Scale(y_low, y_high, bottom, top)
    marks = [_x_axis(across, bottom, x_axis, short), _y_axis(up, left, right, y_axis, beside=True)]
    order = {"dot": 0, "cross": 1, "disc": 2, "star": 3, "here": 4}
    for each in sorted(found, key=lambda place: order[place.kind]):
        x, y = across.at(each.x), up.at(each.y)
        marks.append(linked(each.address, _mark(each, x, y), label=each.told if each.address else None))
    return Panel(title, size, size, "".join(marks))


def _mark(place: Place, x: float, y: float) -> str:
    said = told(place.told) if place.told else ""
    match place.kind:
        case "dot":
            return element("circle", said, cx=x, cy=y, r=2.2, class_=f"f{place.colour}")
        case "cross":
            return element("path", said, d=f"M{x - 2:.1f} {y - 2:.1f}l4 4m0 -4l-4 4", class_="line s6 thin")
        case "disc":
            return element("circle", said, cx=x, cy=y, r=6.0, class_=f"f{place.colour} rim")
        case "here":
            return element("circle", said, cx=x, cy=y, r=9.0, class_="here")
        case _:
            turns = np.arange(10) * np.pi / 5 - np.pi / 2
            radii = np.where(np.arange(10) % 2, 4.0, 10.0)
            corners = np.column_stack([x + radii * np.cos(turns), y + radii * np.sin(turns)])
            return element("polygon", said, points=points(corners), class_="star")


def _x_axis(
    scale: Scale,
    y: float,
    title: str,
    written: Callable[[float], str],
    ticks: Sequence[float] | None = None,
) -> str:
    room = abs(scale.last - scale.first)
    chosen = list(ticks) if ticks is not None else scale.ticks(max(2, int(room / 62.0)))
    marks = [element("line", x1=scale.first, x2=scale.last, y1=y, y2=y, class_="axis")]
    for value in chosen:
        x = scale.at(value)
        marks.append(element("line", x1=x, x2=x, y1=y, y2=y + 4.0, class_="axis"))
        marks.append(text(written(value), x, y + 16.0, class_="tick", text_anchor="middle"))
    middle = 0.5 * (scale.first + scale.last)
    half = 0.5 * 5.6 * len(title)
    middle = min(max(middle, half), WIDTH - half) if scale.last <= WIDTH and half < WIDTH / 2 else middle
    marks.append(text(title, middle, y + 32.0, class_="name", text_anchor="middle"))
    return "".join(marks)


def _y_axis(scale: Scale, x: float, right: float, title: str, beside: bool = False) -> str:
    marks = []
    for value in scale.ticks(4):
        y = scale.at(value)
        marks.append(element("line", x1=x, x2=right, y1=y, y2=y, class_="grid"))
        marks.append(text(short(value), x - 6.0, y + 4.0, class_="tick", text_anchor="end"))
    middle = 0.5 * (scale.first + scale.last)
    if beside:
        marks.append(
            text(title, 0.0, 0.0, class_="name", text_anchor="middle",
                 transform=f"translate(12 {middle:.0f}) rotate(-90)")
        )  # fmt: skip
    else:
        marks.append(text(title, 2.0, 12.0, class_="name"))
    return "".join(marks)


def _arrow(x: float, y: float, right: bool) -> str:
    way = 7 if right else -7
    return f"M{x - way / 2:.1f} {y - 5:.1f}l{way} 5l{-way} 5z"
