"""How every figure looks, and how it is saved: titles, axes, panels, notes, files."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import LogLocator, NullLocator, PercentFormatter, StrMethodFormatter

from dashboards.cells import planner_title
from dashboards.palette import GREY, INK, PALE
from dashboards.statistics.panels import PLANNERS, ranked
from storage.places.files import whole_file

NO_ATTEMPTS: Final = "No attempts to show: run the benchmark first."
PANEL_WIDTH: Final = 2.6  # inches: four panels across a page stay readable in print
_NOTE_SIZE: Final = 8.0
_LEGEND_SHARE: Final = 0.98  # of a figure's width, that legends may take with what is empty beside them
_LEGEND_SIZE: Final = 8.5
_LEGEND_LINE: Final = 0.55  # inches of an entry beside its label
_LEGEND_HEIGHT: Final = 0.2  # inches of a line of entries
_LEGEND_LETTER: Final = 0.075  # inches
_DPI: Final = 160
_TITLE_LETTERS_AN_INCH: Final = 8.8  # bold, at the size of a title
_NOTE_LETTERS_AN_INCH: Final = 16.5  # at _NOTE_SIZE, with room to spare

# Identifiers in an SVG are drawn from this instead of the clock: the same rows give the same file.
matplotlib.rcParams["svg.hashsalt"] = "motion-memory"
# A figure without a layout of its own has none, whatever the user's settings are.
matplotlib.rcParams.update({"figure.autolayout": False, "figure.constrained_layout.use": False})


def new_figure(width: float, height: float, title: str, note: str = "") -> Figure:
    """An empty figure of ``width`` by ``height`` inches with a ``title`` above and a ``note`` below, wrapped.

    It belongs to no window system and no global list of figures, so any thread may draw it.
    """
    layout = ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.08, wspace=0.03, hspace=0.05)
    figure = Figure(figsize=(width, height), layout=layout, facecolor="white")
    title = textwrap.fill(title, int(_TITLE_LETTERS_AN_INCH * (width - 0.2)))
    figure.suptitle(title, x=0.012, ha="left", fontsize=13, fontweight="bold", color=INK)
    if note:
        letters = int(_NOTE_LETTERS_AN_INCH * (width - 0.2))
        note = note.replace(" %", "\N{NO-BREAK SPACE}%")
        note = "\n".join(textwrap.fill(paragraph, letters) for paragraph in note.splitlines())
        figure.supxlabel(note, x=0.012, ha="left", fontsize=_NOTE_SIZE, color="#555555", linespacing=1.4)
    return figure


def message_figure(title: str, message: str) -> Figure:
    """A figure with a ``title`` and a ``message`` that says why there is nothing to draw."""
    figure = new_figure(8.0, 2.4, title)
    axes = figure.add_subplot()
    axes.set_axis_off()
    axes.text(0.5, 0.5, message, ha="center", va="center", fontsize=11, color=INK, transform=axes.transAxes)
    return figure


def planner_grid(
    table: pd.DataFrame,
    title: str,
    note: str,
    draw: Callable[[Axes, str, pd.DataFrame], None],
    *,
    x: str = "",
    y: str = "",
    size: tuple[float, float] = (PANEL_WIDTH, 1.9),
    entries: Mapping[str, Any] | None = None,
) -> Figure:
    """A figure with a row of panels for each planner and a column for each class.

    Args:
        table: rows with columns ``planner, panel``, and ``problems`` if panels are to say how many there are.
        title: title of the figure.
        note: text below it, wrapped.
        draw: draws a planner's rows of a class.
        x: name of the horizontal axes.
        y: name of the vertical axes.
        size: width and height of a panel, inches.
        entries: what a legend shows, by label.
    """
    planners, panels = ranked(table["planner"], PLANNERS), list(table["panel"].unique())
    width = max(5.6, size[0] * len(panels) + 0.6)
    figure = new_figure(width, size[1] * len(planners) + 1.5, title, note)
    if entries is None:
        grid = figure.subplots(len(planners), len(panels), squeeze=False)
    else:
        grid = _panels_below_legend(figure, len(planners), len(panels), entries)
    for i, planner in enumerate(planners):
        for j, panel in enumerate(panels):
            of_panel = table[table["panel"] == panel]
            count = f"\n{of_panel['problems'].max():,} problems" if "problems" in table else ""
            draw(grid[i, j], planner, of_panel[of_panel["planner"] == planner])
            name = planner_title(planner) + (f"\n{y}" if y else "")
            tidy(
                grid[i, j],
                title=f"{panel}{count}" if i == 0 else "",
                x=x if i == len(planners) - 1 else "",
                y=name if j == 0 else "",
            )
            grid[i, j].tick_params(labelsize=8)
    return figure


def panel_row(panels: Sequence[str], title: str, note: str) -> tuple[Figure, list[Axes]]:
    """A figure with a ``title`` and ``note`` and a row of square panels, and the axes of these."""
    figure = new_figure(max(5.6, 3.3 * len(panels) + 0.5), 3.9, title, note)
    return figure, list(figure.subplots(1, len(panels), squeeze=False)[0])


def tidy(axes: Axes, title: str = "", x: str = "", y: str = "") -> None:
    """Quiet axes without a box, pale horizontal lines behind the data, with a title and names of x and y."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(GREY)
    axes.tick_params(labelsize=9, colors=INK, length=3)
    axes.grid(axis="y", color=PALE, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.set_title(title, fontsize=10, color=INK, pad=8)
    axes.set_xlabel(x, fontsize=9, color=INK)
    axes.set_ylabel(y, fontsize=9, color=INK)


def in_percent(axis: Axis) -> None:
    """Write the ticks of an ``axis`` of fractions in per cent."""
    axis.set_major_formatter(PercentFormatter(1.0, decimals=0, symbol=" %"))


def logarithmic(axes: Axes, steps: Sequence[float] = (1.0,)) -> None:
    """Make the x axis of ``axes`` logarithmic, with plain numbers at ``steps`` of each power of ten."""
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=steps, numticks=6))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))


