"""Figures of retrieval, training and improved plans: tables in, a matplotlib figure out, nothing else."""

from __future__ import annotations

from typing import Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator, PercentFormatter, StrMethodFormatter

from dashboards.figures.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    NOTE_SIZE,
    VERMILLION,
    message_figure,
    new_figure,
    planner_title,
    tidy,
)
from dashboards.statistics.panels import PLANNERS

COLUMNS: Final = 3  # of panels


def retrieval_curves(curve: pd.DataFrame) -> Figure:
    """Share of problems with a free plan among the first k, against k: a panel a class (and memory).

    ``curve`` is ``retrieval.retrieval_curve``'s.
    """
    title = "How often a recalled plan is free"
    if curve.empty:
        return message_figure(title, "No recall to show: build a memory first.")
    curve = curve[curve["recall"] == "centroid"]
    panels = list(curve[["panel", "memory"]].drop_duplicates().itertuples(index=False, name=None))
    note = (
        "fresh: new draws of the class; held-out: hallucinated problems kept from training.\n"
        "random: k plans picked blindly; oracle: any stored plan is free, the most that recall can reach."
    )
    columns = min(len(panels), COLUMNS)
    lines = -(-len(panels) // columns)
    figure = new_figure(max(5.6, 3.3 * columns + 0.5), 1.3 + 3.6 * lines, title, note)
    layout = figure.add_gridspec(1 + lines, columns, height_ratios=(1, *[9] * lines))
    most = int(curve["k"].max())
    for i, (panel, memory) in enumerate(_own_before_combined(panels)):
        axes = figure.add_subplot(layout[1 + i // columns, i % columns])
        rows = curve[(curve["panel"] == panel) & (curve["memory"] == memory)]
        for protocol, colour in (("held-out", BLUE), ("fresh", VERMILLION)):
            _retrieval(axes, rows[rows["protocol"] == protocol], colour)
        of = "" if memory == panel else f", memory {memory}"
        axes.set_title(f"{panel}\n{rows['plans'].max():,} plans{of}", fontsize=10, color=INK, pad=8)
        axes.set_xlabel("k, recalled plans", fontsize=9, color=INK)
        axes.set_xlim(0.5, max(2, most) + 0.5)
        axes.set_xticks([k for k in range(1, most + 1) if most <= 10 or k == 1 or k % 5 == 0])
        axes.set_ylim(0.0, 1.04)
        axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0, symbol=" %"))
        if i % columns == 0:
            axes.set_ylabel("problems with a free plan among k", fontsize=9, color=INK)
        tidy(axes)
    _retrieval_legend(figure.add_subplot(layout[0, :]), set(curve["protocol"]))
    return figure


def _own_before_combined(panels: list[tuple[str, str]]) -> list[tuple[str, str]]:
    return sorted(panels, key=lambda panel: panel[0] != panel[1])


def training_curves(epochs: pd.DataFrame) -> Figure:
    """Loss, and hit@k and oracle on held-out problems: columns ``epoch, loss, hit_1, hit_5, oracle``.

    A row an epoch, as ``planners.memory.encoder.training.Epoch``.
    """
    title = "Training of the encoder"
    if epochs.empty:
        return message_figure(title, "No epochs to show: train an encoder first.")
    figure = new_figure(8.4, 3.7, title)
    loss, hits = figure.subplots(1, 2)
    _epochs(loss, epochs, ["loss"])
    _epochs(hits, epochs, ["hit_1", "hit_5", "oracle"])
    loss.legend(loc="upper right", frameon=False, fontsize=9)
    hits.legend(loc="lower right", frameon=False, fontsize=9)
    loss.set_ylabel("loss", fontsize=9, color=INK)
    loss.set_ylim(bottom=min(0.0, loss.get_ylim()[0]))
    hits.set_ylabel("problems with a free plan among k", fontsize=9, color=INK)
    hits.set_ylim(0.0, 1.04)
    hits.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0, symbol=" %"))
    return figure


def anytime_curves(history: pd.DataFrame) -> Figure:
    """What improving a plan brings: mean driving time of the best plan against the time spent.

    Columns ``panel, planner, seconds, mean_s, low_s, high_s``: one row a moment from when all problems have a
    plan, mean and 95 % interval over all problems.
    """
    title = "Driving time of the best plan so far"
    if history.empty:
        return message_figure(title, "No history to show: improve some plans first.")
    panels = list(history["panel"].unique())
    note = (
        "Repeated searches, each for a plan that takes less time than the best so far. Mean over all "
        "problems, from when all have a plan; bands: 95 % bootstrap intervals."
    )
    figure = new_figure(max(5.6, 3.3 * len(panels) + 0.5), 3.9, title, note)
    for axes, panel in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        for planner, colour in zip(PLANNERS, (VERMILLION, BLUE, GREEN), strict=True):
            rows = history[(history["panel"] == panel) & (history["planner"] == planner)]
            axes.fill_between(
                rows["seconds"], rows["low_s"], rows["high_s"], color=colour, alpha=0.15, linewidth=0
            )
            axes.plot(rows["seconds"], rows["mean_s"], color=colour, label=planner_title(planner))
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_xlim(float(history["seconds"].min()), float(history["seconds"].max()))
        axes.set_title(panel, fontsize=10, color=INK, pad=8)
        axes.set_xlabel("time spent, s", fontsize=9, color=INK)
        tidy(axes)
    figure.axes[0].set_ylabel("mean driving time, s", fontsize=9, color=INK)
    figure.axes[0].legend(loc="upper right", frameon=False, fontsize=9)
    return figure


def _retrieval(axes: Axes, rows: pd.DataFrame, colour: str) -> None:
    """Hit@k, the random curve and the oracle of one protocol."""
    if rows.empty:
        return
    axes.plot(rows["k"], rows["hit"], "o-", color=colour, linewidth=1.8, markersize=3.5)
    axes.plot(rows["k"], rows["random"], ":", color=colour, linewidth=1.4)
    axes.axhline(rows["oracle"].iloc[0], color=colour, linewidth=1.2, linestyle=(0, (5, 2)))


def _retrieval_legend(axes: Axes, protocols: set[str]) -> None:
    """A column a curve, a line a protocol, in a strip of its own: the panels have no free corner."""
    axes.set_axis_off()
    shown = [each for each in (("held-out", BLUE), ("fresh", VERMILLION)) if each[0] in protocols]
    curves = (("hit@k", "o-", 1.8), ("random", ":", 1.4), ("oracle", "--", 1.2))
    for name, style, linewidth in curves:
        for protocol, colour in shown:
            axes.plot(
                [], [], style, color=colour, linewidth=linewidth, markersize=3.5, label=f"{name}, {protocol}"
            )
    axes.legend(loc="center left", ncols=3, frameon=False, fontsize=NOTE_SIZE + 0.5, borderaxespad=0.0)


def _epochs(axes: Axes, epochs: pd.DataFrame, columns: list[str]) -> None:
    """The named columns against the epoch."""
    for name, colour in zip(columns, (VERMILLION, BLUE, GREY), strict=False):
        values = epochs[name].to_numpy(dtype=np.float64)
        axes.plot(
            epochs["epoch"],
            values,
            "o-",
            color=colour,
            linewidth=1.6,
            markersize=3.5,
            label=name.replace("_", "@"),
        )
    axes.set_xlabel("epoch", fontsize=9, color=INK)
    axes.xaxis.set_major_locator(MaxNLocator(8, integer=True, min_n_ticks=1))
    tidy(axes)
