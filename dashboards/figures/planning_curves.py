"""Curves of planning: with growing experience, solved against time, profiles."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from dashboards.figures.style import (
    NO_ATTEMPTS,
    in_percent,
    logarithmic,
    message_figure,
    planner_grid,
)
from dashboards.palette import INK, colour_of
from storage.tables.configurations import BASELINE, Configuration, configurations_in


def continual_improvement(summary: pd.DataFrame) -> Figure:
    """Mean planning time against the number of experiences: a row a planner, a column a class.

    Args:
        summary: table of ``panels.summarise_continual``.
    """
    title = "Mean planning time as experience grows"
    if summary.empty:
        return message_figure(title, "No runs of growing experience to show: make them first.")
    note = (
        "The whole pipeline was run anew for each number of experiences and measured on the same problems. "
        "Bands: 95 % bootstrap intervals of the mean over problems."
    )

    def draw(axes: Axes, rows: pd.DataFrame, style: dict[str, Any]) -> None:
        rows = rows.sort_values("experiences")
        x, low, high = (rows[name] for name in ("experiences", "mean_low_ms", "mean_high_ms"))
        axes.fill_between(x, low, high, color=style["color"], alpha=0.18, linewidth=0)
        axes.plot(x, rows["mean_ms"], marker="o", markersize=3.5, **style)

    def finish(axes: Axes) -> None:
        axes.set_xticks(sorted(summary["experiences"].unique()))
        axes.set_ylim(bottom=0.0)
        axes.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]))

    shown = summary.drop(columns="problems")  # the same for all panels
    return _curves(shown, title, note, "experiences", "mean planning time, ms", draw, finish)


def solved_against_time(curve: pd.DataFrame) -> Figure:
    """Share of all problems solved within a time.

    Args:
        curve: table of ``distributions.solved_against_time``.
    """
    title = "Problems solved within a time"
    note = "Share of all problems. A failure never counts as solved, however long it took."
    return _shares(curve, title, note, "ms", "planning time, ms")


def performance_profile(curve: pd.DataFrame) -> Figure:
    """Share of problems solved within multiples of the fastest time.

    Args:
        curve: table of ``distributions.performance_profile``.
    """
    title = "Performance profile"
    note = (
        "Share of problems solved within a multiple of the time of whatever was fastest on the same problem "
        "with the same planner (Dolan and Moré 2002). At 1: how often a configuration is the fastest."
    )
    return _shares(curve, title, note, "ratio", "times the fastest")


def _shares(curve: pd.DataFrame, title: str, note: str, x: str, label: str) -> Figure:
    if curve.empty:
        return message_figure(title, NO_ATTEMPTS)

    def draw(axes: Axes, rows: pd.DataFrame, style: dict[str, Any]) -> None:
        axes.step(rows[x], rows["solved"], where="post", **style)

    def finish(axes: Axes) -> None:
        logarithmic(axes)
        axes.set_ylim(0.0, 1.03)
        in_percent(axes.yaxis)

    return _curves(curve, title, note, label, "problems solved", draw, finish)


def _curves(
    table: pd.DataFrame, title: str, note: str, x: str, y: str,
    draw: Callable[[Axes, pd.DataFrame, dict[str, Any]], None],
    finish: Callable[[Axes], None],
) -> Figure:  # fmt: skip
    """A row a planner, a column a class; ``draw`` draws each curve, ``finish`` sets each panel's axes."""

    def draw_panel(axes: Axes, _: str, of_panel: pd.DataFrame) -> None:
        for configuration in configurations_in(of_panel):
            same = of_panel[list(configuration._fields)] == list(configuration)
            draw(axes, of_panel[same.all(axis=1)], _style(configuration))
        finish(axes)

    entries = {each.label: Line2D([], [], **_style(each)) for each in configurations_in(table)}
    return planner_grid(table, title, note, draw_panel, x=x, y=y, entries=entries)


def _style(configuration: Configuration) -> dict[str, Any]:
    """Dashed if the encoder alone recalled, dotted for a fresh guide; dots tell blind picks apart."""
    if configuration.assist == "fresh":
        return {"color": INK, "linestyle": ":", "linewidth": 1.5}  # yellow lines are too pale
    dashes: Any = (0, (5, 1.5)) if configuration.recall == "encoder" else "-"
    if configuration.recall == "random":
        dashes = "-." if configuration.assist == "random-repair" else "-" if configuration.top_k > 1 else ":"
    width = 2.2 if configuration == BASELINE else 1.5
    return {"color": colour_of(configuration), "linestyle": dashes, "linewidth": width}
