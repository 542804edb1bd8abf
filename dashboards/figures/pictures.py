"""Problems and plans as pictures: obstacles, the vehicle along its plan, where a recalled plan collides."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Rectangle

from dashboards.figures.manoeuvre_picture import draw_manoeuvre, draw_way, manoeuvre_legend, way_legend
from dashboards.figures.marks import draw_scale_bar
from dashboards.figures.style import legend_below, message_figure, new_figure
from dashboards.figures.views import View, view_of
from dashboards.palette import GREY, INK, OBSTACLE, ORANGE, SKY, VERMILLION
from dashboards.world_outlines import (
    CheckedPlan,
    asked_pose,
    checked,
    goal_tip,
    heading_tip,
    outlines,
    shown_states,
    speed_tip,
)
from planners.world.arrays import Floats
from planners.world.geometry.collision import scene_of
from planners.world.problem import Plan, Problem, start_state
from planners.world.vehicles.vehicle import CAR, Vehicle

_ON_ITS_WAY: Final[dict[str, Any]] = {"facecolor": (SKY, 0.28), "edgecolor": GREY, "linewidth": 0.8}
_EDGE: Final[dict[str, Any]] = {
    "fill": False, "edgecolor": GREY, "linewidth": 0.8, "linestyle": (0, (4, 3)), "zorder": 0.4
}  # fmt: skip
_AROUND: Final = 1.5  # lengths of the vehicle around what is driven, at least
_MOVED: Final[dict[str, Any]] = {"color": INK, "linewidth": 0.9, "linestyle": (0, (5, 2))}


class Example(NamedTuple):
    """One picture of the gallery."""

    problem: Problem
    recalled: Sequence[Plan]  # in the order of recall, turned to the problem's start as they were checked
    answer: Plan | None  # None if the attempt failed
    caption: str
    vehicle: Vehicle = CAR
    collisions: bool = False  # mark every state in collision, not only the first
    asked_only: bool = False  # nothing was attempted
    moved: Plan | None = None  # a stored drive as it was before it was moved and became the answer


def draw_problem(
    axes: Axes,
    problem: Problem,
    vehicle: Vehicle = CAR,
    colour: str = OBSTACLE,
    view: View | None = None,
) -> None:
    """Draw bounds, obstacles and goal of a problem, the vehicle at its start, and a scale in metres.

    A goal pose is drawn as an outline of the vehicle, a speed at the start as the way of one second.

    Args:
        axes: where to draw, in metres of the problem.
        problem: the problem.
        vehicle: the vehicle that drives.
        colour: of obstacles.
        view: what of the bounds is shown; None for all.
    """
    x_min, y_min, x_max, y_max = problem.bounds
    frame = Rectangle((x_min, y_min), x_max - x_min, y_max - y_min, fill=False, edgecolor=INK, linewidth=1.2)
    axes.add_patch(frame)
    # The edge closes the seams between the convex pieces of one obstacle.
    pieces = PolyCollection(problem.obstacles.pieces(), facecolor=colour, edgecolor=colour, linewidth=0.3)
    axes.add_collection(pieces)
    view = view or View(*problem.bounds)
    edge = Rectangle(view[:2], view.right - view.left, view.top - view.bottom, **_EDGE)
    axes.add_patch(edge)  # below the frame, which hides it where both are the same
    pieces.set_clip_path(edge)
    asked = asked_pose(problem.goal, problem.arrival, vehicle)
    if asked is None:
        disc = Circle(problem.goal, problem.goal_radius, facecolor=ORANGE, edgecolor=INK, linewidth=0.8)
        axes.add_patch(disc).set_zorder(0.5)  # below obstacles, which it may meet
    else:
        _draw_bodies(axes, *asked, facecolor="none", edgecolor=ORANGE, linewidth=1.4, zorder=6)
    standing = start_state(problem, vehicle)[np.newaxis]
    _draw_bodies(axes, standing, vehicle, facecolor=INK, edgecolor=INK, linewidth=1.0, zorder=5)
    start = problem.start[:2]
    shown = [view[:2], view[2:]]
    for root, tip, colour, width in (
        (start, heading_tip(problem, vehicle), INK, 1.4),
        (problem.goal, goal_tip(problem, vehicle), ORANGE, 1.4),
        (start, speed_tip(problem), VERMILLION, 2.4),
    ):
        if tip is not None:
            arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": width}
            axes.annotate("", tip, root, arrowprops=arrow, zorder=6)
            shown.append(tip)  # beyond the bounds if it faces them: no arrow is drawn whose tip is not shown
    margin = 0.015 * (view.right - view.left)
    (left, lower), (right, upper) = np.min(shown, axis=0) - margin, np.max(shown, axis=0) + margin
    axes.set_xlim(left, right)
    axes.set_ylim(lower, upper)
    axes.set_aspect("equal")
    axes.set_axis_off()
    draw_scale_bar(axes, replace(problem, bounds=view))


def draw_plan(axes: Axes, plan: Plan, vehicle: Vehicle = CAR) -> None:
    """Draw the way of the reference point along ``plan``, with arrows; the ``vehicle`` every few metres."""
    draw_way(axes, plan, vehicle)
    shown = shown_states(plan, vehicle)
    _draw_bodies(axes, shown, vehicle, **_ON_ITS_WAY, zorder=3)


def draw_recalled(axes: Axes, recalled: CheckedPlan, collisions: bool = False) -> None:
    """Draw a ``recalled`` plan: wide and pale if it is free, else dashed to a cross where it first collides.

    Args:
        axes: where to draw, in metres of the problem.
        recalled: the plan, with each of its states checked.
        collisions: whether every state in collision is marked.
    """
    way, first = recalled.plan.states[:, :2], recalled.first_blocked
    if first is None:  # wide and below: a rim around the answer where the recalled plan is the answer
        axes.plot(*way.T, color=SKY, linewidth=4.5, zorder=2.5)
        return
    before, after, blocked = way[: first + 1].T, way[first:].T, way[recalled.blocked]
    axes.plot(*before, color=VERMILLION, linewidth=1.3, linestyle=(0, (4, 1.5)), zorder=4)
    axes.plot(*after, color=VERMILLION, linewidth=0.8, linestyle=":", alpha=0.8, zorder=3)
    if collisions:
        axes.scatter(blocked[:, 0], blocked[:, 1], s=7, color=VERMILLION, linewidths=0, zorder=5)
    axes.plot(*way[first], marker="X", color=VERMILLION, markersize=8, markeredgecolor="white", zorder=7)


def gallery(examples: Sequence[Example], title: str = "Recalled, repaired and found plans") -> Figure:
    """A figure with a ``title`` of ``examples``: the plans recalled for a problem, and the answer."""
    if not examples:
        return message_figure(title, "No problems to show: run the benchmark first.")
    columns = 2 if len(examples) == 4 else min(3, len(examples))
    rows = math.ceil(len(examples) / columns)
    shares = [_height_share(_view(example)) for example in examples]
    tallest = [max(shares[i : i + columns]) for i in range(0, len(shares), columns)]  # of each row
    figure = new_figure(max(6.4, 3.8 * columns), 3.85 * sum(tallest) + 0.9, title)
    grid = figure.subplots(rows, columns, squeeze=False, gridspec_kw={"height_ratios": tallest}).ravel()
    for axes in grid[len(examples) :]:
        axes.set_axis_off()
    for axes, example in zip(grid, examples, strict=False):
        _draw_example(axes, example)
    legend_below(figure, _legend(examples, "recalled"), 5 if columns > 2 else 3)
    return figure


def gallery_of_problems(
    problems: Sequence[Problem], vehicle: Vehicle = CAR, title: str = "Problems"
) -> Figure:
    """A figure with a ``title`` of ``problems`` for a ``vehicle``, without plans."""
    examples = [Example(problem, (), None, problem.id, vehicle, asked_only=True) for problem in problems]
    return gallery(examples, title)


def picture(
    problem: Problem,
    answer: Plan | None,
    caption: str,
    recalled: Sequence[Plan] = (),
    vehicle: Vehicle = CAR,
    called: str = "recalled",
    collisions: bool = False,
    moved: Plan | None = None,
) -> Figure:
    """A figure of one ``problem``; the other arguments are those of ``Example``.

    Args:
        problem: canonical.
        answer: the plan that was found; None if there is none.
        caption: text above the picture.
        recalled: plans that were recalled, best first.
        vehicle: the vehicle that drives them.
        called: what the legend calls the ``recalled`` plans.
        collisions: whether every state in collision is marked.
        moved: a stored drive as it was before it was moved and became the answer.
    """
    example = Example(problem, recalled, answer, caption, vehicle, collisions, moved=moved)
    figure = new_figure(6.4, 1.2 + 6.0 * _height_share(_view(example)), problem.id or "Problem")
    _draw_example(figure.add_subplot(), example)
    legend_below(figure, _legend([example], called), 3)
    return figure


def _draw_bodies(axes: Axes, states: Floats, vehicle: Vehicle, **style: Any) -> None:
    """Draw every body at each of ``states [T, S]``, and the bars by which trailers are pulled."""
    bodies, bars = outlines(states, vehicle)
    axes.add_collection(PolyCollection(bodies, **style))
    if len(bars):
        line = {"color": style["edgecolor"], "linewidth": style["linewidth"], "zorder": style["zorder"]}
        axes.add_collection(LineCollection(list(bars), **line))


def _draw_example(axes: Axes, example: Example) -> None:
    view = _view(example)
    draw_problem(axes, example.problem, example.vehicle, view=view)
    scene = scene_of(example.problem)
    if example.answer is not None and _is_pose(example):
        draw_manoeuvre(axes, example.answer, example.vehicle)
    elif example.answer is not None:
        draw_plan(axes, example.answer, example.vehicle)
    for plan in example.recalled:
        draw_recalled(axes, checked(plan, scene, example.vehicle), example.collisions)
    if example.moved is not None:
        axes.plot(*example.moved.states[:, :2].T, **_MOVED, zorder=6)
    failed = example.answer is None and not example.asked_only
    title = f"{example.caption}, no plan found" if failed else example.caption
    title += _part_told(view, example.problem)
    axes.set_title(title, fontsize=9, color=VERMILLION if failed else INK, pad=4)


def _is_pose(example: Example) -> bool:
    """Whether the goal is a pose, and the drive a manoeuvre."""
    return goal_tip(example.problem, example.vehicle) is not None


def _view(example: Example) -> View:
    """What of the bounds is shown: what lies around the drive, or all of them if there is none."""
    problem = example.problem
    if example.answer is None:
        return View(*problem.bounds)
    plans = [each for each in (example.answer, *example.recalled, example.moved) if each is not None]
    goal = np.array([problem.goal]) + problem.goal_radius * np.array([[-1.0, -1.0], [1.0, 1.0]])
    places = [np.array([problem.start[:2]]), goal, *(plan.states[:, :2] for plan in plans)]
    return view_of(places, problem.bounds, example.vehicle, _AROUND)


def _part_told(view: View, problem: Problem) -> str:
    """A line that says how much is shown, in real metres; empty if it is all."""
    part, whole = (
        f"{problem.scale * (right - left):.3g} × {problem.scale * (top - bottom):.3g}"
        for left, bottom, right, top in (view, problem.bounds)
    )
    return "" if view == problem.bounds else f"\nshown: {part} of {whole} m"


def _height_share(view: View) -> float:
    """How high a view is beside its width, as far as a picture of it should be."""
    return min(max((view.top - view.bottom) / (view.right - view.left), 0.35), 1.0)


def _legend(examples: Sequence[Example], called: str) -> list[Line2D | Patch]:
    """What the examples show; recalled plans only if there are any."""
    to_poses = [example for example in examples if _is_pose(example)]
    to_places = [example for example in examples if not _is_pose(example)]
    handles: list[Line2D | Patch] = [Line2D([], [], color=INK, marker=">", linestyle="none", label="start")]
    if to_places:
        handles += [
            Line2D([], [], color=ORANGE, marker="o", markeredgecolor=INK, markersize=9, linestyle="none",
                   label="goal"),
        ]  # fmt: skip
    if any(speed_tip(example.problem) is not None for example in examples):
        label = "speed at the start: the way of a second"
        handles.append(Line2D([], [], color=VERMILLION, linewidth=2.4, label=label))
    if to_poses:
        handles.append(
            Line2D([], [], marker="s", markerfacecolor="none", markeredgecolor=ORANGE, markersize=8,
                   linestyle="none", label="goal pose")
        )  # fmt: skip
    ways, manoeuvres = (
        [(each.answer, each.vehicle) for each in those if each.answer is not None]
        for those in (to_places, to_poses)
    )
    if manoeuvres:
        handles += manoeuvre_legend([*ways, *manoeuvres])
    elif ways:
        handles += way_legend(ways)
    if ways:
        handles.append(Patch(**_ON_ITS_WAY, label="the vehicle every few metres"))
    if any(example.moved is not None for example in examples):
        handles.append(Line2D([], [], **_MOVED, label="stored drive, before it was moved"))
    if not any(example.recalled for example in examples):
        return handles
    handles += [
        Line2D([], [], color=SKY, linewidth=4.5, label=f"{called}, free"),
        Line2D([], [], color=VERMILLION, linewidth=1.3, linestyle="--", marker="X", markeredgecolor="white",
               markersize=8, label=f"{called}, collides at the cross"),
    ]  # fmt: skip
    if any(example.collisions for example in examples):
        label = f"{called}, in collision"
        handles.append(
            Line2D([], [], color=VERMILLION, marker="o", markersize=3, linestyle="none", label=label)
        )
    return handles
