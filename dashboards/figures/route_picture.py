"""A route as a picture: the map around it, the shortest way, and the legs, coloured by where they came from.

On a map a vehicle is a few dots, so of goals that are poses there are close-ups of how it gets in. Where no
route was found, the picture shows where it got stuck.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from dashboards.figures.manoeuvre_picture import BACKWARDS, draw_manoeuvre, manoeuvre_legend
from dashboards.figures.map_picture import draw_map
from dashboards.figures.marks import draw_travel_arrows
from dashboards.figures.pictures import draw_problem
from dashboards.figures.style import legend_below, new_figure
from dashboards.palette import BLUE, GREEN, INK, ORANGE, VERMILLION
from dashboards.world_outlines import asked_pose, footprint_spacing_m, gears_of, outlines
from planners.maps.occupancy_map import OccupancyMap
from planners.routes.path_ahead import AT_REST, Stop
from planners.routes.route import Route, Stuck
from planners.world.alignment import Alignment, from_canonical
from planners.world.arrays import Floats, Point, Pose
from planners.world.problem import Plan, Problem, obstacles_of
from planners.world.vehicles.vehicle import CAR, Vehicle

COLOURS: Final = {"recalled": BLUE, "repaired": ORANGE, "searched": VERMILLION}
_OCCUPIED: Final = "#C9CDD3"  # paler than elsewhere, so that the legs stand out
_WIDTH: Final = 7.4  # inches
_TALLEST: Final = 9.0  # inches
_MARGIN: Final = 0.15  # of the longer side of what is driven: what is shown around it ...
_AROUND: Final = 2.5  # ... and at least so many lengths of the vehicle
_MOST_OF_MAP: Final = 0.7  # of a side: if that is more, all of the side is shown
_ARROW: Final = 0.05  # of the longer side of what is shown: the arrow of a heading
_APART: Final = 0.1  # of it: arrows along the drive
_CLOSE_UPS: Final = 3  # side by side, at most
_LENGTHS: Final = 1.5  # of the vehicle to each side of the goal that a close-up shows
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
    places = [*route.paths, *(leg.states(vehicle)[:, :2] for leg in route.legs)]
    arrivals = _arrivals(world, route, stops, scale, vehicle)
    columns = min(max(len(arrivals), 2), _CLOSE_UPS)
    view = _view(world, [route.problem.start[:2]], stops, places, scale, vehicle)
    figure, axes, beside = _figure(world, view, len(arrivals), columns, f"Route over {world.name}", caption)
    for (name, problem, plan), close_up in zip(arrivals, beside, strict=True):
        draw_problem(close_up, problem, vehicle, _OCCUPIED)
        draw_manoeuvre(close_up, plan, vehicle)
        close_up.set_title(name, fontsize=9, color=INK, loc="left", pad=4)
    for path in route.paths:
        axes.plot(*_placed(world, scale * path).T, color=INK, linewidth=0.9, linestyle=(0, (2, 2)), zorder=3)
    driven, backs = _draw_legs(axes, world, route, scale, vehicle, view.longest)
    handles = [
        *_draw_ends(axes, world, route.problem.start, stops, scale, view.longest),
        *driven,
        Line2D([], [], color=INK, linewidth=0.9, linestyle=(0, (2, 2)), label="shortest way over the cells"),
        Patch(facecolor=_OCCUPIED, label="occupied"),
    ]
    manoeuvres = manoeuvre_legend([(plan, vehicle) for _, _, plan in arrivals]) if arrivals else []
    if backs and "backwards" not in [entry.get_label() for entry in manoeuvres]:
        handles.append(Line2D([], [], color=BACKWARDS, linewidth=2.6, label="backwards"))
    handles += [*_CLOSE_UP_ENTRIES, *manoeuvres] if arrivals else []
    legend_below(figure, handles, 4)
    return figure


def stuck_picture(
    world: OccupancyMap,
    start: Pose,
    stops: Sequence[Stop],
    stuck: Stuck,
    scale: float,
    vehicle: Vehicle = CAR,
) -> Figure:
    """A figure of a map in its own frame and where a route over it ends too early.

    Close up it shows what is around that place. If it is the start or a goal pose, the vehicle stands there.

    Args:
        world: the map, in metres.
        start: of the route, in canonical metres.
        stops: the goals, in canonical metres.
        stuck: why there is no route, and where.
        scale: metres of the map in a canonical metre.
        vehicle: the vehicle that was to drive.
    """
    view = _view(world, [start[:2], stuck.place], stops, [], scale, vehicle)
    title = f"No route over {world.name}"
    figure, axes, (close_up,) = _figure(world, view, 1, 2, title, f"{stuck.why}, at the cross")
    handles: list[Line2D | Patch] = _draw_ends(axes, world, start, stops, scale, view.longest)
    x, y, _ = world.pose(scale * stuck.place[0], scale * stuck.place[1], 0.0)
    axes.plot(x, y, marker="X", color=VERMILLION, markeredgecolor="white", markersize=11, zorder=12)
    standing = _standing_at(stuck.place, start, stops, vehicle)
    reach = _LENGTHS * scale * footprint_spacing_m(vehicle if standing is None else standing[1])
    draw_map(close_up, world, _OCCUPIED)
    close_up.set_xlim(x - reach, x + reach)
    close_up.set_ylim(y - reach, y + reach)
    close_up.set_title("what is around the cross", fontsize=9, color=INK, loc="left", pad=4)
    if standing is not None:
        bodies, _ = outlines(*standing)
        placed = [_placed(world, scale * body) for body in bodies]
        close_up.add_collection(
            PolyCollection(placed, facecolor="none", edgecolor=VERMILLION, linewidth=1.4, zorder=5)
        )
        handles.append(Patch(facecolor="none", edgecolor=VERMILLION, label="where the vehicle would stand"))
    handles += [
        Line2D([], [], marker="X", color=VERMILLION, linestyle="none", markersize=9, label="stuck here"),
        Patch(facecolor=_OCCUPIED, label="occupied"),
    ]
    legend_below(figure, handles, 4)
    return figure


class _View(NamedTuple):
    """What of a map is shown, in metres of its frame."""

    left: float
    bottom: float
    right: float
    top: float

    @property
    def longest(self) -> float:
        return max(self.right - self.left, self.top - self.bottom)


def _figure(
    world: OccupancyMap, view: _View, close_ups: int, columns: int, title: str, caption: str
) -> tuple[Figure, Axes, list[Axes]]:
    """A figure with what is shown of the map, and below it axes for close-ups, so many beside each other."""
    rows, side = math.ceil(close_ups / columns), _WIDTH / columns
    tall = min(_WIDTH * (view.top - view.bottom) / (view.right - view.left), _TALLEST)
    figure = new_figure(_WIDTH, tall + rows * side + 0.9, title)
    grid = figure.add_gridspec(1 + rows, columns, height_ratios=[tall, *[side] * rows])
    axes = figure.add_subplot(grid[0, :])
    draw_map(axes, world, _OCCUPIED)
    axes.set_xlim(view.left, view.right)
    axes.set_ylim(view.bottom, view.top)
    axes.set_title(caption, fontsize=9, color=INK, loc="left", pad=6)
    beside = [figure.add_subplot(grid[1 + k // columns, k % columns]) for k in range(close_ups)]
    return figure, axes, beside


def _draw_legs(
    axes: Axes, world: OccupancyMap, route: Route, scale: float, vehicle: Vehicle, longest: float
) -> tuple[list[Line2D | Patch], bool]:
    """Draw what is driven; returns what a legend says of it, and whether some is driven backwards."""
    sources, backs = [], False
    for leg in route.legs:
        states = leg.states(vehicle)
        points = _placed(world, scale * states[:, :2])
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
        draw_travel_arrows(axes, way, vehicle, colours, _APART * longest, 17.0)
        sources.append(leg.source)
    brakes = any(leg.driving < len(leg.controls) for leg in route.legs)
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


def _draw_ends(
    axes: Axes, world: OccupancyMap, start: Pose, stops: Sequence[Stop], scale: float, longest: float
) -> list[Line2D | Patch]:
    """Draw the start and the goals; returns what a legend says of them."""
    several = len(stops) > 1
    for number, stop in enumerate(stops, start=1):
        right, up = stop.place
        x, y, heading = world.pose(scale * right, scale * up, stop.arrival.heading or 0.0)
        goal = (x, y)
        if not axes.viewLim.contains(x, y):
            continue  # off the map: marks that are not clipped would shrink everything else
        if stop.is_pose:
            _draw_heading(axes, goal, heading, GREEN, longest)
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
    return [
        Line2D([], [], color=INK, marker="o", linestyle="none", markersize=6, label="start"),
        Line2D([], [], color=GREEN, marker="o" if several else "*", markeredgecolor=INK, linestyle="none",
               markersize=10, label="goals in order" if several else "goal"),
    ]  # fmt: skip


def _standing_at(
    place: Point, start: Pose, stops: Sequence[Stop], vehicle: Vehicle
) -> tuple[Floats, Vehicle] | None:
    """Who stands at a place, as ``asked_pose``: at the start or in a goal pose; None if neither is there."""
    arrivals = [AT_REST._replace(heading=start[2])] if place == start[:2] else []
    arrivals += [stop.arrival for stop in stops if stop.place == place]
    return asked_pose(place, arrivals[0], vehicle) if arrivals else None


def _arrivals(
    world: OccupancyMap, route: Route, stops: Sequence[Stop], scale: float, vehicle: Vehicle
) -> list[tuple[str, Problem, Plan]]:
    """Of goals that are poses a title, what is around, and the last part of the drive there.

    All is turned as the map's frame is, in canonical metres.
    """
    length = footprint_spacing_m(vehicle)
    reach = _LENGTHS * length
    (left, bottom, turn), arrivals = world.origin, list[tuple[str, Problem, Plan]]()
    frame = Alignment((left / scale, bottom / scale), -turn)
    drives = zip(stops, route.problems, route.plans(vehicle), strict=True)
    for number, (stop, problem, driven) in enumerate(drives, start=1):
        if not stop.is_pose:
            continue
        plan = from_canonical(driven, frame)
        goal = _placed(world, scale * np.array([stop.place]))[0] / scale
        outside = np.abs(plan.states[:, :2] - goal).max(axis=1) > reach - 0.5 * length
        first = int(np.flatnonzero(outside)[-1]) + 1 if outside[:-1].any() else 0
        last = Plan(plan.states[first:], plan.controls[first:], plan.dt)
        bounds = (*(goal - reach).tolist(), *(goal + reach).tolist())
        pieces = (_placed(world, scale * piece) / scale for piece in problem.obstacles.pieces())
        near = [piece for piece in pieces if (piece.max(axis=0) > bounds[:2]).all()
                and (piece.min(axis=0) < bounds[2:]).all()]  # fmt: skip
        x, y, heading, _, *others = last.states[0].tolist()
        around = replace(
            problem,
            start=(x, y, heading),
            start_motion=(0.0, *others),  # no arrow for its speed
            goal=tuple(goal.tolist()),
            arrival=stop.arrival._replace(heading=(stop.arrival.heading or 0.0) + turn),
            bounds=bounds,
            obstacles=obstacles_of([near]),
            scale=scale,
        )
        title = f"into goal {number}" if len(stops) > 1 else "into the goal"
        arrivals.append((title, around, last))
    return arrivals


def _draw_heading(
    axes: Axes, place: tuple[float, float], heading: float, colour: str, longest: float
) -> None:
    """An arrow from a ``place`` on a map along a heading."""
    reach = _ARROW * longest
    tip = place[0] + reach * math.cos(heading), place[1] + reach * math.sin(heading)
    arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.6, "shrinkA": 0.0}
    axes.annotate("", tip, place, arrowprops=arrow, zorder=9, annotation_clip=True, clip_on=True)


def _legend_of(source: str, legs: int) -> str:
    return f"{source}, {legs} leg" + "s" * (legs > 1)


def _view(
    world: OccupancyMap,
    ends: Sequence[Point],
    stops: Sequence[Stop],
    ways: Sequence[Floats],
    scale: float,
    vehicle: Vehicle,
) -> _View:
    """What lies around all of these, which are in canonical metres; a whole side if that is most of it."""
    width, height = world.size
    corners = np.array([world.pose(x, y, 0.0)[:2] for x in (0.0, width) for y in (0.0, height)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    places = [np.array([*ends, *(stop.place for stop in stops)]), *ways]
    shown = np.clip(_placed(world, scale * np.concatenate(places)), low, high)
    first, last = shown.min(axis=0), shown.max(axis=0)
    around = max(_MARGIN * float((last - first).max()), _AROUND * scale * footprint_spacing_m(vehicle))
    first, last = np.maximum(first - around, low), np.minimum(last + around, high)
    wide = last - first > _MOST_OF_MAP * (high - low)
    first, last = np.where(wide, low, first), np.where(wide, high, last)
    return _View(*first.tolist(), *last.tolist())


def _placed(world: OccupancyMap, points: Floats) -> Floats:
    """``points [n, 2]`` in grid metres, in the map's frame."""
    left, bottom, turn = world.origin
    cos, sin = math.cos(turn), math.sin(turn)
    placed: Floats = points @ np.array([[cos, sin], [-sin, cos]]) + (left, bottom)
    return placed
