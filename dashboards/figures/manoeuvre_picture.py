"""How a drive to a pose is drawn: its gears in colour, where they change, and what its bodies sweep."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path

from dashboards.figures.marks import draw_travel_arrows
from dashboards.palette import GREEN, INK, PURPLE, SKY
from dashboards.world_outlines import outlines
from planners.world.arrays import Floats
from planners.world.driving_cost import runs_of
from planners.world.problem import Plan
from planners.world.vehicles.vehicle import CAR, Vehicle

FORWARDS: Final = GREEN
BACKWARDS: Final = PURPLE
_SWEPT: Final = (SKY, 0.28)


def draw_manoeuvre(axes: Axes, plan: Plan, vehicle: Vehicle = CAR) -> None:
    """Draw the way of the reference point along ``plan``, with arrows, and what it sweeps.

    The ``vehicle`` is drawn at changes of gear and the end.
    """
    swept = PathPatch(_path_of(swept_by(plan.states, vehicle)), facecolor=_SWEPT, linewidth=0, zorder=2)
    axes.add_patch(swept)
    draw_way(axes, plan, vehicle, 6.5)
    for _, last, gear in runs_of(plan, vehicle):
        colour = FORWARDS if gear > 0 else BACKWARDS
        bodies, _ = outlines(plan.states[last : last + 1], vehicle)
        drawn = PolyCollection(bodies, facecolor="none", edgecolor=colour, linewidth=0.9, zorder=3)
        axes.add_collection(drawn)


def draw_way(axes: Axes, plan: Plan, vehicle: Vehicle = CAR, zorder: float = 4.0) -> None:
    """Draw the way of the reference point along ``plan`` in the colours of its gears, with arrows."""
    runs = runs_of(plan, vehicle)
    for first, last, gear in runs:
        colour = FORWARDS if gear > 0 else BACKWARDS
        axes.plot(*plan.states[first : last + 1, :2].T, color=colour, linewidth=1.8, zorder=zorder)
    draw_travel_arrows(axes, plan, vehicle, {1: FORWARDS, -1: BACKWARDS})
    cusps = [run.first for run in runs[1:]]
    axes.plot(
        *plan.states[cusps, :2].T, linestyle="none", marker="o", markersize=4, color="white",
        markeredgecolor=INK, markeredgewidth=1.0, zorder=zorder + 0.5,
    )  # fmt: skip


def swept_by(states: Floats, vehicle: Vehicle = CAR) -> shapely.Geometry:
    """The ground that the bodies of a ``vehicle`` sweep along ``states [T, S]``, in metres."""
    bodies, _ = outlines(states, vehicle)
    parts = len(bodies) // len(states)
    after = bodies[parts:] + bodies[-parts:]  # the same part one state later; at the last there it stays
    pairs = (np.concatenate(pair) for pair in zip(bodies, after, strict=True))
    return shapely.union_all([shapely.MultiPoint(corners).convex_hull for corners in pairs])


def _path_of(ground: shapely.Geometry) -> Path:
    """Polygons with holes as a path of Matplotlib's."""
    rings = [
        np.asarray(ring.coords)
        for polygon in shapely.get_parts(ground)
        for ring in (shapely.get_exterior_ring(shapely.normalize(polygon)), *polygon.interiors)
    ]
    return Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))


def manoeuvre_legend(drives: Sequence[tuple[Plan, Vehicle]]) -> list[Line2D | Patch]:
    """What ``draw_manoeuvre`` draws of these ``drives``, plans and who drives them."""
    return [*way_legend(drives), Patch(facecolor=_SWEPT, label="swept by its bodies")]


def way_legend(drives: Sequence[tuple[Plan, Vehicle]]) -> list[Line2D | Patch]:
    """What ``draw_way`` draws of these ``drives``, plans and who drives them."""
    each = [runs_of(plan, vehicle) for plan, vehicle in drives]
    gears = {run.gear for runs in each for run in runs}
    changes = any(len(runs) > 1 for runs in each)
    shown: list[tuple[bool, Line2D | Patch]] = [
        (1 in gears, Line2D([], [], color=FORWARDS, linewidth=1.8, label="forwards")),
        (-1 in gears, Line2D([], [], color=BACKWARDS, linewidth=1.8, label="backwards")),
        (changes, Line2D([], [], color="white", marker="o", markeredgecolor=INK, markersize=5,
                         linestyle="none", label="change of gear")),
    ]  # fmt: skip
    return [entry for occurs, entry in shown if occurs]
