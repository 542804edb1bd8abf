"""Bars: mean planning times with and without memory, with intervals; tables in, a matplotlib figure out."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Final

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, StrMethodFormatter

from dashboards.figures.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PALE,
    PURPLE,
    SKY,
    VERMILLION,
    YELLOW,
    message_figure,
    new_figure,
    panels_below_legend,
    planner_title,
    tidy,
)
from dashboards.statistics.distributions import PARTS, REST
from dashboards.statistics.panels import PLANNERS, ranked
from storage.tables.configurations import BASELINE, Configuration

PLANNING_TIME_NOTE: Final = (
    "Planning time is everything from receiving the obstacles to returning a plan: drawing the grid, "
    "encoding, recall, checking recalled plans, the planner's own structures, search. One problem at a time, "
    "one thread, compiled code warm. Failures keep their time."
)
PAPER_BARS: Final = (("none", 0), ("closed", 1), ("closed", 5), ("open", 1), ("open", 5))
PANEL_WIDTH: Final = 2.6  # inches: four panels across a page stay readable in print
_WHISKERS: Final = "Whiskers: 95 % bootstrap intervals of the mean, problems resampled."
_CONTROLS_NOTE: Final = (
    "closed, open, repair: with the best recalled plans (their number, and what recalled them: exh., "
    "all plans are checked; mask, by the cells that they sweep; centroid, the encoder). fresh, a control: no "
    "memory, a way over the occupancy grid guides the planner."
)
_PARTS: Final = dict(
    zip(
        [*(part.name for part in PARTS), REST],
        (SKY, BLUE, PURPLE, GREY, YELLOW, GREEN, ORANGE, VERMILLION, PALE),
        strict=True,
    )
)


def planning_times(summary: pd.DataFrame) -> Figure:
    """The paper's panels: a row a planner, a column a class (and the combined memory), five bars each.

    ``summary`` is ``statistics.summarise``'s. Each bar but the baseline's carries the change of the mean
    against the baseline, and the baseline's its time.
    """
    title = "Mean planning time with and without memory"
    note = "closed, open: with the best or the five best plans that the encoder recalls."
    bars = paper_configurations(summary)
    return _panels_of_bars(summary, bars, title, f"{note} {_WHISKERS}\n{PLANNING_TIME_NOTE}")


def controls(summary: pd.DataFrame) -> Figure:
    """What the paper does not have: the recall that is best for the memory, repair, a fresh guide."""
    title = "Mean planning time with the best recall and repair, beside a control"
    paper = set(paper_configurations(summary)) - {BASELINE}
    bars = [each for each in _configurations(summary) if each not in paper and each.recall != "random"]
    return _panels_of_bars(summary, bars, title, f"{_CONTROLS_NOTE} {_WHISKERS}")


def ablation(summary: pd.DataFrame) -> Figure:
    """Plans picked blindly beside plans recalled, for the planners that both were measured for."""
    title = "Plans recalled or picked blindly"
    blind = summary[summary["recall"] == "random"]
    kept = summary[summary["planner"].isin(blind["planner"].unique())]
    picked = [each for each in _configurations(kept) if each.recall == "random"]
    like = [
        each for each in _configurations(kept)
        if any((f"random-{each.assist}", each.top_k) == (other.assist, other.top_k) for other in picked)
    ]  # fmt: skip
    shown = kept[kept["panel"].isin(blind["panel"].unique())]
    note = f"random: so many stored plans drawn blindly instead of recalled. {_WHISKERS}"
    return _panels_of_bars(shown, [BASELINE, *like, *picked] if picked else [], title, note)


def time_split(split: pd.DataFrame) -> Figure:
    """Where the mean planning time goes, stacked: a row a planner, a column a class.

    ``split`` is ``distributions.time_split``'s.
    """
    title = "Where planning time goes"
    if split.empty:
        return message_figure(title, "No attempts to show: run the benchmark first.")
    note = "rest: measured around everything, but in no part."
    planners, panels = ranked(split["planner"], PLANNERS), list(split["panel"].unique())
    width, height = max(5.6, PANEL_WIDTH * len(panels) + 1.2), 0.17 * split["configuration"].nunique() + 0.55
    figure = new_figure(width, height * len(planners) + 1.3, title, note)
    entries = {part: Patch(color=colour) for part, colour in _PARTS.items()}
    grid = panels_below_legend(figure, len(planners), len(panels), entries)
    for i, planner in enumerate(planners):
        for j, panel in enumerate(panels):
            of_planner = split[split["planner"] == planner]
            names = list(dict.fromkeys(of_planner["configuration"]))
            _stack(grid[i, j], of_planner[of_planner["panel"] == panel], names)
            grid[i, j].tick_params(axis="y", labelleft=j == 0)
            if i == 0:
                grid[i, j].set_title(panel, fontsize=10, color=INK, pad=6)
        grid[i, 0].set_ylabel(planner_title(planner), fontsize=9, color=INK)
    for axes in grid[-1]:
        axes.set_xlabel("mean planning time, ms", fontsize=9, color=INK)
    return figure


def paper_configurations(summary: pd.DataFrame) -> list[Configuration]:
    """The five configurations of the paper's panels: recalled by centroid, if anything is."""
    known = _configurations(summary)
    if any(each.recall == "centroid" for each in known):
        known = [each for each in known if each.recall in ("", "centroid")]
    found = [next((each for each in known if (each.assist, each.top_k) == bar), None) for bar in PAPER_BARS]
    return [
        each or Configuration(assist, "centroid" if k else "", k)
        for each, (assist, k) in zip(found, PAPER_BARS, strict=True)
    ]


