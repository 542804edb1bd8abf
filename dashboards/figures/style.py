"""How every figure looks, and how it is saved: colours, axes, notes, files."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from storage.places.files import whole_file

# Okabe and Ito's colours, told apart with any colour vision.
SKY: Final = "#56B4E9"
BLUE: Final = "#0072B2"
ORANGE: Final = "#E69F00"
VERMILLION: Final = "#D55E00"
GREEN: Final = "#009E73"
PURPLE: Final = "#CC79A7"
YELLOW: Final = "#F0E442"
GREY: Final = "#8C8C8C"
INK: Final = "#333333"
PALE: Final = "#E4E4E4"

NOTE_SIZE: Final = 8.0
PLANNER_TITLES: Final = {"rrt": "RRT", "gust": "GUST", "follow": "Follow"}
_LEGEND_LINE: Final = 0.55  # inches of an entry beside its label
_LEGEND_HEIGHT: Final = 0.2  # inches of a line of entries
_LEGEND_LETTER: Final = 0.075  # inches
_DPI: Final = 160
_NOTE_LETTERS_AN_INCH: Final = 16.5  # at NOTE_SIZE, with room to spare

# Identifiers in an SVG are drawn from this instead of the clock: the same rows give the same file.
matplotlib.rcParams["svg.hashsalt"] = "motion-memory"


def planner_title(planner: str) -> str:
    """A planner's name as it is written."""
    return PLANNER_TITLES.get(planner, planner)


def new_figure(width: float, height: float, title: str, note: str = "") -> Figure:
    """An empty figure, size in inches, with a title above and a wrapped note below.

    It belongs to no window system and no global list of figures, so any thread may draw it.
    """
    figure = Figure(figsize=(width, height), layout="constrained", facecolor="white")
    figure.get_layout_engine().set(w_pad=0.08, h_pad=0.08, wspace=0.03, hspace=0.05)  # type: ignore[union-attr, call-arg]
    figure.suptitle(title, x=0.012, ha="left", fontsize=13, fontweight="bold", color=INK)
    if note:
        letters = int(_NOTE_LETTERS_AN_INCH * (width - 0.2))
        note = "\n".join(textwrap.fill(paragraph, letters) for paragraph in note.splitlines())
        figure.supxlabel(note, x=0.012, ha="left", fontsize=NOTE_SIZE, color="#555555", linespacing=1.4)
    return figure


def panels_below_legend(figure: Figure, rows: int, columns: int, entries: Mapping[str, Any]) -> Any:
    """Axes ``[rows, columns]`` below a legend of ``entries``, by label, which adds to the height."""
    widest = max(len(label) for label in entries)
    fit = max(1, int((figure.get_figwidth() - 0.8) / (_LEGEND_LINE + widest * _LEGEND_LETTER)))
    lines = math.ceil(len(entries) / fit)
    height = figure.get_figheight()
    strip = _LEGEND_HEIGHT * lines / (height / rows)
    figure.set_figheight(height + _LEGEND_HEIGHT * lines)
    layout = figure.add_gridspec(rows + 1, columns, height_ratios=[strip, *[1.0] * rows])
    legend = figure.add_subplot(layout[0, :])
    legend.set_axis_off()
    legend.legend(
        list(entries.values()), list(entries), loc="center left", ncols=fit, frameon=False,
        fontsize=NOTE_SIZE + 0.5, borderaxespad=0.0,
    )  # fmt: skip
    return np.array([[figure.add_subplot(layout[i + 1, j]) for j in range(columns)] for i in range(rows)])


def message_figure(title: str, message: str) -> Figure:
    """A figure that says in words why there is nothing to draw."""
    figure = new_figure(8.0, 2.4, title)
    axes = figure.add_subplot()
    axes.set_axis_off()
    axes.text(0.5, 0.5, message, ha="center", va="center", fontsize=11, color=INK, transform=axes.transAxes)
    return figure


def tidy(axes: Axes) -> None:
    """Quiet axes: a grid of pale horizontal lines behind the data, no box."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(GREY)
    axes.tick_params(labelsize=9, colors=INK, length=3)
    axes.grid(axis="y", color=PALE, linewidth=0.8)
    axes.set_axisbelow(True)


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write ``name.png`` (160 dots an inch) and ``name.svg`` into ``folder``; returns both paths.

    A file appears whole or not at all, and the same figure gives the same bytes. StorageError: no room, no
    permission.
    """
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # the layout is found: it takes longer than the drawing
    paths = []
    for kind, metadata in (("png", {"Software": None}), ("svg", {"Date": None})):
        path = folder / f"{name}.{kind}"
        with whole_file(path) as temporary:
            figure.savefig(temporary, format=kind, dpi=_DPI, metadata=metadata)
        paths.append(path)
    return paths
