"""One attempt at one problem: the world, what was recalled, where it collides, the plan, how it is driven."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import pandas as pd

from dashboards.cells import NOTHING
from dashboards.figures.style import planner_title
from dashboards.web.charts import Chart, Line, Panel, lines
from dashboards.web.notices import MissingError, NoticeError
from dashboards.web.page import Page
from dashboards.web.pages.problems_page import number, problem_address, selection
from dashboards.web.query import Asked, link
from dashboards.web.replay import Again, again
from dashboards.web.site import Site
from dashboards.web.world_picture import found_plan, recalled_plan, roadmap, tree, world
from planners.search.query import Limits
from planners.world.arrays import Floats
from planners.world.problem import Plan, Problem
from planners.world.vehicles.bodies import footprints
from planners.world.vehicles.vehicle import CarWithTrailers, DifferentialDrive, Vehicle, state_names
from storage.places.data_folder import RunFolder

SECONDS: Final = 5.0  # that making an attempt again may take
LEGEND: Final = (
    ("found", "plan found, the vehicle every few metres"),
    ("free", "recalled, free"),
    ("blocked", "recalled, in collision at the dots"),
)
USES: Final = {
    "answer": "is the answer",
    "repaired": "was repaired",
    "guide": "guided the search",
    "": NOTHING,
}


def problem(site: Site, asked: Asked) -> Page:
    """The attempt that an address names, made again to be drawn."""
    run = site.run(asked.run)
    chosen = selection(site, asked)
    rows = chosen.attempts.rows
    row = _row(rows, asked)
    place = _place(chosen.rows, row.name, asked.number("place", 0, 10**9, 0))
    fields = row.to_dict()
    found, drawn = _again(site, run, fields, chosen.attempts.configurations[row["configuration"]])
    vehicle = site.vehicle(run)
    show_tree, show_roads = asked.flag("tree"), asked.flag("roadmap")
    plan = found.attempt.plan
    charts = [_world_chart(drawn, found, vehicle, show_tree, show_roads)]
    if plan is not None:
        charts.append(_drive_chart(plan, vehicle))
    same = rows[
        (rows["problem_id"].cat.codes == rows["problem_id"].cat.categories.get_loc(row["problem_id"]))
    ]
    values: dict[str, Any] = {
        "row": fields,
        "facts": _facts(fields, found),
        "recalled": _recalled(found),
        "note": _note(fields, found),
        "layers": _layers(asked, found, show_tree, show_roads),
        "drive": _drive(plan, vehicle),
        "before": _beside(asked, chosen.rows, place - 1, chosen.values),
        "after": _beside(asked, chosen.rows, place + 1, chosen.values) if place >= 0 else "",
        "table": link(
            f"/runs/{asked.run}/problems", {**chosen.values, "page": place // 50 + 1 if place > 0 else ""}
        ),
        "where": f"{place + 1:,} of {len(chosen.rows):,} in this selection" if place >= 0 else "",
        "others": _others(asked.run, same, row.name),
        "try_it": link(
            f"/runs/{asked.run}/try",
            {
                "problem": row["problem_id"],
                "class": row["problem_class"],
                "planner": row["planner"],
                "memory": fields["memory"] if isinstance(fields["memory"], str) else "",
            },
        ),
        "neighbours": link(
            f"/runs/{asked.run}/memory",
            {
                "problem": row["problem_id"],
                "class": row["problem_class"],
                "memory": fields["memory"] if isinstance(fields["memory"], str) else "",
            },
        ),
        "faults": chosen.attempts.faults,
    }
    return Page("problem.html.jinja", str(row["problem_id"]), "Problems", asked.run, values, charts)


def _row(rows: pd.DataFrame, asked: Asked) -> pd.Series[Any]:
    """The row of an attempt; a MissingError where there is none."""
    keep = np.ones(len(rows), bool)
    for name, column in (
        ("problem", "problem_id"),
        ("by", "planner"),
        ("how", "configuration"),
        ("with", "memory"),
    ):
        value = asked.text(name)
        categories = rows[column].cat.categories
        if value and value not in categories:
            raise MissingError(f"No attempt of this run has {column.replace('_', ' ')} {value[:80]!r}.")
        if value:
            keep &= (rows[column].cat.codes == categories.get_loc(value)).to_numpy()
    if not asked.text("problem") or not keep.any():
        raise MissingError("No attempt of this run fits this address; choose one from the table of problems.")
    return rows[keep].iloc[0]


def _place(rows: pd.DataFrame, index: Any, likely: int) -> int:
    """Where a row stands in the selection; -1 where it does not."""
    if likely < len(rows) and rows.index[likely] == index:
        return likely
    found = np.flatnonzero(rows.index == index)
    return int(found[0]) if len(found) else -1


def _again(site: Site, run: RunFolder, row: Mapping[Any, Any], how: Any) -> tuple[Again, Problem]:
    drawn = site.problem(run, str(row["problem_class"]), str(row["problem_id"]))
    memory = site.memory(run, row["memory"]) if isinstance(row["memory"], str) else None
    vehicle, seed = site.vehicle(run), int(row["seed"]) if row["seed"] == row["seed"] else 0

    def made() -> Again:
        try:
            limits = Limits(seconds=SECONDS)
            return again(drawn, str(row["planner"]), how, memory, seed, vehicle, limits)
        except ValueError as error:
            raise NoticeError(f"This attempt cannot be made again: {error}.") from None

    key = ("again", run.path, row["problem_id"], row["planner"], how, row["memory"], seed, id(memory))
    return site.kept(key, made), drawn


def _world_chart(drawn: Problem, found: Again, vehicle: Vehicle, show_tree: bool, show_roads: bool) -> Chart:
    layers = []
    if show_roads and found.roadmap is not None:
        layers.append(roadmap(found.roadmap))
    if show_tree and found.tree is not None:
        layers.append(tree(found.tree))
    for order, (each, plan) in enumerate(found.recalled, start=1):
        layers.append(recalled_plan(plan, each.blocked, each.plan, order, each.use == "answer"))
    if found.attempt.plan is not None:
        layers.append(found_plan(found.attempt.plan, vehicle))
    ended = found.attempt.source if found.attempt.plan is not None else f"no plan: {found.attempt.status}"
    x_min, y_min, x_max, y_max = drawn.bounds
    size = 640.0
    panel = Panel("", size, size * (y_max - y_min) / (x_max - x_min), world(drawn, vehicle, *layers))
    legend = LEGEND[: 1 + 2 * bool(found.recalled)]
    if show_tree and found.tree is not None:
        legend = (*legend, ("tree", "search tree"))
    if show_roads and found.roadmap is not None:
        legend = (*legend, ("road", "roadmap: strips found free"))
    note = (
        f"Bounds {x_max - x_min:.0f} × {y_max - y_min:.0f} m; the dark box is the vehicle at its start, "
        "its line "
        "the heading; the disc is the goal. The plan is the one of the row: made again from the same seed."
    )
    return Chart(
        "world",
        f"The world and its plan ({ended})",
        note,
        [panel],
        _states(found.attempt.plan, vehicle),
        legend,
    )


def _drive_chart(plan: Plan, vehicle: Vehicle) -> Chart:
    times: Floats = plan.dt * np.arange(len(plan.states), dtype=float)
    names = state_names(vehicle)
    speed = Line("speed", times, plan.states[:, 3], "0")
    turning = plan.states[:, 4]
    degrees: Floats = np.degrees(turning)
    title, axis = (
        ("Turn rate", "turn rate, °/s")
        if isinstance(vehicle, DifferentialDrive)
        else ("Steering", "steering angle, °")
    )
    panels = [
        lines("Speed", [speed], "time, s", "speed, m/s", height=190.0, name="speed"),
        lines(title, [Line(names[4], times, degrees, "3")], "time, s", axis, height=190.0, name="steering"),
    ]
    if isinstance(vehicle, CarWithTrailers):
        hitches = [
            Line(f"hitch {i + 1}", times, np.asarray(np.degrees(plan.states[:, 5 + i]), float), "025"[i % 3])
            for i in range(len(vehicle.hitch_lengths))
        ]
        panels.append(lines("Hitch angles", hitches, "time, s", "hitch angle, °", height=190.0, name="hitch"))
    note = f"Along the plan found, every {plan.dt:g} s. The vertical line is where the animation is."
    return Chart("drive", "Speed and steering over time", note, panels, _states(plan, vehicle))


def _states(plan: Plan | None, vehicle: Vehicle) -> pd.DataFrame:
    names = state_names(vehicle)
    if plan is None:
        return pd.DataFrame(columns=["time_s", *names])
    table = pd.DataFrame(plan.states, columns=list(names))
    table.insert(0, "time_s", plan.dt * np.arange(len(plan.states)))
    return table


def _drive(plan: Plan | None, vehicle: Vehicle) -> dict[str, Any]:
    """What the animation needs: footprints in centimetres, a list of corners a body a state."""
    if plan is None:
        return {}
    corners = np.rint(100.0 * footprints(plan.states, vehicle)).astype(int)
    return {"dt": plan.dt, "bodies": corners.reshape(len(plan.states), -1, 8).tolist()}


def _facts(row: Mapping[Any, Any], found: Again) -> list[tuple[str, str]]:
    ended = f"solved, {row['source']}" if row["solved"] else f"not solved: {row['status']}"
    beside = f" ({row['ratio']:.2f} × the planner alone)" if row["ratio"] == row["ratio"] else ""
    memory = row["memory"] if isinstance(row["memory"], str) else "none"
    searched = found.attempt
    return [
        ("Outcome", ended),
        ("Planning time", f"{row['ms']:.3f} ms{beside}"),
        ("The planner alone", f"{number(row['alone_ms'], 3)} ms"),
        ("Planner", f"{planner_title(row['planner'])}, {row['configuration']}"),
        ("Memory", memory),
        ("Work", f"{searched.collision_checks:,} collision checks, {searched.nodes:,} nodes"),
        ("Plan", f"{number(row['length_m'], 1)} m, {number(row['duration_s'], 1)} s"),
    ]


def _note(row: Mapping[Any, Any], found: Again) -> str:
    """What differs from the row, if anything does."""
    then = row["source"] if row["solved"] else row["status"]
    now = found.attempt.source if found.attempt.solved else found.attempt.status
    if then == now:
        return ""
    return (
        f"The row says “{then}”, made again it is “{now}”: the memory or the program is not the one that "
        "wrote it."
    )


def _recalled(found: Again) -> list[dict[str, Any]]:
    table = []
    for order, (each, plan) in enumerate(found.recalled, start=1):
        first = each.first_blocked
        where = NOTHING if first is None else f"({plan.states[first, 0]:.1f}, {plan.states[first, 1]:.1f})"
        cells = NOTHING if each.blocked_cells is None else str(each.blocked_cells)
        table.append(
            {
                "order": order,
                "numbers": [
                    str(each.plan),
                    str(each.encoder_rank),
                    cells,
                    f"{int(each.blocked.sum())} of {len(plan.states)}",
                    where,
                ],
                "use": USES.get(each.use, each.use),
                "free": first is None,
            }
        )
    return table


def _layers(asked: Asked, found: Again, show_tree: bool, show_roads: bool) -> list[tuple[str, str, bool]]:
    """Links that show or hide what the search grew: title, address, whether it is shown."""
    layers = []
    if found.tree is not None:
        size = f"{len(found.tree.parents):,} states"
        layers.append((f"search tree ({size})", asked.also(tree=None if show_tree else 1), show_tree))
    if found.roadmap is not None:
        size = f"{len(found.roadmap.nodes):,} nodes"
        layers.append((f"roadmap ({size})", asked.also(roadmap=None if show_roads else 1), show_roads))
    return layers


def _beside(asked: Asked, rows: pd.DataFrame, place: int, values: dict[str, str]) -> str:
    """The page of another row of the selection, with the same layers; empty where there is none."""
    if not 0 <= place < len(rows):
        return ""
    layers = {name: asked.values[name] for name in ("tree", "roadmap") if asked.values.get(name)}
    return problem_address(asked.run, rows.iloc[place].to_dict(), values | layers, place)


def _others(run: str, same: pd.DataFrame, index: Any) -> list[dict[str, Any]]:
    """All attempts at the same problem, the fastest first."""
    found = []
    for at, row in same.sort_values("ms").iterrows():
        fields = row.to_dict()
        found.append(
            {
                "address": problem_address(run, fields, {}, 0),
                "planner": planner_title(fields["planner"]),
                "configuration": fields["configuration"],
                "memory": fields["memory"] if isinstance(fields["memory"], str) else "",
                "ended": fields["source"] if fields["solved"] else fields["status"],
                "ms": number(fields["ms"], 3),
                "here": at == index,
            }
        )
    return found
