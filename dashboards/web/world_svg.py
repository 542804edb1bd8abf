"""A world as SVG in metres: obstacles, the vehicle, plans with their collisions, what a search grew."""

from __future__ import annotations

from itertools import pairwise
from typing import Final

import numpy as np

from dashboards.web.svg import element, points, text, tooltip
from dashboards.world_outlines import (
    CheckedPlan,
    asked_pose,
    goal_tip,
    heading_tip,
    outlines,
    scale_bar,
    shown_states,
    speed_tip,
    travel_arrows,
)
from planners.search.traces import Roads, Trace
from planners.world.arrays import Floats
from planners.world.problem import Plan, Problem, start_state
from planners.world.vehicles.vehicle import Vehicle

_MARGIN_M: Final = 1.0
_BELOW_M: Final = 2.4  # the frame, for the scale
_MOST_EDGES: Final = 20_000  # of a tree or a roadmap: more is a blot
_MOST_NODES: Final = 3_000


def shown_size(problem: Problem) -> tuple[float, float]:
    """Width and height of what ``world_svg`` shows of a ``problem``, in metres."""
    x_min, y_min, x_max, y_max = problem.bounds
    return x_max - x_min + 2.0 * _MARGIN_M, y_max - y_min + _MARGIN_M + _BELOW_M


def world_svg(problem: Problem, vehicle: Vehicle, *layers: str) -> str:
    """A ``problem``, a ``vehicle`` at its start, ``layers`` of markup over it, and a scale; y points up."""
    x_min, y_min, x_max, y_max = problem.bounds
    place = {"x": x_min, "y": y_min, "width": x_max - x_min, "height": y_max - y_min}
    inner = f"M{x_min:g} {y_min:g}H{x_max:g}V{y_max:g}H{x_min:g}Z"
    beyond = f"M{x_min - 99:g} {y_min - 99:g}H{x_max + 99:g}V{y_max + 99:g}H{x_min - 99:g}Z{inner}"
    (goal_x, goal_y), (x, y, _), (tip_x, tip_y) = problem.goal, problem.start, heading_tip(problem, vehicle)
    marks = [
        element("rect", **place, class_="bounds"),
        element("g", *_obstacles(problem), class_="obstacles"),
        element("path", d=beyond, class_="beyond"),
        element("rect", **place, class_="frame"),
        element("circle", tooltip("goal"), cx=goal_x, cy=goal_y, r=problem.goal_radius, class_="goal"),
        *_asked(problem, vehicle),
        *layers,
        _bodies(start_state(problem, vehicle)[np.newaxis], vehicle, "start"),
        element("line", x1=x, y1=y, x2=tip_x, y2=tip_y, class_="heading"),
        element("g", class_="moving"),
    ]
    width, height = shown_size(problem)
    return element(
        "svg",
        element("g", *marks, transform="scale(1 -1)"),
        _scale_bar(problem),
        viewBox=f"{x_min - _MARGIN_M:g} {-y_max - _MARGIN_M:g} {width:g} {height:g}",
        class_="world",
        role="img",
        aria_label=f"World of problem {problem.id}",
    )


def _scale_bar(problem: Problem) -> str:
    """How long some real metres are, below the right end of the frame; y points down."""
    (_, y_min, x_max, _), (metres, shown) = problem.bounds, scale_bar(problem)
    bar = element("path", d=f"M{x_max - shown:g} {0.9 - y_min:g}h{shown:g}", class_="scale")
    return bar + text(f"{metres:g} m", x_max - shown - 0.6, 1.5 - y_min, class_="scale")


def _asked(problem: Problem, vehicle: Vehicle) -> list[str]:
    """The vehicle in a goal pose, and the way of the first second at the speed of the start."""
    asked, tip = asked_pose(problem.goal, problem.arrival, vehicle), speed_tip(problem)
    (x, y, _), marks = problem.start, []
    if asked is not None:
        marks.append(_bodies(*asked, "goal pose"))
    ahead = goal_tip(problem, vehicle)
    if ahead is not None:
        (x1, y1), (x2, y2) = problem.goal, ahead
        marks.append(element("line", x1=x1, y1=y1, x2=x2, y2=y2, class_="heading asked"))
    if tip is not None:
        speed = tooltip(f"{problem.scale * problem.start_motion[0]:g} m/s at the start")
        marks.append(element("line", speed, x1=x, y1=y, x2=tip[0], y2=tip[1], class_="speed"))
    return marks


