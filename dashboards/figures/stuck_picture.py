"""Where a route over a map ends too early, as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon

from dashboards.figures.map_picture import cells_legend, draw_map
from dashboards.figures.map_view import (
    CLOSE_UP_LENGTHS,
    OCCUPIED,
    draw_ends,
    figure_over,
    placed,
    view_around,
)
from dashboards.figures.style import legend_below
from dashboards.palette import GREEN, INK, VERMILLION
from dashboards.world_outlines import asked_pose, outlines, whole_length_m
from planners.maps.occupancy_map import OccupancyMap
from planners.routes.path_ahead import AT_REST, Stop
from planners.routes.stuck import Stuck
from planners.world.arrays import Floats, Point, Pose
from planners.world.vehicles.vehicle import CAR, Vehicle, trailers_of

_CROSS: Final[dict[str, Any]] = {
    "marker": "X", "color": VERMILLION, "markeredgecolor": "white", "linestyle": "none"
}  # fmt: skip
_GAP: Final[dict[str, Any]] = {
    "marker": "D", "color": "none", "markeredgecolor": VERMILLION, "markeredgewidth": 1.6, "linestyle": "none"
}  # fmt: skip
_STANDING: Final = 1.5  # of a vehicle that stands there, to each side of the cross
_BEYOND: Final = "#e6e6e6"  # the map: nobody may drive there


def stuck_picture(
    world: OccupancyMap,
    start: Pose,
    stops: Sequence[Stop],
    stuck: Stuck,
    scale: float,
    vehicle: Vehicle = CAR,
    motion: tuple[float, ...] = (),
) -> Figure:
    """A figure of a map in its own frame and where a route over it ends too early.

    Close up it shows what is around that place, if it is on the map. If it is the start or a goal pose, the
    vehicle stands there, and where it would be free, if that is near.

    Args:
        world: the map, in metres.
        start: of the route, in canonical metres.
        stops: the goals, in canonical metres.
        stuck: why there is no route, and where.
        scale: metres of the map in a canonical metre.
        vehicle: the vehicle that was to drive.
        motion: the state at the start behind the pose, speed first, in canonical metres.
    """
    places = np.array([start[:2], stuck.place, *(stop.place for stop in stops)])
    view = view_around(world, [places], scale, vehicle)
    x, y, _ = world.pose(scale * stuck.place[0], scale * stuck.place[1], 0.0)
    is_on_map = world.holds(scale * stuck.place[0], scale * stuck.place[1])
    figure, axes, close_ups = figure_over(
        world,
        view,
        int(is_on_map),
        f"No route over {world.name}",
        stuck.told(world, scale).replace("; ", ";\n"),
    )
    handles = draw_ends(axes, world, start, motion, stops, scale, view.longest)
    for close_up in close_ups:
        axes.plot(x, y, **_CROSS, markersize=11, zorder=12)
        told = "no way out was found" if stuck.is_enclosed else "stuck here"
        handles.append(Line2D([], [], **_CROSS, markersize=9, label=told))
        if stuck.gap is not None:
            right, up = stuck.gap.place
            right, up, _ = world.pose(scale * right, scale * up, 0.0)
            for each in (axes, close_up):
                each.plot(right, up, **_GAP, markersize=9, zorder=11)
            handles.append(Line2D([], [], **_GAP, markersize=8, label="narrowest place of the widest way"))
        standing = _standing_at(stuck.place, start, stops, vehicle)
        lengths, shown_as = (CLOSE_UP_LENGTHS, vehicle) if standing is None else (_STANDING, standing[1])
        reach = lengths * scale * whole_length_m(shown_as)
        draw_map(close_up, world, OCCUPIED)
        close_up.set_xlim(x - reach, x + reach)
        close_up.set_ylim(y - reach, y + reach)
        close_up.set_facecolor(_BEYOND)
        edges = [world.pose(right, up, 0.0)[:2] for right, up in _corners(world)]
        close_up.add_patch(Polygon(edges, facecolor="white", zorder=0.5))
        close_up.set_title("what is around the cross", fontsize=9, color=INK, loc="left", pad=4)
        if standing is None:
            close_up.plot(x, y, **_CROSS, markersize=11, zorder=12)
        else:
            states, driver = standing
            stands = [(stuck.place, VERMILLION, "where the vehicle would stand")]
            stands += [] if stuck.free is None else [(stuck.free, GREEN, "where it would be free")]
            for place, colour, label in stands:
                there = states.copy()
                there[:, :2] += np.subtract(place, stuck.place)
                shown = [placed(world, scale * body) for body in outlines(there, driver)[0]]
                close_up.add_collection(
                    PolyCollection(shown, facecolor="none", edgecolor=colour, linewidth=1.4, zorder=5)
                )
                handles.append(Patch(facecolor="none", edgecolor=colour, label=label))
    handles += cells_legend(world, OCCUPIED)
    legend_below(figure, handles, 4)
    return figure


def _corners(world: OccupancyMap) -> list[Point]:
    """The corners of a map in grid metres, one after another."""
    width, height = world.size
    return [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)]


def _standing_at(
    place: Point, start: Pose, stops: Sequence[Stop], vehicle: Vehicle
) -> tuple[Floats, Vehicle] | None:
    """Who stands at a place, as ``asked_pose``: at the start or in a goal pose; None if neither is there."""
    straight = (0.0,) * len(trailers_of(vehicle))
    arrivals = [AT_REST._replace(heading=start[2], hitches=straight)] if place == start[:2] else []
    arrivals += [stop.arrival for stop in stops if stop.place == place]
    return asked_pose(place, arrivals[0], vehicle) if arrivals else None
