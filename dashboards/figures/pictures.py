"""Problems and plans as pictures: obstacles, the vehicle along its way, where a recalled plan collides."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Rectangle

from dashboards.figures.style import (
    GREEN,
    INK,
    NOTE_SIZE,
    ORANGE,
    SKY,
    VERMILLION,
    message_figure,
    new_figure,
)
from planners.search.repair import blocked_states
from planners.world.arrays import Floats
from planners.world.geometry.collision import count_free_prefix, scene_of
from planners.world.problem import Plan, Problem, start_state
from planners.world.vehicles.bodies import footprints
from planners.world.vehicles.vehicle import CAR, CarWithTrailers, Vehicle

CLEAR_WAY_M: Final = 2.0  # between two footprints of a way: it stays readable at a gallery's size
_OBSTACLE: Final = "#6B7280"


class Example(NamedTuple):
    """One picture of the gallery."""

    problem: Problem
    recalled: Sequence[Plan]  # in the order of recall, turned to the problem's start as they were checked
    found: Plan | None  # the answer; None where the attempt failed
    caption: str
    vehicle: Vehicle = CAR
    collisions: bool = False  # mark every state in collision, not only the first


def draw_problem(axes: Axes, problem: Problem, vehicle: Vehicle = CAR) -> None:
    """Bounds, obstacles, the vehicle at its start and the goal disc, in metres."""
    x_min, y_min, x_max, y_max = problem.bounds
    frame = Rectangle((x_min, y_min), x_max - x_min, y_max - y_min, fill=False, edgecolor=INK, linewidth=1.2)
    axes.add_patch(frame)
    obstacles = PolyCollection(
        problem.obstacles.pieces(),
        facecolor=_OBSTACLE,
        edgecolor=_OBSTACLE,  # closes the seams between the convex pieces of one obstacle
        linewidth=0.3,
    )
    axes.add_collection(obstacles)
    obstacles.set_clip_path(frame)
    axes.add_patch(
        Circle(problem.goal, problem.goal_radius, facecolor=ORANGE, edgecolor=INK, linewidth=0.8, zorder=2)
    )
    standing = start_state(problem, vehicle)[np.newaxis]
    _draw_bodies(axes, standing, vehicle, facecolor=INK, edgecolor=INK, linewidth=1.0, zorder=6)
    x, y, heading = problem.start
    tip = (x + 4.5 * math.cos(heading), y + 4.5 * math.sin(heading))
    axes.annotate("", tip, (x, y), arrowprops={"arrowstyle": "-|>", "color": INK, "linewidth": 1.4}, zorder=6)
    margin = 0.015 * (x_max - x_min)
    axes.set_xlim(x_min - margin, x_max + margin)
    axes.set_ylim(y_min - margin, y_max + margin)
    axes.set_aspect("equal")
    axes.set_axis_off()


def draw_plan(
    axes: Axes,
    plan: Plan,
    colour: str = GREEN,
    linewidth: float = 1.8,
    first_collision: int | None = None,
    vehicle: Vehicle = CAR,
) -> None:
    """The way of the reference point with the vehicle's footprints every few metres.

    With the number of the first state in collision, the way is dashed and ends in a cross at that state.
    """
    states = plan.states if first_collision is None else plan.states[: first_collision + 1]
    style = "-" if first_collision is None else (0, (4, 1.5))
    axes.plot(states[:, 0], states[:, 1], color=colour, linewidth=linewidth, linestyle=style, zorder=4)
    if first_collision is None:
        way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(states[:, :2], axis=0).T))])
        count = 1 + int(way[-1] / footprint_spacing_m(vehicle))
        shown = states[
            np.minimum(np.searchsorted(way, np.linspace(0.0, way[-1], count + 1)), len(states) - 1)
        ]
        _draw_bodies(axes, shown, vehicle, facecolor=(colour, 0.2), edgecolor=colour, linewidth=0.8, zorder=3)
        return
    rest = plan.states[first_collision:]
    axes.plot(rest[:, 0], rest[:, 1], color=colour, linewidth=0.8, linestyle=":", alpha=0.8, zorder=3)
    axes.plot(*states[-1, :2], marker="X", color=colour, markersize=8, markeredgecolor="white", zorder=7)


def gallery(examples: Sequence[Example], title: str = "Recalled, repaired and found plans") -> Figure:
    """Problems with the plans recalled for them, free or in collision, and the plan that was found."""
    if not examples:
        return message_figure(title, "No problems to show: run the benchmark first.")
    columns = 2 if len(examples) == 4 else min(3, len(examples))
    rows = math.ceil(len(examples) / columns)
    figure = new_figure(max(6.4, 3.8 * columns), 3.85 * rows + 0.9, title)
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in grid[len(examples) :]:
        axes.set_axis_off()
    for axes, example in zip(grid, examples, strict=False):
        _draw_example(axes, example)
    figure.legend(
        handles=_legend(examples),
        loc="outside lower left",
        ncols=5 if columns > 2 else 3,
        frameon=False,
        fontsize=NOTE_SIZE + 0.5,
    )
    return figure


def picture(
    problem: Problem,
    plan: Plan | None,
    caption: str,
    recalled: Sequence[Plan] = (),
    vehicle: Vehicle = CAR,
    called: str = "recalled",
    collisions: bool = False,
) -> Figure:
    """One problem with its plan and, where given, the plans recalled for it, or ``called`` otherwise.

    ``collisions``: every place where one of these collides is marked.
    """
    figure = new_figure(6.4, 7.2, problem.id or "Problem")
    example = Example(problem, recalled, plan, caption, vehicle, collisions)
    _draw_example(figure.add_subplot(), example)
    handles = _legend([example], called)
    figure.legend(handles=handles, loc="outside lower left", ncols=3, frameon=False, fontsize=NOTE_SIZE + 0.5)
    return figure


def footprint_spacing_m(vehicle: Vehicle) -> float:
    """Metres from one footprint of a way to the next."""
    length = vehicle.front + vehicle.rear
    if isinstance(vehicle, CarWithTrailers):
        length = vehicle.front + sum(vehicle.hitch_lengths) + vehicle.trailer_rear
    return float(math.ceil(length + CLEAR_WAY_M))


def _draw_bodies(axes: Axes, states: Floats, vehicle: Vehicle, **style: Any) -> None:
    """Every body at each of ``states [T, S]``, and the bars by which trailers are pulled."""
    corners = footprints(states, vehicle)
    axes.add_collection(PolyCollection(list(corners.reshape(-1, 4, 2)), **style))
    if isinstance(vehicle, CarWithTrailers):
        trailers = corners[:, 1:]
        fronts = trailers[:, :, 1:3].mean(axis=2)
        along = trailers[:, :, 1] - trailers[:, :, 0]
        along /= np.linalg.norm(along, axis=2, keepdims=True)
        bars = np.array(vehicle.hitch_lengths) - vehicle.trailer_front
        hitches = fronts + bars[:, np.newaxis] * along
        lines = np.stack([fronts, hitches], axis=2).reshape(-1, 2, 2)
        style = {"color": style["edgecolor"], "linewidth": style["linewidth"], "zorder": style["zorder"]}
        axes.add_collection(LineCollection(list(lines), **style))


def _draw_example(axes: Axes, example: Example) -> None:
    vehicle = example.vehicle
    draw_problem(axes, example.problem, vehicle)
    scene = scene_of(example.problem)
    if example.found is not None:
        draw_plan(axes, example.found, vehicle=vehicle)
    for plan in example.recalled:
        free = count_free_prefix(plan.states, vehicle, scene)
        if free < len(plan.states):
            draw_plan(axes, plan, VERMILLION, linewidth=1.3, first_collision=free, vehicle=vehicle)
            if example.collisions:
                blocked, _ = blocked_states(plan, scene, vehicle)
                axes.scatter(
                    plan.states[blocked, 0],
                    plan.states[blocked, 1],
                    s=7,
                    color=VERMILLION,
                    linewidths=0,
                    zorder=5,
                )
        else:
            # Wide and below: a rim around the plan found where the recalled one is the answer.
            axes.plot(*plan.states[:, :2].T, color=SKY, linewidth=4.5, zorder=2.5)
    failed = example.found is None
    title = f"{example.caption}, no plan found" if failed else example.caption
    axes.set_title(title, fontsize=9, color=VERMILLION if failed else INK, pad=4)


def _legend(examples: Sequence[Example], called: str = "recalled") -> list[Line2D | Patch]:
    """What the examples show; recalled plans, or what they are ``called``, only where there are any."""
    spacings = {footprint_spacing_m(example.vehicle) for example in examples}
    every = f"{spacings.pop():.0f} m" if len(spacings) == 1 else "few metres"
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=INK, marker=">", linestyle="none", label="start"),
        Line2D([], [], color=ORANGE, marker="o", markeredgecolor=INK, markersize=9, linestyle="none",
               label="goal"),
        Line2D([], [], color=GREEN, linewidth=1.8, label=f"plan found, with the vehicle every {every}"),
        Line2D([], [], color=SKY, linewidth=4.5, label=f"{called}, free"),
        Line2D([], [], color=VERMILLION, linewidth=1.3, linestyle="--", marker="X", markeredgecolor="white",
               markersize=8, label=f"{called}, collides at the cross"),
    ]  # fmt: skip
    if any(example.collisions for example in examples):
        dot = Line2D([], [], color=VERMILLION, marker="o", markersize=3, linestyle="none")
        dot.set_label(f"{called}, in collision")
        handles.append(dot)
    return handles if any(example.recalled for example in examples) else handles[:3]