def answer_layer(plan: Plan, vehicle: Vehicle) -> str:
    """The ``plan`` found: the way of the reference point with arrows, the ``vehicle`` every few metres."""
    way = element("polyline", points=points(plan.states[:, :2]))
    heads = "".join(
        f"M{x - 0.5 * ahead - 0.6 * aside:.2f} {y - 0.5 * aside + 0.6 * ahead:.2f}"
        f"L{x + 0.8 * ahead:.2f} {y + 0.8 * aside:.2f}"
        f"L{x - 0.5 * ahead + 0.6 * aside:.2f} {y - 0.5 * aside - 0.6 * ahead:.2f}Z"
        for x, y, ahead, aside, _ in travel_arrows(plan, vehicle).tolist()
    )
    bodies = _bodies(shown_states(plan, vehicle), vehicle, "bodies")
    return element("g", bodies, way, element("path", d=heads), class_="found")


def recalled_layer(recalled: CheckedPlan, number: int, order: int, is_answer: bool = False) -> str:
    """A ``recalled`` plan: a wide pale line if it is free, else dashed, every state in collision marked.

    Args:
        recalled: the plan, with each of its states checked.
        number: its number in its memory.
        order: its place among the recalled plans, from 1.
        is_answer: whether the plan was driven as it is.
    """
    way, first = recalled.plan.states[:, :2], recalled.first_blocked
    collisions = way[recalled.blocked].tolist()
    marks = [element("polyline", points=points(way if first is None else way[: first + 1]))]
    if first is not None:
        x, y = way[first].tolist()
        cross = f"M{x - 0.9:.1f} {y - 0.9:.1f}l1.8 1.8m0 -1.8l-1.8 1.8"
        marks.append(element("polyline", points=points(way[first:]), class_="rest"))
        marks += [element("circle", cx=x, cy=y, r=0.45) for x, y in collisions]
        marks.append(element("path", d=cross))
    kind = "free" if first is None else "blocked"
    fate = kind if first is None else f"{len(collisions)} states in collision"
    return element(
        "g", tooltip(f"recalled {order}: plan {number}, {fate}"), *marks,
        class_=f"recalled {kind}{' answer' if is_answer else ''}", data_order=order,
    )  # fmt: skip


def tree_layer(trace: Trace) -> str:
    """What a search drove through, as its ``trace`` says: a line from each state to the one before."""
    children = np.arange(len(trace.parents))[trace.parents >= 0]
    children = children[:: max(1, -(-len(children) // _MOST_EDGES))]
    ends = np.stack([trace.positions[trace.parents[children]], trace.positions[children]], axis=1)
    return element("path", d=_segments(ends), class_="tree")


def roadmap_layer(roads: Roads) -> str:
    """The strips of a roadmap that were found free, its nodes, and pale what was never looked at."""
    strips = [
        element("path", d=_segments(roads.nodes[edges][:_MOST_EDGES]), class_=f"road {kind}")
        for kind, edges in (("unknown", roads.unknown), ("free", roads.free))
        if len(edges)
    ]
    nodes = roads.nodes[:_MOST_NODES].tolist()
    circles = [element("circle", cx=x, cy=y, r=0.3, class_="node") for x, y in nodes]
    return element("g", *strips, *circles, class_="roadmap")


def _obstacles(problem: Problem) -> list[str]:
    """An element an obstacle, of its convex pieces."""
    pieces = problem.obstacles.pieces()
    return [
        element("path", d=" ".join(f"M{points(piece).replace(' ', 'L')}Z" for piece in pieces[first:last]))
        for first, last in pairwise(problem.obstacles.obstacle_starts.tolist())
    ]


def _bodies(states: Floats, vehicle: Vehicle, kind: str) -> str:
    """The vehicle at each of ``states [T, S]``."""
    bodies, bars = outlines(states, vehicle)
    polygons = [element("polygon", points=points(corners)) for corners in bodies]
    tow_bars = [element("path", d=_segments(bars), class_="bars")] if len(bars) else []
    return element("g", *polygons, *tow_bars, class_=kind)


def _segments(ends: Floats) -> str:
    return "".join(f"M{a:.1f} {b:.1f}L{c:.1f} {d:.1f}" for a, b, c, d in ends.reshape(-1, 4).tolist())
