"""What memories of more and more experiences recall in fresh problems: rows, a table, a chart."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter
from rich import box
from rich.table import Table

from dashboards.figures.style import BLUE, GREY, INK, new_figure, tidy
from dashboards.statistics.panels import PANELS, ranked

WIDTH: Final = 1.96  # standard errors on either side of a mean: a 95 % interval
K: Final = 5


def experience_rows(recalls: pd.DataFrame) -> pd.DataFrame:
    """One row a class, from the fresh recall rows of one number of experiences, ranked by the encoder.

    Columns ``panel, plans, problems, seeds, hit, low, high, oracle``: ``hit`` is the share of problems with a
    free plan among the first five, the mean over training seeds; ``low`` and ``high`` its 95 % interval over
    problems; ``oracle`` the share with any free plan.
    """
    rows = []
    asked = recalls[(recalls["recall"] == "centroid") & (recalls["protocol"] == "fresh")]
    for panel in ranked(asked["class"], PANELS):
        of_class = asked[asked["class"] == panel]
        free = np.stack(list(of_class["free"]))
        orders = np.stack(list(of_class["order"]))[:, :K].astype(np.intp)
        hits = pd.Series(np.take_along_axis(free, orders, axis=1).any(axis=1), dtype=float)
        by_problem = hits.groupby(of_class["problem_id"].to_numpy()).mean()
        error = WIDTH * by_problem.std(ddof=0) / np.sqrt(len(by_problem))
        hit = by_problem.mean()
        rows.append(
            {
                "panel": panel,
                "plans": free.shape[1],
                "problems": len(by_problem),
                "seeds": of_class["training_seed"].nunique(),
                "hit": hit,
                "low": max(0.0, hit - error),
                "high": min(1.0, hit + error),
                "oracle": free.any(axis=1).mean(),
            }
        )
    return pd.DataFrame(rows)


def experience_table(rows: pd.DataFrame) -> Table:
    """The rows for a terminal: a line a number of experiences, per class hit@5 [95 %] and oracle."""
    panels = list(rows["panel"].unique())
    table = Table(
        title="Fresh hit@5 [95 %] and oracle, % of problems", title_justify="left", box=box.SIMPLE_HEAD
    )
    for heading in ("experiences", *panels):
        table.add_column(heading, justify="right", no_wrap=True)
    for plans, of_count in rows.groupby("plans"):
        by_panel = of_count.set_index("panel")
        table.add_row(str(plans), *[_cell(by_panel.loc[panel]) for panel in panels])
    return table


def experience_chart(rows: pd.DataFrame) -> Figure:
    """Hit@5 with its interval, and the oracle, against the number of experiences: a panel a class."""
    panels = list(rows["panel"].unique())
    note = (
        "New problems of the class with a free plan among the first five recalled; whiskers: 95 % intervals. "
        "Each memory was made from its first stage on. Dashed: oracle, any stored plan is free."
    )
    figure = new_figure(max(5.6, 3.3 * len(panels) + 0.5), 3.9, "Recall by number of experiences", note)
    bottom = max(0.0, math.floor(10.0 * rows["low"].min()) / 10.0)  # the same for all
    for axes, panel in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        of_class = rows[rows["panel"] == panel].sort_values("plans")
        hit, plans = of_class["hit"].to_numpy(), of_class["plans"].to_numpy()
        errors = [hit - of_class["low"], of_class["high"] - hit]
        axes.plot(plans, of_class["oracle"], "--", color=GREY, linewidth=1.2)
        axes.errorbar(plans, hit, errors, fmt="o-", color=BLUE, linewidth=1.6, markersize=4, capsize=3)
        axes.set_title(panel, fontsize=10, color=INK, pad=8)
        axes.set_xlabel("experiences", fontsize=9, color=INK)
        axes.set_xticks(plans)
        axes.set_ylim(bottom, 1.0 + 0.04 * (1.0 - bottom))
        axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0, symbol=" %"))
        tidy(axes)
    return figure


def _cell(row: pd.Series[float]) -> str:
    hit, low, high, oracle = (100.0 * row[name] for name in ("hit", "low", "high", "oracle"))
    return f"{hit:.1f} [{low:.1f}, {high:.1f}] of {oracle:.1f}"
