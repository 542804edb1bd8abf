"""What of a map is shown around a route, with its start and goals, and room for close-ups below."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch

from dashboards.figures.map_picture import draw_map
from dashboards.figures.style import new_figure
from dashboards.figures.views import View, view_of
from dashboards.palette import GREEN, INK
from planners.maps.occupancy_map import OccupancyMap
from planners.routes.path_ahead import Stop
from planners.world.arrays import Floats, Pose
from planners.world.vehicles.vehicle import Vehicle

OCCUPIED: Final = "#C9CDD3"  # paler than elsewhere, so that the legs stand out
CLOSE_UP_LENGTHS: Final = 2.5  # of the vehicle to each side of the place
_WIDTH: Final = 7.4  # inches
_TALLEST: Final = 9.0  # inches
_CLOSE_UPS: Final = 3  # side by side, at most
_AROUND: Final = 2.5  # lengths of the vehicle around what is driven, at least
_SEEN: Final = 0.018  # of the longer side of what is shown: smaller discs lie under the mark of the goal
_DISC: Final[dict[str, Any]] = {"facecolor": "#DDF2E9", "edgecolor": GREEN, "linewidth": 0.8}
_ARROW: Final = 0.05  # of the longer side of what is shown: the arrow of a heading


def view_around(world: OccupancyMap, places: Sequence[Floats], scale: float, vehicle: Vehicle) -> View:
    """What of a map lies around all ``places [n, 2]``, which are in canonical metres."""
    width, height = world.size
    corners = np.array([world.pose(x, y, 0.0)[:2] for x in (0.0, width) for y in (0.0, height)])
    whole = (*corners.min(axis=0).tolist(), *corners.max(axis=0).tolist())
    return view_of([placed(world, scale * np.concatenate(places))], whole, vehicle, _AROUND, scale)


def figure_over(
    world: OccupancyMap, view: View, close_ups: int, title: str, caption: str
) -> tuple[Figure, Axes, list[Axes]]:
    """A figure with what is shown of the map, and below it axes for so many close-ups."""
    columns = min(max(close_ups, 2), _CLOSE_UPS)
    rows, side = math.ceil(close_ups / columns), _WIDTH / columns
    tall = min(_WIDTH * (view.top - view.bottom) / (view.right - view.left), _TALLEST)
    figure = new_figure(_WIDTH, tall + rows * side + 0.9, title)
    grid = figure.add_gridspec(1 + rows, columns, height_ratios=[tall, *[side] * rows])
    axes = figure.add_subplot(grid[0, :])
    draw_map(axes, world, OCCUPIED)
    axes.set_xlim(view.left, view.right)
    axes.set_ylim(view.bottom, view.top)
    axes.set_title(caption, fontsize=9, color=INK, loc="left", pad=6)
    beside = [figure.add_subplot(grid[1 + k // columns, k % columns]) for k in range(close_ups)]
    return figure, axes, beside


def draw_ends(
    axes: Axes,
    world: OccupancyMap,
    start: Pose,
    motion: tuple[float, ...],
    stops: Sequence[Stop],
    scale: float,
    longest: float,
) -> list[Line2D | Patch]:
    """Draw the start and the goals that are on the map; returns what a legend says of them.

    Args:
        axes: where to draw, in metres of the map's frame.
        world: the map.
        start: of the route, in canonical metres.
        motion: the state at the start behind the pose, speed first, in canonical metres.
        stops: the goals, in canonical metres.
        scale: metres of the map in a canonical metre.
        longest: the longer side of what is shown.
    """
    several, discs, goals = len(stops) > 1, False, 0
    for number, stop in enumerate(stops, start=1):
        right, up = stop.place
        x, y, heading = world.pose(scale * right, scale * up, stop.arrival.heading or 0.0)
        goal = (x, y)
        if not axes.viewLim.contains(x, y):
            continue  # off the map: marks that are not clipped would shrink everything else
        goals += 1
        if stop.is_pose:
            _draw_heading(axes, goal, heading, GREEN, longest)
        elif scale * stop.radius > _SEEN * longest:
            axes.add_patch(Circle(goal, scale * stop.radius, **_DISC, zorder=3.5))
            discs = True
        axes.plot(
            *goal,
            marker="o" if several else "*",
            color=GREEN,
            markeredgecolor=INK,
            markersize=13 if several else 15,
            zorder=10,
            clip_on=False,
        )
        if several:
            axes.annotate(f"{number}", goal, ha="center", va="center_baseline", color="white", zorder=11,
                          fontsize=9, fontweight="bold", annotation_clip=False)  # fmt: skip
    x, y, heading = world.pose(scale * start[0], scale * start[1], start[2])
    axes.plot(x, y, marker="o", color=INK, markersize=6, zorder=9)
    _draw_heading(axes, (x, y), heading, INK, longest)
    speed = scale * motion[0] if motion else 0.0
    moving = f", {'backwards ' if speed < 0.0 else ''}at {abs(speed):.3g} m/s" if speed else ""
    return [
        Line2D([], [], color=INK, marker="o", linestyle="none", markersize=6, label=f"start{moving}"),
        *[Line2D([], [], color=GREEN, marker="o" if several else "*", markeredgecolor=INK, linestyle="none",
                 markersize=10, label="goals in order" if several else "goal")] * (goals > 0),
        *[Patch(**_DISC, label="where it may stop")] * discs,
    ]  # fmt: skip


def _draw_heading(
    axes: Axes, place: tuple[float, float], heading: float, colour: str, longest: float
) -> None:
    """An arrow from a ``place`` on a map along a heading."""
    reach = _ARROW * longest
    tip = place[0] + reach * math.cos(heading), place[1] + reach * math.sin(heading)
    arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.6, "shrinkA": 0.0}
    axes.annotate("", tip, place, arrowprops=arrow, zorder=9, annotation_clip=True, clip_on=True)


def placed(world: OccupancyMap, points: Floats) -> Floats:
    """``points [n, 2]`` in grid metres, in the map's frame."""
    left, bottom, turn = world.origin
    cos, sin = math.cos(turn), math.sin(turn)
    placed: Floats = points @ np.array([[cos, sin], [-sin, cos]]) + (left, bottom)
    return placed
