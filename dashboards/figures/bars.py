"""Bars: mean planning times with and without memory, and the parts they are made of."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from functools import partial
from typing import Final

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, StrMethodFormatter

from dashboards.cells import PLANNING_TIME
from dashboards.figures.style import NO_ATTEMPTS, PANEL_WIDTH, message_figure, planner_grid
from dashboards.palette import GREY, INK, PALE, TIME_COLOURS, colour_of
from storage.tables.configurations import BASELINE, Configuration, configurations_in

PAPER_BARS: Final = (("none", 0), ("closed", 1), ("closed", 5), ("open", 1), ("open", 5))
_WHISKERS: Final = "Whiskers: 95 % bootstrap intervals of the mean over problems."
_CONTROLS_NOTE: Final = (
    "closed, open, repair: with the best recalled plans. Labels say how many, and what recalled them: exh., "
    "all plans are checked; mask, by the cells that they sweep; encoder, by the encoder. fresh is a control: "
    "without memory, a way over the occupancy grid guides the planner."
)


def planning_times(summary: pd.DataFrame) -> Figure:
    """The paper's panels: a row a planner, a column a class (and the combined memory), five bars each.

    Args:
        summary: table of ``panels.summarise``. The baseline's bar carries its time, each other bar the change
            of the mean against the baseline.
    """
    title = "Mean planning time with and without memory"
    note = "closed, open: with the best or the five best plans that the encoder recalls."
    bars = paper_configurations(summary)
    return _panels_of_bars(summary, bars, title, f"{note} {_WHISKERS}\n{PLANNING_TIME}")


def controls(summary: pd.DataFrame) -> Figure:
    """What the paper does not have: the recall that suits the memory best, repair, a fresh guide.

    Args:
        summary: table of ``panels.summarise``.
    """
    title = "Mean planning time with the best recall and repair, beside a control"
    paper = set(paper_configurations(summary)) - {BASELINE}
    bars = [each for each in configurations_in(summary) if each not in paper and each.recall != "random"]
    return _panels_of_bars(summary, bars, title, f"{_CONTROLS_NOTE} {_WHISKERS}")


def ablation(summary: pd.DataFrame) -> Figure:
    """Plans picked blindly beside plans recalled, for the planners that were measured with both.

    Args:
        summary: table of ``panels.summarise``.
    """
    title = "Plans recalled or picked blindly"
    blind = summary[summary["recall"] == "random"]
    kept = summary[summary["planner"].isin(blind["planner"].unique())]
    configurations = configurations_in(kept)
    picked = [each for each in configurations if each.recall == "random"]
    blind_keys = {(each.assist, each.top_k) for each in picked}
    alike = [each for each in configurations if (f"random-{each.assist}", each.top_k) in blind_keys]
    shown = kept[kept["panel"].isin(blind["panel"].unique())]
    note = f"random: as many stored plans, drawn blindly instead of recalled. {_WHISKERS}"
    return _panels_of_bars(shown, [BASELINE, *alike, *picked] if picked else [], title, note)


def time_split(split: pd.DataFrame) -> Figure:
    """Where the mean planning time goes: a row a planner, a column a class, a stacked bar a configuration.

    Args:
        split: table of ``distributions.time_split``.
    """
    title = "Where planning time goes"
    if split.empty:
        return message_figure(title, NO_ATTEMPTS)
    note = "rest: planning time that is in none of the parts."
    names = {
        planner: list(dict.fromkeys(rows["configuration"])) for planner, rows in split.groupby("planner")
    }
    height = 0.17 * split["configuration"].nunique() + 0.55
    figure = planner_grid(
        split, title, note, lambda axes, planner, rows: _stack(axes, rows, names[planner]),
        x="mean planning time, ms", size=(PANEL_WIDTH, height),
        entries={part: Patch(color=colour) for part, colour in TIME_COLOURS.items()},
    )  # fmt: skip
    columns = split["panel"].nunique()
    for i, axes in enumerate(figure.axes[1:]):  # after the legend
        axes.grid(axis="y", visible=False)
        axes.grid(axis="x", color=PALE, linewidth=0.8)
        axes.tick_params(axis="y", length=0, labelleft=i % columns == 0)
    return figure


def paper_configurations(summary: pd.DataFrame) -> list[Configuration]:
    """The five configurations of the paper's panels; recalled by the encoder, if any is.

    The bars of a run by the paper's method are those of its own open box.
    """
    measured = configurations_in(summary)
    if any(each.recall == "encoder" for each in measured):
        measured = [each for each in measured if each.recall in ("", "encoder")]
    by_bar = {(each.assist.removeprefix("published-"), each.top_k): each for each in reversed(measured)}
    return [
        by_bar.get((assist, k), Configuration(assist, "encoder" if k else "", k)) for assist, k in PAPER_BARS
    ]


def _panels_of_bars(summary: pd.DataFrame, bars: Sequence[Configuration], title: str, note: str) -> Figure:
    if summary.empty or not bars:
        return message_figure(title, NO_ATTEMPTS)
    size = (max(PANEL_WIDTH, 0.48 * len(bars) + 0.4), 1.9)
    figure = planner_grid(summary, title, note, partial(_bars, bars=bars), y="mean time, ms", size=size)
    for axes in figure.axes:
        axes.tick_params(axis="x", length=0, labelsize=7.5)
    return figure


def _bars(axes: Axes, _: str, rows: pd.DataFrame, bars: Sequence[Configuration]) -> None:
    """The bars of one panel; a configuration without attempts is said to be missing."""
    by_label = {row["configuration"]: row for row in rows.to_dict("records")}
    top = max((by_label[each.label]["mean_high_ms"] for each in bars if each.label in by_label), default=1.0)
    axes.set_ylim(0.0, 1.24 * top)
    for x, configuration in enumerate(bars):
        row = by_label.get(configuration.label)
        if row is None:
            axes.text(x, 0.04 * top, "no attempts", rotation=90, ha="center", fontsize=8, color=GREY)
            continue
        mean, low, high = row["mean_ms"], row["mean_low_ms"], row["mean_high_ms"]
        hatch = "///" if configuration.recall == "random" else None
        axes.bar(
            x, mean, width=0.72, color=colour_of(configuration), edgecolor="white", hatch=hatch, linewidth=0
        )
        axes.errorbar(x, mean, [[mean - low], [high - mean]], color=INK, linewidth=1.0, capsize=2.5)
        axes.annotate(
            _duration(mean) if configuration == BASELINE else _change(row["reduction"]),
            (x, high), (0, 3), textcoords="offset points", ha="center", fontsize=7.5, color=INK,
            fontweight="bold" if row["reduction"] < 0.0 else "normal",  # slower than without memory
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.3},
        )  # fmt: skip
    axes.set_xticks(range(len(bars)), [_tick(each) for each in bars])
    axes.set_xlim(-0.7, len(bars) - 0.3)
    axes.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:,.6g}"))


def _stack(axes: Axes, rows: pd.DataFrame, names: list[str]) -> None:
    """A horizontal bar for each of the named configurations, a colour a part."""
    left = [0.0] * len(names)
    for part, colour in TIME_COLOURS.items():
        of_part = rows[rows["part"] == part].set_index("configuration")["ms"]
        widths = of_part.reindex(names).fillna(0.0).tolist()
        axes.barh(names, widths, left=left, height=0.74, color=colour)
        left = [start + width for start, width in zip(left, widths, strict=True)]
    axes.invert_yaxis()


def _tick(configuration: Configuration) -> str:
    """The label of a configuration, a word a line; that the encoder recalled goes without saying."""
    label = configuration.label.removesuffix(" encoder")
    for long, short in (("exhaustive", "exh."), ("published", "publ.")):
        label = label.replace(long, short)
    return re.sub("[ -]", "\n", label)


def _duration(milliseconds: float) -> str:
    """Three digits in the unit that suits them: 83.4 µs, 4.90 ms, 1.26 s."""
    units = (("s", 1e3), ("ms", 1.0), ("µs", 1e-3))
    unit, size = next((each for each in units if milliseconds >= each[1]), units[-1])
    value = milliseconds / size
    decimals = 2 if value <= 0.0 else max(0, 2 - math.floor(math.log10(value)))
    return f"{value:.{min(2, decimals)}f}\N{NARROW NO-BREAK SPACE}{unit}"


def _change(reduction: float) -> str:
    """How far a mean lies from the baseline's: −61 %, −99.4 %, +15 %; a dash for NaN."""
    if math.isnan(reduction):
        return "–"
    decimals = 1 if reduction > 0.99 else 0
    return f"{-100.0 * reduction:+.{decimals}f}\N{NARROW NO-BREAK SPACE}%".replace("-", "−")
