"""Curves of recall: in training, by the number of plans recalled, by the number of experiences."""

from __future__ import annotations

import math
from typing import Any, Final

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from dashboards.figures.style import in_percent, legend_alone, message_figure, new_figure, panel_row, tidy
from dashboards.palette import BLUE, GREY, VERMILLION

COLUMNS: Final = 3  # of panels
_PROTOCOLS: Final = {"held-out": BLUE, "fresh": VERMILLION}
_STYLES: Final[dict[str, Any]] = {  # of the curves of a protocol
    "hit@k": {"marker": "o", "linewidth": 1.8, "markersize": 3.5},
    "random": {"linestyle": ":", "linewidth": 1.4},
    "oracle": {"linestyle": (0, (5, 2)), "linewidth": 1.2},
}


def retrieval_curves(curve: pd.DataFrame) -> Figure:
    """Share of problems with a free plan among the first k, against k: a panel a class (and memory).

    Args:
        curve: table of ``retrieval_rates.retrieval_curve``.
    """
    title = "How often a recalled plan is free"
    if curve.empty:
        return message_figure(title, "No recall to show: build a memory first.")
    curve = curve[curve["recall"] == "encoder"]
    pairs = list(curve[["panel", "memory"]].drop_duplicates().itertuples(index=False, name=None))
    panels = sorted(
        pairs, key=lambda pair: pair[0] != pair[1]
    )  # a class's own memory before the combined one
    note = (
        "fresh: new draws of the class; held-out: hallucinated problems kept from training.\n"
        "random: k plans picked blindly; oracle: any stored plan is free, the most that recall can reach."
    )
    columns = min(len(panels), COLUMNS)
    lines = -(-len(panels) // columns)
    figure = new_figure(max(5.6, 3.3 * columns + 0.5), 1.3 + 3.6 * lines, title, note)
    layout = figure.add_gridspec(1 + lines, columns, height_ratios=(1, *[9] * lines))
    most = int(curve["k"].max())
    for i, (panel, memory) in enumerate(panels):
        axes = figure.add_subplot(layout[1 + i // columns, i % columns])
        rows = curve[(curve["panel"] == panel) & (curve["memory"] == memory)]
        for protocol, colour in _PROTOCOLS.items():
            _draw_protocol(axes, rows[rows["protocol"] == protocol], colour)
        axes.set_xlim(0.5, max(2, most) + 0.5)
        axes.set_xticks([k for k in range(1, most + 1) if most <= 10 or k == 1 or k % 5 == 0])
        axes.set_ylim(0.0, 1.04)
        in_percent(axes.yaxis)
        whose = "" if memory == panel else f", memory {memory}"
        y = "problems with a free plan among k" if i % columns == 0 else ""
        tidy(axes, f"{panel}\n{rows['plans'].max():,} plans{whose}", "k, recalled plans", y)
    shown = [protocol for protocol in _PROTOCOLS if protocol in set(curve["protocol"])]
    entries = {
        f"{name}, {protocol}": Line2D([], [], color=_PROTOCOLS[protocol], **style)
        for name, style in _STYLES.items()
        for protocol in shown
    }
    legend_alone(figure.add_subplot(layout[0, :]), list(entries.values()), list(entries), 3)
    return figure


def training_curves(epochs: pd.DataFrame) -> Figure:
    """The loss, and hit@k and oracle on held-out problems, epoch by epoch.

    Args:
        epochs: columns ``epoch, loss, hit_1, hit_5, oracle``, as ``planners.memory.encoder.training.Epoch``.
    """
    title = "Training of the encoder"
    if epochs.empty:
        return message_figure(title, "No epochs to show: train an encoder first.")
    figure = new_figure(8.4, 3.7, title)
    loss, hits = figure.subplots(1, 2)
    _draw_epochs(loss, epochs, ["loss"], "loss")
    _draw_epochs(hits, epochs, ["hit_1", "hit_5", "oracle"], "problems with a free plan among k")
    loss.legend(loc="upper right", frameon=False, fontsize=9)
    hits.legend(loc="lower right", frameon=False, fontsize=9)
    loss.set_ylim(bottom=min(0.0, loss.get_ylim()[0]))
    hits.set_ylim(0.0, 1.04)
    in_percent(hits.yaxis)
    return figure


def experience_chart(rows: pd.DataFrame) -> Figure:
    """Hit@5 with its interval, and the oracle, against the number of experiences: a panel a class.

    Args:
        rows: rows of ``experience_recall.experience_rows``, for several numbers of experiences.
    """
    panels = list(rows["panel"].unique())
    note = (
        "Share of new problems with a free plan among the first five recalled; whiskers: 95 % intervals. "
        "Each memory was made from its first stage on. Dashed: oracle, any stored plan is free."
    )
    figure, row = panel_row(panels, "Recall by number of experiences", note)
    bottom = max(0.0, math.floor(10.0 * rows["low"].min()) / 10.0)  # the same for all
    for axes, panel in zip(row, panels, strict=True):
        of_class = rows[rows["panel"] == panel].sort_values("plans")
        hit, plans = of_class["hit"].to_numpy(), of_class["plans"].to_numpy()
        errors = [hit - of_class["low"], of_class["high"] - hit]
        axes.plot(plans, of_class["oracle"], "--", color=GREY, linewidth=1.2)
        axes.errorbar(plans, hit, errors, fmt="o-", color=BLUE, linewidth=1.6, markersize=4, capsize=3)
        axes.set_xticks(plans)
        axes.set_ylim(bottom, 1.0 + 0.04 * (1.0 - bottom))
        in_percent(axes.yaxis)
        tidy(axes, panel, "experiences")
    return figure


def _draw_protocol(axes: Axes, rows: pd.DataFrame, colour: str) -> None:
    """Hit@k, the random curve and the oracle of one protocol."""
    if len(rows):
        axes.plot(rows["k"], rows["hit"], color=colour, **_STYLES["hit@k"])
        axes.plot(rows["k"], rows["random"], color=colour, **_STYLES["random"])
        axes.axhline(rows["oracle"].iloc[0], color=colour, **_STYLES["oracle"])


def _draw_epochs(axes: Axes, epochs: pd.DataFrame, columns: list[str], y: str) -> None:
    """The named columns against the epoch."""
    for name, colour in zip(columns, (VERMILLION, BLUE, GREY), strict=False):
        label = name.replace("_", "@")
        axes.plot(
            epochs["epoch"], epochs[name], "o-", color=colour, linewidth=1.6, markersize=3.5, label=label
        )
    axes.xaxis.set_major_locator(MaxNLocator(8, integer=True, min_n_ticks=1))
    tidy(axes, x="epoch", y=y)
