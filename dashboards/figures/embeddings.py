"""What an encoder learned, as a picture: problems where their embeddings lie, coloured by their plan."""

from __future__ import annotations

from typing import Final

import numpy as np
from matplotlib.figure import Figure

from dashboards.figures.style import new_figure, tidy
from dashboards.palette import INK, SERIES
from dashboards.statistics.embedding_plane import axis_ends, embedding_plane, spread_plans
from planners.world.arrays import Floats32, Integers

_OTHERS: Final = "#D4D4D4"
_NONE: Final = "#9A9A9A"


def embedding_map(embeddings: Floats32, plan_index: Integers, centroids: Floats32) -> Figure:
    """Problems and centroids on the two axes along which the embeddings differ most.

    Args:
        embeddings: ``[n, D]``, of problems.
        plan_index: ``[n]``, the plan that a problem was made for, -1 for none.
        centroids: ``[N + 1, D]``, of ``c_0``, the problems that no plan solves, and of the N plans.
    """
    plane = embedding_plane(embeddings)
    places, centres = plane.places(embeddings), plane.places(centroids)
    coloured = spread_plans(len(centroids) - 1, len(SERIES))
    note = (
        f"Held-out problems on the two axes along which they differ most ({100 * plane.share:.0f} % of all "
        f"variance). Dots: problems, those made for {len(coloured)} of {len(centroids) - 1} plans in colour; "
        "crosses: problems made for no plan. Discs: centroids of the same plans; star: c_0."
    )
    figure = new_figure(6.4, 6.4, "Embedding map", note)
    axes = figure.add_subplot()
    none = plan_index < 0
    others = places[~none & ~np.isin(plan_index, coloured)]
    axes.scatter(others[:, 0], others[:, 1], s=4, color=_OTHERS, linewidths=0, rasterized=True)
    axes.scatter(
        places[none, 0], places[none, 1], s=9, marker="x", color=_NONE, linewidths=0.5, rasterized=True
    )
    for plan, colour in zip(coloured, SERIES, strict=False):
        own = places[plan_index == plan]
        axes.scatter(own[:, 0], own[:, 1], s=12, color=colour, linewidths=0, zorder=2)
        axes.plot(*centres[plan + 1], "o", color=colour, markersize=11, markeredgecolor=INK, zorder=3)
    if np.isfinite(centres[0]).all():
        axes.plot(*centres[0], "*", color=INK, markersize=15, markeredgecolor="white", zorder=4)
    axes.set_xlim(axis_ends(places[:, 0]))
    axes.set_ylim(axis_ends(places[:, 1]))
    tidy(axes, x="first principal axis", y="second principal axis")
    axes.grid(visible=False)
    return figure
