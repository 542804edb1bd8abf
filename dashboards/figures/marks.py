"""Small marks of pictures: arrows along a drive, and the bar that says how long a metre is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from matplotlib.axes import Axes
from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar

from dashboards.palette import INK
from dashboards.world_outlines import scale_bar, travel_arrows
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import Vehicle

_TIP_M: Final = 1e-3  # between root and tip, so that of an arrow only the head is seen


def draw_travel_arrows(
    axes: Axes,
    plan: Plan,
    vehicle: Vehicle,
    colours: Mapping[int, str],
    apart: float | None = None,
    size: float = 11.0,
    scale: float = 1.0,
) -> None:
    """Draw heads of arrows where ``vehicle`` travels along ``plan``, in the colour of the gear, 1 or -1.

    ``apart`` and ``scale`` are those of ``travel_arrows``, ``size`` is that of the heads, in points.
    """
    for x, y, ahead, aside, gear in travel_arrows(plan, vehicle, apart, scale).tolist():
        style = {"arrowstyle": "-|>", "color": colours[int(gear)], "linewidth": 0.0, "mutation_scale": size}
        tip = (x + _TIP_M * ahead, y + _TIP_M * aside)
        axes.annotate("", tip, (x, y), arrowprops=style | {"shrinkA": 0.0, "shrinkB": 0.0}, zorder=6.6)


def draw_scale_bar(axes: Axes, problem: Problem) -> None:
    """Draw below the right end of the bounds of a ``problem`` how long some real metres are."""
    bounds, (metres, shown) = problem.bounds, scale_bar(problem)
    axes.add_artist(
        AnchoredSizeBar(
            axes.transData, shown, f"{metres:g} m", "upper right", pad=0.0, borderpad=0.3, sep=2.0,
            frameon=False, color=INK, size_vertical=0.0, fontproperties={"size": 8.0},
            bbox_to_anchor=(bounds[2], bounds[1]), bbox_transform=axes.transData,
        )
    )  # fmt: skip
