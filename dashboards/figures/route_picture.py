"""A route as a picture: the map around it, the shortest way, and the legs, coloured by where they came from.

On a map a vehicle is a few dots, so of goals that are poses there are close-ups of how it gets in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from dashboards.figures.manoeuvre_picture import BACKWARDS, draw_manoeuvre, manoeuvre_legend
from dashboards.figures.map_picture import cells_legend
from dashboards.figures.map_view import (
    CLOSE_UP_LENGTHS,
    OCCUPIED,
    draw_ends,
    figure_over,
    placed,
    view_around,
)
from dashboards.figures.marks import draw_travel_arrows
from dashboards.figures.pictures import draw_problem
from dashboards.figures.style import legend_below
from dashboards.palette import BLUE, GREEN, INK, ORANGE, VERMILLION
from dashboards.world_outlines import whole_length_m
from planners.maps.occupancy_map import OccupancyMap
from planners.routes.legs import Leg
from planners.routes.path_ahead import Stop
from planners.routes.route import Route
from planners.world.alignment import Alignment, from_canonical
from planners.world.arrays import Floats
from planners.world.driving_cost import cusps_of, gears_of
from planners.world.problem import Plan, Problem, obstacles_of
from planners.world.vehicles.vehicle import CAR, Vehicle

COLOURS: Final = {"kept": GREEN, "recalled": BLUE, "repaired": ORANGE, "searched": VERMILLION}
_CUSP_LENGTHS: Final = 5.0  # of the vehicle: a last change of gear so near a goal is shown close up
_APART: Final = 0.1  # of the longer side of what is shown: arrows along the drive
_CLOSE_UP_ENTRIES: Final = [
    Patch(facecolor=INK, label="the vehicle where a close-up begins"),
    Patch(facecolor="none", edgecolor=ORANGE, linewidth=1.4, label="goal pose"),
]


def route_picture(
    world: OccupancyMap,
    route: Route,
    stops: Sequence[Stop],
    scale: float,
    caption: str,
    vehicle: Vehicle = CAR,
) -> Figure:
    """A figure of a map in its own frame and a route over it.

    Args:
        world: the map, in metres.
        route: the route, in canonical metres.
        stops: the goals, in canonical metres.
        scale: metres of the map in a canonical metre.
        caption: text above the map.
        vehicle: the vehicle that drives the route.
    """
    driven = [(leg, leg.states(vehicle)) for leg in route.legs]
    ends = np.array([route.problem.start[:2], *(stop.place for stop in stops)])
    view = view_around(world, [ends, *route.paths, *(states[:, :2] for _, states in driven)], scale, vehicle)
    arrivals = _arrivals(world, route, stops, scale, vehicle)
    figure, axes, beside = figure_over(world, view, len(arrivals), f"Route over {world.name}", caption)
    for (name, problem, plan), close_up in zip(arrivals, beside, strict=True):
        draw_problem(close_up, problem, vehicle, OCCUPIED)
        draw_manoeuvre(close_up, plan, vehicle)
        close_up.set_title(name, fontsize=9, color=INK, loc="left", pad=4)
    for path in route.paths:
        axes.plot(*placed(world, scale * path).T, color=INK, linewidth=0.9, linestyle=(0, (2, 2)), zorder=3)
    shown, backs = _draw_legs(axes, world, driven, scale, vehicle, view.longest)
    handles = [
        *draw_ends(axes, world, route.problem.start, route.problem.start_motion, stops, scale, view.longest),
        *shown,
        Line2D([], [], color=INK, linewidth=0.9, linestyle=(0, (2, 2)), label="shortest way over the cells"),
        *cells_legend(world, OCCUPIED),
    ]
    manoeuvres = manoeuvre_legend([(plan, vehicle) for _, _, plan in arrivals]) if arrivals else []
    if backs and "backwards" not in [entry.get_label() for entry in manoeuvres]:
        handles.append(Line2D([], [], color=BACKWARDS, linewidth=2.6, label="backwards"))
    handles += [*_CLOSE_UP_ENTRIES, *manoeuvres] if arrivals else []
    legend_below(figure, handles, 4)
    return figure


def _draw_legs(
    axes: Axes,
    world: OccupancyMap,
    driven: Sequence[tuple[Leg, Floats]],
    scale: float,
    vehicle: Vehicle,
    longest: float,
) -> tuple[list[Line2D | Patch], bool]:
    """Draw legs and their states; returns what a legend says of them, and whether one leads backwards."""
    sources, backs = [], False
    for leg, states in driven:
        points = placed(world, scale * states[:, :2])
        last = leg.driving
        for drawn, colour, linewidth, zorder in (
            (points[: last + 1], COLOURS[leg.source], 2.6, 5),
            (points[last:], INK, 1.6, 6),
        ):
            axes.plot(*drawn.T, color="white", linewidth=linewidth + 1.6, zorder=4)
            axes.plot(*drawn.T, color=colour, linewidth=linewidth, zorder=zorder, solid_capstyle="butt")
        axes.plot(*points[-1], marker="o", color="white", markeredgecolor=INK, markersize=3.5, zorder=7)
        way = Plan(np.column_stack([points, states[:, 2:]]), leg.controls)
        steps = np.stack([points[:-1], points[1:]], axis=1)[gears_of(way, vehicle) < 0]
        axes.add_collection(LineCollection(list(steps), color=BACKWARDS, linewidth=2.6, zorder=6))
        backs = backs or len(steps) > 0
        colours = {1: COLOURS[leg.source], -1: BACKWARDS}
        draw_travel_arrows(axes, way, vehicle, colours, _APART * longest, 17.0, scale)
        sources.append(leg.source)
    brakes = any(leg.driving < len(leg.controls) for leg, _ in driven)
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=colour, linewidth=2.6, label=_legend_of(source, sources.count(source)))
        for source, colour in COLOURS.items()
        if source in sources
    ]
    if brakes or len(sources) > 1:
        label = "brakes, or the next leg begins" if brakes else "the next leg begins"
        mark = Line2D([], [], color=INK, marker="o", markerfacecolor="white", linewidth=1.6, markersize=4.5)
        mark.set_label(label)
        handles.append(mark)
    return handles, backs


def _arrivals(
    world: OccupancyMap, route: Route, stops: Sequence[Stop], scale: float, vehicle: Vehicle
) -> list[tuple[str, Problem, Plan]]:
    """Of goals that are poses a title, what is around, and the last part of the drive there.

    All is turned as the map's frame is, in canonical metres.
    """
    length = whole_length_m(vehicle)
    (left, bottom, turn), arrivals = world.origin, list[tuple[str, Problem, Plan]]()
    frame = Alignment((left / scale, bottom / scale), -turn)
    drives = zip(stops, route.problems, route.plans(vehicle), strict=True)
    for number, (stop, problem, driven) in enumerate(drives, start=1):
        if not stop.is_pose:
            continue
        plan = from_canonical(driven, frame)
        goal = placed(world, scale * np.array([stop.place]))[0] / scale
        off = np.abs(plan.states[:, :2] - goal).max(axis=1)
        cusps = off[cusps_of(plan, vehicle)[-1:]]
        near = max([0.0, *cusps[cusps < _CUSP_LENGTHS * length].tolist()])
        reach = max(CLOSE_UP_LENGTHS * length, near + 1.2 * length)
        outside = off > reach - length
        first = int(np.flatnonzero(outside)[-1]) + 1 if outside[:-1].any() else 0
        last = Plan(plan.states[first:], plan.controls[first:], plan.dt)
        bounds = (*(goal - reach).tolist(), *(goal + reach).tolist())
        pieces = (placed(world, scale * piece) / scale for piece in problem.obstacles.pieces())
        around = [piece for piece in pieces if (piece.max(axis=0) > bounds[:2]).all()
                  and (piece.min(axis=0) < bounds[2:]).all()]  # fmt: skip
        x, y, heading, _, *others = last.states[0].tolist()
        shown = replace(
            problem,
            start=(x, y, heading),
            start_motion=(0.0, *others),  # no arrow for its speed
            goal=tuple(goal.tolist()),
            arrival=stop.arrival._replace(heading=(stop.arrival.heading or 0.0) + turn),
            bounds=bounds,
            obstacles=obstacles_of([around]),
            scale=scale,
        )
        title = f"into goal {number}" if len(stops) > 1 else "into the goal"
        arrivals.append((title, shown, last))
    return arrivals


def _legend_of(source: str, legs: int) -> str:
    return f"{source}, {legs} leg" + "s" * (legs > 1)
