"""Curves of quality: how much longer plans drive than the best known, against the time for planning."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from scipy.optimize import isotonic_regression

from dashboards.figures.style import logarithmic, message_figure, new_figure, tidy

LEAST: Final = 1e-3  # share over the best known at which the axis ends
_GAP: Final = 0.045  # between two labels, of the axis
_LEADER: Final = {"arrowstyle": "-", "linewidth": 0.6, "shrinkA": 0, "shrinkB": 0, "relpos": (0.0, 0.5)}
_TICKS: Final = (1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0)


def quality_curves(curves: pd.DataFrame, title: str, colours: Mapping[str, str]) -> Figure:
    """Driving time over the best known against the time for planning, with a line and a label a way.

    Args:
        curves: columns ``method, kind, memory, ms, over``: the mean share over the best known after some
            time; ``memory`` is true for the ways with a memory, whose lines are bold.
        title: of the figure.
        colours: of the kinds.
    """
    if curves.empty:
        return message_figure(title, "No plans to show: measure some first.")
    note = (
        "Mean over all problems that any way solved. No plan yet, or one that takes more than twice as long "
        "as the best known, counts as 100 %. The clock counts everything from the obstacles to the plan."
    )
    figure = new_figure(8.4, 5.2, title, note)
    axes = figure.add_subplot()
    ends = {}
    for name, rows in curves.groupby("method", sort=False):
        colour, over = colours[rows["kind"].iloc[0]], rows["over"].clip(lower=LEAST)
        axes.plot(rows["ms"], over, color=colour, linewidth=2.4 if rows["memory"].iloc[0] else 1.4)
        ends[str(name)] = float(over.iloc[-1]), colour
    logarithmic(axes)
    axes.set_xlim(float(curves["ms"].min()), float(curves["ms"].max()))
    axes.set_yscale("log")
    axes.set_ylim(LEAST, 1.1)
    axes.yaxis.set_major_locator(FixedLocator(_TICKS))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda share, _: f"{100.0 * share:g} %"))
    tidy(axes, x="time for planning, ms", y="driving time over the best known")
    _label(axes, ends)
    return figure


def _label(axes: Axes, ends: Mapping[str, tuple[float, str]]) -> None:
    """Name each line at its end on the right, with room between names."""
    names = sorted(ends, key=lambda name: ends[name][0])
    span = np.log(axes.get_ylim()[1] / axes.get_ylim()[0])
    heights = np.array([np.log(ends[name][0] / axes.get_ylim()[0]) / span for name in names])
    room = _GAP * np.arange(len(heights))
    apart = isotonic_regression(heights - room).x + room  # as near to the ends of the lines as room allows
    for name, end, height in zip(names, heights, apart, strict=True):
        colour = ends[name][1]
        axes.annotate(
            name,
            (1.0, float(end)),
            (1.05, float(height)),
            xycoords="axes fraction",
            textcoords="axes fraction",
            va="center",
            fontsize=8.5,
            color=colour,
            annotation_clip=False,
            arrowprops=_LEADER | {"color": colour},
        )
