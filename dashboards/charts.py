"""Figures of planning times, retrieval and training: tables in, a matplotlib figure out, nothing else."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator, PercentFormatter, StrMethodFormatter

from dashboards.statistics import PLANNERS, ranked
from dashboards.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    NOTE_SIZE,
    ORANGE,
    SKY,
    VERMILLION,
    YELLOW,
    message_figure,
    new_figure,
    tidy,
)

PLANNING_TIME_NOTE: Final = (
    "Planning time is everything from receiving the obstacles to returning a plan: drawing the grid, "
    "encoding, recall, checking recalled plans, the planner's own structures, search. One problem at a time, "
    "one thread, compiled code warm. Failures keep their time."
)
CONTROLS_NOTE: Final = (
    "closed, open, repair: with the recall that is best for the memory, and as many plans as said. enc.: "
    "with what the encoder recalls alone, as in the paper. fresh guide, a control: no memory, the planner is "
    "led along a way over the occupancy grid."
)
PLANNER_TITLES: Final = {"rrt": "RRT", "gust": "GUST", "follow": "Follow"}

_ENCODER: Final = "centroid"
_BARS: Final = {  # assist, whether the encoder alone recalled, top k
    ("none", False, 0): ("none", GREY),
    ("closed", False, 5): ("closed\n5", BLUE),
    ("open", False, 5): ("open\n5", VERMILLION),
    ("repair", False, 5): ("repair\n5", GREEN),
    ("closed", True, 1): ("enc.\nclosed\n1", SKY),
    ("closed", True, 5): ("enc.\nclosed\n5", SKY),
    ("open", True, 1): ("enc.\nopen\n1", ORANGE),
    ("open", True, 5): ("enc.\nopen\n5", ORANGE),
    ("fresh", False, 0): ("fresh\nguide", YELLOW),
}


def planning_times(summary: pd.DataFrame) -> Figure:
    """Mean planning time alone, with the memory and its best recall, with the encoder's, and a control.

    A row a planner, a column a class.
    ``summary`` is ``statistics.summarise``'s. Whiskers are its 95 % intervals; each bar but the baseline's
    carries the change of the mean against the baseline, and the baseline's its time.
    """
    title = "Mean planning time with and without memory"
    if summary.empty:
        return message_figure(title, "No attempts to show: run the benchmark first.")
    planners = ranked(summary["planner"], PLANNERS)
    panels = list(summary["panel"].unique())
    whiskers = "Whiskers: 95 % bootstrap intervals of the mean, problems resampled."
    note = f"{PLANNING_TIME_NOTE}\n{CONTROLS_NOTE}\n{whiskers}"
    figure = new_figure(max(5.6, 4.3 * len(panels) + 0.5), 2.3 * len(planners) + 1.5, title, note)
    grid = figure.subplots(len(planners), len(panels), squeeze=False)
    for i, planner in enumerate(planners):
        for j, panel in enumerate(panels):
            _bars(grid[i, j], summary[(summary["planner"] == planner) & (summary["panel"] == panel)])
            if i == 0:
                count = summary.loc[summary["panel"] == panel, "problems"].max()
                grid[i, j].set_title(f"{panel}\n{count:,} problems", fontsize=10, color=INK, pad=8)
        name = PLANNER_TITLES.get(planner, planner)
        grid[i, 0].set_ylabel(f"{name}\nmean planning time, ms", fontsize=9, color=INK)
    return figure


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
    figure = new_figure(max(5.6, 3.3 * len(panels) + 0.5), 4.9, title, note)
    layout = figure.add_gridspec(2, len(panels), height_ratios=(1, 9))
    most = int(curve["k"].max())
    for i, (panel, memory) in enumerate(panels):
        axes = figure.add_subplot(layout[1, i])
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
        if i == 0:
            axes.set_ylabel("problems with a free plan among k", fontsize=9, color=INK)
        tidy(axes)
    _retrieval_legend(figure.add_subplot(layout[0, :]), set(curve["protocol"]))
    return figure


def training_curves(epochs: pd.DataFrame) -> Figure:
    """Loss, and hit@k and oracle on held-out problems: columns ``epoch, loss, hit_1, hit_5, oracle``.

    A row an epoch, as ``planners.memory.training.Epoch``.
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
            axes.plot(
                rows["seconds"], rows["mean_s"], color=colour, label=PLANNER_TITLES.get(planner, planner)
            )
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


def _bars(axes: Axes, rows: pd.DataFrame) -> None:
    """The bars of one panel; a configuration without attempts is said to be missing."""
    by_key = {
        (row["assist"], row["recall"] == _ENCODER, int(row["top_k"])): row for _, row in rows.iterrows()
    }
    top = max((by_key[key]["mean_high_ms"] for key in _BARS if key in by_key), default=1.0)
    axes.set_ylim(0.0, 1.22 * top)
    for x, (key, (_, colour)) in enumerate(_BARS.items()):
        if key not in by_key:
            axes.text(x, 0.04 * top, "no attempts", rotation=90, ha="center", fontsize=8, color=GREY)
            continue
        mean, low, high = (
            float(by_key[key][column]) for column in ("mean_ms", "mean_low_ms", "mean_high_ms")
        )
        reduction = float(by_key[key]["reduction"])
        axes.bar(x, mean, width=0.72, color=colour)
        axes.errorbar(x, mean, [[mean - low], [high - mean]], color=INK, linewidth=1.0, capsize=2.5)
        axes.annotate(
            _duration(mean) if key == ("none", False, 0) else _change(reduction),
            (x, high),
            (0, 4),
            textcoords="offset points",
            ha="center",
            fontsize=8.5,
            color=INK,
            fontweight="bold" if reduction < 0.0 else "normal",  # slower than without memory stands out
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5},
        )
    axes.set_xticks(range(len(_BARS)), [label for label, _ in _BARS.values()])
    axes.set_xlim(-0.7, len(_BARS) - 0.4)
    axes.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:,.6g}"))
    tidy(axes)
    axes.tick_params(axis="x", length=0, labelsize=8.5)


def _duration(milliseconds: float) -> str:
    """Three digits in the unit that suits them: 83.4 µs, 4.90 ms, 1.26 s."""
    units = (("s", 1e3), ("ms", 1.0), ("µs", 1e-3))
    unit, size = next((each for each in units if milliseconds >= each[1]), units[-1])
    value = milliseconds / size
    decimals = 2 if value <= 0.0 else max(0, 2 - math.floor(math.log10(value)))
    return f"{value:.{min(2, decimals)}f} {unit}"


def _change(reduction: float) -> str:
    """What a bar says of its mean against the baseline's: −61 %, −98.9 %, +15 %; a dash without baseline."""
    if math.isnan(reduction):
        return "–"
    decimals = 1 if reduction > 0.97 else 0
    return f"{-100.0 * reduction:+.{decimals}f} %".replace("-", "−")


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
