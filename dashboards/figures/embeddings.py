"""What an encoder learned, as a picture: problems where their embeddings lie, coloured by their plan."""

from __future__ import annotations

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dashboards.figures.style import BLUE, GREEN, INK, ORANGE, PURPLE, SKY, VERMILLION, YELLOW, new_figure
from planners.world.arrays import Floats, Floats32, Integers

COLOURS: Final = (VERMILLION, BLUE, GREEN, ORANGE, SKY, PURPLE, YELLOW)
_OTHERS: Final = "#D4D4D4"


def embedding_map(embeddings: Floats32, plan_index: Integers, centroids: Floats32) -> Figure:
    """Embeddings ``[n, D]`` on their two principal axes, and the centroids ``[N + 1, D]``.

    ``plan_index [n]``: the plan a problem was made for, -1 for none. As many plans as there are colours are
    coloured, spread over all; the others are pale. Row 0 of the centroids is ``c_0``.
    """
    middle, axes_of = principal_axes(embeddings)
    places = (embeddings - middle) @ axes_of.T
    known = np.isfinite(centroids[:, 0])
    means = (np.where(known[:, np.newaxis], centroids, 0.0) - middle) @ axes_of.T
    share = np.square(places).sum() / np.square(embeddings - middle).sum()
    coloured = np.linspace(0, len(centroids) - 2, min(len(COLOURS), len(centroids) - 1)).astype(int)
    note = (
        f"Held-out problems on the two axes along which they differ most ({100 * share:.0f} % of all "
        f"variance). Dots: problems, those made for {len(coloured)} of {len(centroids) - 1} plans in colour; "
        "crosses: problems made for no plan. Discs: centroids of the same plans; star: c_0."
    )
    figure = new_figure(6.4, 6.4, "Embedding map", note)
    axes = figure.add_subplot()
    _problems(axes, places, plan_index, coloured)
    for plan, colour in zip(coloured, COLOURS, strict=False):
        axes.plot(*means[plan + 1], "o", color=colour, markersize=11, markeredgecolor=INK, zorder=3)
    if known[0]:
        axes.plot(*means[0], "*", color=INK, markersize=15, markeredgecolor="white", zorder=4)
    for edges, values in ((axes.set_xlim, places[:, 0]), (axes.set_ylim, places[:, 1])):
        low, high = np.percentile(values, [0.5, 99.5])
        edges(low - 0.08 * (high - low), high + 0.08 * (high - low))
    axes.set_xlabel("first principal axis", fontsize=9, color=INK)
    axes.set_ylabel("second principal axis", fontsize=9, color=INK)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=9, colors=INK, length=3)
    return figure


def principal_axes(values: Floats32) -> tuple[Floats, Floats]:
    """Mean ``[D]`` and the two axes ``[2, D]`` of greatest variance of values ``[n, D]``, each of length 1.

    The sign is chosen so that an axis' largest number is positive.
    """
    middle = values.mean(0, dtype=np.float64)
    _, _, axes = np.linalg.svd(values - middle, full_matrices=False)
    largest = np.take_along_axis(axes, np.abs(axes).argmax(1)[:, np.newaxis], axis=1)
    return middle, (axes * np.sign(largest))[:2]


def _problems(axes: Axes, places: Floats, plan_index: Integers, coloured: Integers) -> None:
    none = plan_index < 0
    others = ~none & ~np.isin(plan_index, coloured)
    axes.scatter(places[others, 0], places[others, 1], s=4, color=_OTHERS, linewidths=0, rasterized=True)
    axes.scatter(
        places[none, 0], places[none, 1], s=9, marker="x", color="#9A9A9A", linewidths=0.5, rasterized=True
    )
    for plan, colour in zip(coloured, COLOURS, strict=False):
        own = places[plan_index == plan]
        axes.scatter(own[:, 0], own[:, 1], s=12, color=colour, linewidths=0, zorder=2)
