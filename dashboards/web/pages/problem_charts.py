"""The charts of one attempt: the world with its plans, and how the vehicle is driven."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import pandas as pd

from dashboards.palette import SERIES
from dashboards.web.charts import Chart, Drawing, Line, lines
from dashboards.web.replay import Replay
from dashboards.web.world_svg import (
    answer_layer,
    recalled_layer,
    roadmap_layer,
    shown_size,
    tree_layer,
    world_svg,
)
from dashboards.world_outlines import CheckedPlan
from planners.world.alignment import scaled
from planners.world.problem import Plan, Problem
from planners.world.vehicles.bodies import footprints
from planners.world.vehicles.vehicle import DifferentialDrive, Vehicle, state_names, trailers_of

_SIZE: Final = 640.0  # pixels
_LEGEND: Final = (
    ("var(--found)", "plan found, the vehicle every few metres"),
    ("var(--free)", "recalled, free"),
    ("var(--blocked)", "recalled, in collision at the dots, first at the cross"),
)


def world_chart(
    problem: Problem, replayed: Replay, vehicle: Vehicle, show_tree: bool, show_roadmap: bool
) -> Chart:
    """A ``problem`` with what the ``replayed`` attempt recalled and found, and maybe what its search grew."""
    layers, legend = [], list(_LEGEND[: 1 + 2 * bool(replayed.recalled)])
    if show_roadmap and replayed.roadmap is not None:
        layers.append(roadmap_layer(replayed.roadmap))
        legend.append(("var(--road)", "roadmap: strips found free"))
    if show_tree and replayed.tree is not None:
        layers.append(tree_layer(replayed.tree))
        legend.append(("var(--tree)", "search tree"))
    for order, (recollection, stored) in enumerate(replayed.recalled, start=1):
        recalled = CheckedPlan(stored, recollection.blocked)
        layers.append(recalled_layer(recalled, recollection.plan, order, recollection.use == "answer"))
    plan = replayed.attempt.plan
    if plan is not None:
        layers.append(answer_layer(plan, vehicle))
    ended = replayed.attempt.source if plan is not None else f"no plan: {replayed.attempt.status}"
    x_min, y_min, x_max, y_max = problem.bounds
    width, height = (problem.scale * each for each in (x_max - x_min, y_max - y_min))
    note = (
        f"Bounds {width:.0f} × {height:.0f} m. The dark box is the vehicle at its start, its line the "
        "heading; the disc is the goal. The plan is that of the row, made again from the same seed."
    )
    shown_width, shown_height = shown_size(problem)
    drawing = Drawing("", _SIZE, _SIZE * shown_height / shown_width, world_svg(problem, vehicle, *layers))
    title = f"The world and its plan ({ended})"
    real = plan and scaled(plan, problem.scale)
    return Chart("world", title, note, [drawing], _states(real, vehicle), legend)


def drive_chart(plan: Plan, vehicle: Vehicle, scale: float) -> Chart:
    """Speed and steering of a ``vehicle`` along a ``plan``, over time, in real metres as ``scale`` says."""
    plan = scaled(plan, scale)
    times = plan.dt * np.arange(len(plan.states), dtype=float)
    degrees = np.degrees(plan.states)
    turns = isinstance(vehicle, DifferentialDrive)
    steering = ("Turn rate", "turn rate, °/s") if turns else ("Steering", "steering angle, °")
    curves = [
        ("Speed", "speed, m/s", [Line("speed", times, plan.states[:, 3], SERIES[0])]),
        (*steering, [Line(state_names(vehicle)[4], times, degrees[:, 4], SERIES[3])]),
    ]
    if trailers_of(vehicle):
        hitches = [
            Line(f"hitch {i + 1}", times, degrees[:, 5 + i], SERIES[i % len(SERIES)])
            for i in range(len(trailers_of(vehicle)))
        ]
        curves.append(("Hitch angles", "hitch angle, °", hitches))
    drawings = [
        lines(title, drawn, "time, s", axis, height=190.0, has_cursor=True) for title, axis, drawn in curves
    ]
    note = f"Along the plan found, every {plan.dt:g} s. The vertical line is where the animation is."
    return Chart("drive", "Speed and steering over time", note, drawings, _states(plan, vehicle))


def drive_frames(plan: Plan | None, vehicle: Vehicle) -> dict[str, Any]:
    """What the animation needs: seconds a step, and at each step the corners of each body in centimetres."""
    if plan is None:
        return {}
    corners = np.rint(100.0 * footprints(plan.states, vehicle)).astype(int)
    return {"dt": plan.dt, "bodies": corners.reshape(len(plan.states), -1, 8).tolist()}


def _states(plan: Plan | None, vehicle: Vehicle) -> pd.DataFrame:
    names = state_names(vehicle)
    if plan is None:
        return pd.DataFrame(columns=["time_s", *names])
    table = pd.DataFrame(plan.states, columns=list(names))
    table.insert(0, "time_s", plan.dt * np.arange(len(plan.states)))
    return table