def _configurations(table: pd.DataFrame) -> list[Configuration]:
    """The distinct configurations of a summary, in reading order."""
    if table.empty:
        return []
    found = table[["assist", "recall", "top_k"]].drop_duplicates().itertuples(index=False, name=None)
    return sorted((Configuration(*each) for each in found), key=lambda each: each.rank)


def _panels_of_bars(summary: pd.DataFrame, bars: Sequence[Configuration], title: str, note: str) -> Figure:
    if summary.empty or not bars:
        return message_figure(title, "No attempts to show: run the benchmark first.")
    planners, panels = ranked(summary["planner"], PLANNERS), list(summary["panel"].unique())
    panel_width = max(PANEL_WIDTH, 0.48 * len(bars) + 0.4)
    width = max(5.6, panel_width * len(panels) + 0.5)
    figure = new_figure(width, 1.9 * len(planners) + 1.5, title, note)
    grid = figure.subplots(len(planners), len(panels), squeeze=False)
    for i, planner in enumerate(planners):
        for j, panel in enumerate(panels):
            _bars(grid[i, j], summary[(summary["planner"] == planner) & (summary["panel"] == panel)], bars)
            if i == 0:
                count = summary.loc[summary["panel"] == panel, "problems"].max()
                grid[i, j].set_title(f"{panel}\n{count:,} problems", fontsize=10, color=INK, pad=8)
        grid[i, 0].set_ylabel(f"{planner_title(planner)}\nmean planning time, ms", fontsize=9, color=INK)
    return figure


def _bars(axes: Axes, rows: pd.DataFrame, bars: Sequence[Configuration]) -> None:
    """The bars of one panel; a configuration without attempts is said to be missing."""
    by_label = {row["configuration"]: row for _, row in rows.iterrows()}
    top = max((by_label[each.label]["mean_high_ms"] for each in bars if each.label in by_label), default=1.0)
    axes.set_ylim(0.0, 1.24 * top)
    for x, configuration in enumerate(bars):
        row = by_label.get(configuration.label)
        if row is None:
            axes.text(x, 0.04 * top, "no attempts", rotation=90, ha="center", fontsize=8, color=GREY)
            continue
        mean, low, high = (float(row[column]) for column in ("mean_ms", "mean_low_ms", "mean_high_ms"))
        reduction = float(row["reduction"])
        hatch = "///" if configuration.recall == "random" else None
        axes.bar(
            x, mean, width=0.72, color=colour_of(configuration), edgecolor="white", hatch=hatch, linewidth=0
        )
        axes.errorbar(x, mean, [[mean - low], [high - mean]], color=INK, linewidth=1.0, capsize=2.5)
        axes.annotate(
            _duration(mean) if configuration == BASELINE else _change(reduction),
            (x, high),
            (0, 3),
            textcoords="offset points",
            ha="center",
            fontsize=7.5,
            color=INK,
            fontweight="bold" if reduction < 0.0 else "normal",  # slower than without memory stands out
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.3},
        )
    axes.set_xticks(range(len(bars)), [_tick(each) for each in bars])
    axes.set_xlim(-0.7, len(bars) - 0.3)
    axes.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:,.6g}"))
    tidy(axes)
    axes.tick_params(axis="x", length=0, labelsize=7.5)
    axes.tick_params(axis="y", labelsize=8)


def colour_of(configuration: Configuration) -> str:
    """A colour for a configuration, the same in every figure; lighter with one recalled plan."""
    if configuration.recall == "random":
        return PURPLE
    colours = {
        "none": (GREY, GREY),
        "closed": (SKY, BLUE),
        "open": (ORANGE, VERMILLION),
        "repair": (GREEN, GREEN),
        "fresh": (YELLOW, YELLOW),
    }
    return colours.get(configuration.assist, (INK, INK))[configuration.top_k > 1]


def _stack(axes: Axes, rows: pd.DataFrame, names: list[str]) -> None:
    """One horizontal bar for each of the named configurations, a colour a part."""
    left = [0.0] * len(names)
    for part, colour in _PARTS.items():
        widths = (
            rows[rows["part"] == part].set_index("configuration")["ms"].reindex(names).fillna(0.0).tolist()
        )
        axes.barh(names, widths, left=left, height=0.74, color=colour)
        left = [start + width for start, width in zip(left, widths, strict=True)]
    tidy(axes)
    axes.invert_yaxis()
    axes.grid(axis="y", visible=False)
    axes.grid(axis="x", color=PALE, linewidth=0.8)
    axes.tick_params(axis="y", length=0, labelsize=8)
    axes.tick_params(axis="x", labelsize=8)


def _tick(configuration: Configuration) -> str:
    """A word a line; centroids go without saying."""
    label = configuration.label.removesuffix(" centroid").replace("exhaustive", "exh.")
    return re.sub("[ -]", "\n", label)


def _duration(milliseconds: float) -> str:
    """Three digits in the unit that suits them: 83.4 µs, 4.90 ms, 1.26 s."""
    units = (("s", 1e3), ("ms", 1.0), ("µs", 1e-3))
    unit, size = next((each for each in units if milliseconds >= each[1]), units[-1])
    value = milliseconds / size
    decimals = 2 if value <= 0.0 else max(0, 2 - math.floor(math.log10(value)))
    return f"{value:.{min(2, decimals)}f}\N{NARROW NO-BREAK SPACE}{unit}"


def _change(reduction: float) -> str:
    """What a bar says of its mean against the baseline's: −61 %, −99.4 %, +15 %; a dash without one."""
    if math.isnan(reduction):
        return "–"
    decimals = 1 if reduction > 0.99 else 0
    return f"{-100.0 * reduction:+.{decimals}f}\N{NARROW NO-BREAK SPACE}%".replace("-", "−")
