"""A world as SVG in metres: obstacles, the vehicle, plans with their collisions, what a search grew."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Final

import numpy as np

from dashboards.figures.pictures import footprint_spacing_m
from dashboards.web.svg import element, points, told
from planners.search.repair import Flags
from planners.search.traces import Roads, Trace
from planners.world.arrays import Floats
from planners.world.problem import Plan, Problem, start_state
from planners.world.vehicles.bodies import footprints
from planners.world.vehicles.vehicle import Vehicle

_MARGIN_M: Final = 1.0
_MOST_EDGES: Final = 20_000  # of a tree or a roadmap: more is a blot


def world(problem: Problem, vehicle: Vehicle, *layers: str) -> str:
    """The problem and what lies over it; y points up."""
    x_min, y_min, x_max, y_max = problem.bounds
    width, height = x_max - x_min + 2 * _MARGIN_M, y_max - y_min + 2 * _MARGIN_M
    start = start_state(problem, vehicle)[np.newaxis]
    x, y, heading = problem.start
    tip = 4.5 * np.array([math.cos(heading), math.sin(heading)])
    place = {"x": x_min, "y": y_min, "width": x_max - x_min, "height": y_max - y_min}
    inner = f"M{x_min:g} {y_min:g}H{x_max:g}V{y_max:g}H{x_min:g}Z"
    beyond = f"M{x_min - 99:g} {y_min - 99:g}H{x_max + 99:g}V{y_max + 99:g}H{x_min - 99:g}Z{inner}"
    drawn = [
        element("rect", **place, class_="bounds"),
        element("g", *obstacles(problem), class_="obstacles"),
        element("path", d=beyond, class_="beyond"),
        element("rect", **place, class_="frame"),
        element(
            "circle",
            told("goal"),
            cx=problem.goal[0],
            cy=problem.goal[1],
            r=problem.goal_radius,
            class_="goal",
        ),
        *layers,
        element("g", *bodies(start, vehicle), class_="start"),
        element("line", x1=x, y1=y, x2=x + float(tip[0]), y2=y + float(tip[1]), class_="heading"),
        element("g", class_="moving"),
    ]
    turned = element("g", *drawn, transform="scale(1 -1)")
    seen = f"{x_min - _MARGIN_M:g} {-y_max - _MARGIN_M:g} {width:g} {height:g}"
    said = f"World of problem {problem.id}"
    return element("svg", turned, viewBox=seen, class_="world", role="img", aria_label=said)


def obstacles(problem: Problem) -> list[str]:
    """An element an obstacle, of its convex pieces."""
    pieces = problem.obstacles.pieces()
    starts = problem.obstacles.obstacle_starts
    return [
        element("path", d=" ".join(f"M{points(piece).replace(' ', 'L')}Z" for piece in pieces[first:last]))
        for first, last in pairwise(starts.tolist())
    ]


def bodies(states: Floats, vehicle: Vehicle) -> list[str]:
    """A polygon a body at each of ``states [T, S]``."""
    return [
        element("polygon", points=points(corners))
        for corners in footprints(states, vehicle).reshape(-1, 4, 2)
    ]


def found_plan(plan: Plan, vehicle: Vehicle) -> str:
    """The answer: its way, and the vehicle every few metres."""
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(plan.states[:, :2], axis=0).T))])
    count = 1 + int(way[-1] / footprint_spacing_m(vehicle))
    at = np.minimum(np.searchsorted(way, np.linspace(0.0, way[-1], count + 1)), len(way) - 1)
    return element(
        "g",
        element("g", *bodies(plan.states[at], vehicle), class_="bodies"),
        element("polyline", points=points(plan.states[:, :2])),
        class_="found",
    )


def recalled_plan(plan: Plan, blocked: Flags, number: int, order: int, answer: bool) -> str:
    """A recalled plan, every state in collision marked; a wide pale line where it is free."""
    free = not blocked.any()
    marks = [element("circle", cx=float(x), cy=float(y), r=0.45) for x, y in plan.states[blocked, :2]]
    kind = "free" if free else "blocked"
    said = told(
        f"recalled {order}: plan {number}, " + ("free" if free else f"{len(marks)} states in collision")
    )
    return element(
        "g", said, element("polyline", points=points(plan.states[:, :2])), *marks,
        class_=f"recalled {kind}{' answer' if answer else ''}", data_order=order,
    )  # fmt: skip


def tree(trace: Trace) -> str:
    """What a search drove through: a line from each state to the one before."""
    children = np.arange(len(trace.parents))[trace.parents >= 0]
    every = -(-len(children) // _MOST_EDGES) if len(children) > _MOST_EDGES else 1
    children = children[::every] if every > 1 else children
    ends = np.stack([trace.places[trace.parents[children]], trace.places[children]], axis=1)
    return element("path", d=_segments(ends), class_="tree")


def roadmap(roads: Roads) -> str:
    """The strips of a roadmap that were found free, pale those never looked at, and its nodes."""
    drawn = [
        element("path", d=_segments(roads.nodes[edges][:_MOST_EDGES]), class_=f"road {kind}")
        for kind, edges in (("unknown", roads.unknown), ("free", roads.free))
        if len(edges)
    ]
    nodes = [element("circle", cx=float(x), cy=float(y), r=0.3, class_="node") for x, y in roads.nodes[:3000]]
    return element("g", *drawn, *nodes, class_="roadmap")


def _segments(ends: Floats) -> str:
    return "".join(f"M{a:.1f} {b:.1f}L{c:.1f} {d:.1f}" for a, b, c, d in ends.reshape(-1, 4).tolist())