def legend_below(figure: Figure, handles: Sequence[Any], columns: int) -> None:
    """A legend of ``handles`` at the lower edge of a ``figure``, in so many ``columns`` or as many as fit."""
    for count in range(columns, 0, -1):
        legend = figure.legend(
            handles=handles, loc="outside lower left", ncols=count, frameon=False, fontsize=_LEGEND_SIZE
        )
        if count == 1 or legend.get_window_extent().width <= _LEGEND_SHARE * figure.bbox.width:
            return
        legend.remove()


def legend_alone(axes: Axes, handles: Sequence[Any], labels: Sequence[str], columns: int) -> None:
    """A legend of ``handles`` and their ``labels`` that fills ``axes`` of its own."""
    axes.set_axis_off()
    axes.legend(
        handles,
        labels,
        loc="center left",
        ncols=columns,
        frameon=False,
        fontsize=_LEGEND_SIZE,
        borderaxespad=0.0,
    )


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write a ``figure`` as ``name.png`` (160 dots an inch) and ``name.svg`` into ``folder``.

    A file appears whole or not at all, and the same figure gives the same bytes.

    Returns both paths. Raises StorageError if there is no room or no permission to write.
    """
    figure.draw_without_rendering()
    # it was applied just now; that takes longer than drawing, and with any engine saving draws twice
    figure.set_layout_engine(None)
    paths = []
    for kind, metadata in (("png", {"Software": None}), ("svg", {"Date": None})):
        path = folder / f"{name}.{kind}"
        with whole_file(path) as temporary:
            figure.savefig(temporary, format=kind, dpi=_DPI, metadata=metadata)
        paths.append(path)
    return paths


def save_picture(figure: Figure, path: Path) -> None:
    """Save a ``figure`` in the format of the path's ending. Raises StorageError if it cannot be written."""
    with whole_file(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:], dpi=_DPI)


def _panels_below_legend(figure: Figure, rows: int, columns: int, entries: Mapping[str, Any]) -> Any:
    """Axes ``[rows, columns]`` below a legend of ``entries``, which adds to the figure's height."""
    widest = max(len(label) for label in entries)
    fit = max(1, int((figure.get_figwidth() - 0.8) / (_LEGEND_LINE + widest * _LEGEND_LETTER)))
    height, legend = figure.get_figheight(), _LEGEND_HEIGHT * math.ceil(len(entries) / fit)
    figure.set_figheight(height + legend)
    layout = figure.add_gridspec(rows + 1, columns, height_ratios=[legend * rows / height, *[1.0] * rows])
    legend_alone(figure.add_subplot(layout[0, :]), list(entries.values()), list(entries), fit)
    return np.array([[figure.add_subplot(layout[i + 1, j]) for j in range(columns)] for i in range(rows)])
