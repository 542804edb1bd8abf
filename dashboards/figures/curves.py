"""Curves: growing experience, solved against time, performance profiles; tables in, figures out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator, PercentFormatter, StrMethodFormatter

from dashboards.figures.bars import PANEL_WIDTH, colour_of
from dashboards.figures.style import INK, message_figure, new_figure, panels_below_legend, planner_title, tidy
from dashboards.statistics.panels import PLANNERS, ranked
from storage.tables.configurations import BASELINE, Configuration


def continual_improvement(summary: pd.DataFrame) -> Figure:
    """Mean planning time against the number of experiences: a row a planner, a column a class.

    ``summary`` is ``statistics.summarise``'s with a column ``experiences``.
    """
    title = "Mean planning time as experience grows"
    if summary.empty:
        return message_figure(title, "No runs of growing experience to show: make them first.")
    note = (
        "The whole pipeline made anew with so many experiences, and measured on the same problems. "
        "Bands: 95 % bootstrap intervals of the mean, problems resampled."
    )

    def draw(axes: Axes, rows: pd.DataFrame, configuration: Configuration) -> None:
        rows = rows.sort_values("experiences")
        style = _style(configuration)
        axes.fill_between(
            rows["experiences"], rows["mean_low_ms"], rows["mean_high_ms"],
            color=style["color"], alpha=0.18, linewidth=0,
        )  # fmt: skip
        axes.plot(rows["experiences"], rows["mean_ms"], marker="o", markersize=3.5, **style)

    def finish(axes: Axes) -> None:
        axes.set_xticks(sorted(summary["experiences"].unique()))
        axes.set_ylim(bottom=0.0)
        axes.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]))

    return _grid(summary, title, note, "experiences", "mean planning time, ms", draw, finish)


def solved_against_time(curve: pd.DataFrame) -> Figure:
    """Share of all problems solved within a time; ``curve`` is ``distributions.solved_against_time``'s."""
    title = "Problems solved within a time"
    note = "Share of all problems. A failure is censored: it never counts as solved."
    return _reached(curve, title, note, "ms", "planning time, ms")


def performance_profile(curve: pd.DataFrame) -> Figure:
    """Share of problems solved within multiples of the fastest time, from the table of the same name."""
    title = "Performance profile"
    note = (
        "Share of problems solved within a multiple of the time of whatever was fastest on the same problem "
        "with the same planner (Dolan and Moré 2002). At 1: how often a configuration is the fastest."
    )
    return _reached(curve, title, note, "ratio", "times the fastest")


def _reached(curve: pd.DataFrame, title: str, note: str, x: str, label: str) -> Figure:
    if curve.empty:
        return message_figure(title, "No attempts to show: run the benchmark first.")

    def draw(axes: Axes, rows: pd.DataFrame, configuration: Configuration) -> None:
        axes.step(rows[x], rows["solved"], where="post", **_style(configuration))

    def finish(axes: Axes) -> None:
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(numticks=6))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.set_ylim(0.0, 1.03)
        axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0, symbol=" %"))

    return _grid(curve, title, note, label, "problems solved", draw, finish)


def _grid(
    table: pd.DataFrame, title: str, note: str, x: str, y: str,
    draw: Callable[[Axes, pd.DataFrame, Configuration], None],
    finish: Callable[[Axes], None],
) -> Figure:  # fmt: skip
    """A row a planner, a column a class; ``draw`` draws each curve, ``finish`` sets each panel's axes."""
    planners, panels = ranked(table["planner"], PLANNERS), list(table["panel"].unique())
    width = max(5.6, PANEL_WIDTH * len(panels) + 0.6)
    figure = new_figure(width, 1.9 * len(planners) + 1.5, title, note)
    known = table[["assist", "recall", "top_k"]].drop_duplicates().itertuples(index=False, name=None)
    configurations = sorted((Configuration(*each) for each in known), key=lambda each: each.rank)
    entries = {each.label: Line2D([], [], **_style(each)) for each in configurations}
    grid = panels_below_legend(figure, len(planners), len(panels), entries)
    for i, planner in enumerate(planners):
        for j, panel in enumerate(panels):
            axes = grid[i, j]
            of_panel = table[(table["planner"] == planner) & (table["panel"] == panel)]
            for key, rows in of_panel.groupby(["assist", "recall", "top_k"], sort=False):
                draw(axes, rows, Configuration(*key))
            if i == 0:
                axes.set_title(panel, fontsize=10, color=INK, pad=6)
            tidy(axes)
            finish(axes)
            axes.tick_params(labelsize=8)
        grid[i, 0].set_ylabel(f"{planner_title(planner)}\n{y}", fontsize=9, color=INK)
    for axes in grid[-1]:
        axes.set_xlabel(x, fontsize=9, color=INK)
    return figure


def _style(configuration: Configuration) -> dict[str, Any]:
    """Dashed where the encoder recalled alone, dotted without memory; blind ways are told apart by dots."""
    if configuration.assist == "fresh":
        return {"color": INK, "linestyle": ":", "linewidth": 1.5}  # yellow lines are too pale
    dashes: Any = (0, (5, 1.5)) if configuration.recall == "centroid" else "-"
    if configuration.recall == "random":
        dashes = "-." if configuration.assist == "random-repair" else "-" if configuration.top_k > 1 else ":"
    width = 2.2 if configuration == BASELINE else 1.5
    return {"color": colour_of(configuration), "linestyle": dashes, "linewidth": width}
