"""One attempt at one problem: the world, what was recalled, where it collides, the plan, how it is driven."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import pandas as pd

from dashboards.cells import NOTHING, USES, planner_title
from dashboards.web.attempt_rows import equals
from dashboards.web.data_reader import DataReader
from dashboards.web.notices import MissingError, NoticeError
from dashboards.web.page import Page
from dashboards.web.pages.problem_charts import drive_chart, drive_frames, world_chart
from dashboards.web.pages.problems_page import (
    ROWS,
    Selection,
    ending,
    memory_name,
    number,
    problem_address,
    selection,
)
from dashboards.web.parameters import Parameters, link
from dashboards.web.replay import Replay, replay
from planners.search.query import Limits
from planners.world.problem import Problem
from storage.errors import ended
from storage.places.run_folder import RunFolder
from storage.tables.configurations import Configuration

SECONDS: Final = 5.0  # that it may take to make an attempt again
_KEYS: Final = {"problem": "problem_id", "by": "planner", "how": "configuration", "with": "memory"}

Row = Mapping[Any, Any]  # of an attempt


def problem(data: DataReader, params: Parameters) -> Page:
    """The attempt that an address names, made again to be drawn."""
    run = data.run(params.run)
    chosen = selection(data, params)
    attempts = chosen.attempts.rows
    named = _row(attempts, params)
    row = named.to_dict()
    position = _position(chosen.rows, named.name, params.number("place", 0, 10**9, 0))
    replayed, drawn = _replayed(data, run, row, chosen.attempts.configurations[row["configuration"]])
    vehicle, plan = data.vehicle(run), replayed.attempt.plan
    show_tree, show_roadmap = params.flag("tree"), params.flag("roadmap")
    charts = [world_chart(drawn, replayed, vehicle, show_tree, show_roadmap)]
    charts += [drive_chart(plan, vehicle, drawn.scale)] if plan is not None else []
    same = attempts[equals(attempts["problem_id"], row["problem_id"])]
    names = {"problem": row["problem_id"], "class": row["problem_class"], "memory": memory_name(row)}
    base = f"/runs/{params.run}"
    page = position // ROWS + 1 if position > 0 else ""
    values: dict[str, Any] = {
        "facts": _facts(row, replayed),
        "recalled": _recalled(replayed, drawn.scale),
        "note": _note(row, replayed),
        "layers": _layers(params, replayed, show_tree, show_roadmap),
        "drive": drive_frames(plan, vehicle),
        "before": _beside(params, chosen, position - 1),
        "after": _beside(params, chosen, position + 1) if position >= 0 else "",
        "table": link(f"{base}/problems", {**chosen.values, "page": page}),
        "where": f"{position + 1:,} of {len(chosen.rows):,} in this selection" if position >= 0 else "",
        "others": _others(params.run, same, named.name),
        "try_it": link(f"{base}/try", names | {"planner": row["planner"]}),
        "neighbours": link(f"{base}/memory", names),
        "faults": chosen.attempts.faults,
    }
    return Page("problem.html.jinja", str(row["problem_id"]), "Problems", params.run, values, charts)


def _row(rows: pd.DataFrame, params: Parameters) -> pd.Series[Any]:
    """The row of the attempt that the parameters name. Raises MissingError if there is none."""
    keep = np.ones(len(rows), bool)
    for name, column in _KEYS.items():
        value = params.text(name)
        if value and value not in rows[column].cat.categories:
            raise MissingError(f"No attempt of this run has {column.replace('_', ' ')} {value[:80]!r}.")
        if value:
            keep &= equals(rows[column], value)
    if not params.text("problem") or not keep.any():
        raise MissingError("No attempt of this run fits this address; choose one from the table of problems.")
    return rows[keep].iloc[0]


def _position(rows: pd.DataFrame, index: Any, likely: int) -> int:
    """Where the row of an index stands in a selection, ``likely`` or elsewhere; -1 if it is not there."""
    if likely < len(rows) and rows.index[likely] == index:
        return likely
    positions = np.flatnonzero(rows.index == index)
    return int(positions[0]) if len(positions) else -1


def _replayed(
    data: DataReader, run: RunFolder, row: Row, configuration: Configuration
) -> tuple[Replay, Problem]:
    drawn = data.problem(run, str(row["problem_class"]), str(row["problem_id"]))
    memory = data.memory(run, row["memory"]) if memory_name(row) else None
    vehicle, seed = data.vehicle(run), int(row["seed"]) if row["seed"] == row["seed"] else 0
    planner, limits = str(row["planner"]), Limits(seconds=SECONDS)

    def made() -> Replay:
        try:
            return replay(drawn, planner, configuration, memory, seed, vehicle, limits)
        except ValueError as error:
            raise NoticeError(ended(f"This attempt cannot be made again: {error}")) from None

    key = ("replay", run.path, row["problem_id"], planner, configuration, row["memory"], seed, id(memory))
    return data.kept(key, made), drawn


def _facts(row: Row, replayed: Replay) -> list[tuple[str, str]]:
    beside = f" ({row['ratio']:.2f} × the planner alone)" if row["ratio"] == row["ratio"] else ""
    attempt = replayed.attempt
    return [
        ("Outcome", f"{'solved, ' if row['solved'] else 'not solved: '}{ending(row)}"),
        ("Planning time", f"{row['ms']:.3f} ms{beside}"),
        ("The planner alone", f"{number(row['alone_ms'], 3)} ms"),
        ("Planner", f"{planner_title(row['planner'])}, {row['configuration']}"),
        ("Memory", memory_name(row) or "none"),
        ("Work", f"{attempt.collision_checks:,} collision checks, {attempt.nodes:,} nodes"),
        ("Plan", f"{number(row['length_m'], 1)} m, {number(row['duration_s'], 1)} s"),
    ]


def _note(row: Row, replayed: Replay) -> str:
    """What differs from the row, if anything does."""
    attempt = replayed.attempt
    then, now = ending(row), attempt.source if attempt.solved else attempt.status
    if then == now:
        return ""
    return (
        f"The row says “{then}”, but made again it is “{now}”: the memory or the program is not the one that "
        "wrote the row."
    )


def _recalled(replayed: Replay, scale: float) -> list[dict[str, Any]]:
    table = []
    for order, (recollection, plan) in enumerate(replayed.recalled, start=1):
        first, cells = recollection.first_blocked, recollection.blocked_cells
        x, y = (0.0, 0.0) if first is None else scale * plan.states[first, :2]
        numbers = [
            str(recollection.plan),
            str(recollection.encoder_rank),
            NOTHING if cells is None else str(cells),
            f"{int(recollection.blocked.sum())} of {len(plan.states)}",
            NOTHING if first is None else f"({x:.1f}, {y:.1f})",
        ]
        beaten = recollection.is_free and not recollection.use
        use = "fits, but is not the answer" if beaten else USES[recollection.use] or NOTHING
        table.append({"order": order, "numbers": numbers, "use": use})
    return table


def _layers(
    params: Parameters, replayed: Replay, show_tree: bool, show_roadmap: bool
) -> list[tuple[str, str, bool]]:
    """Links that show or hide what the search grew: title, address, whether it is shown."""
    layers = []
    if replayed.tree is not None:
        title = f"search tree ({len(replayed.tree.parents):,} states)"
        layers.append((title, params.also(tree=None if show_tree else 1), show_tree))
    if replayed.roadmap is not None:
        title = f"roadmap ({len(replayed.roadmap.nodes):,} nodes)"
        layers.append((title, params.also(roadmap=None if show_roadmap else 1), show_roadmap))
    return layers


def _beside(params: Parameters, chosen: Selection, position: int) -> str:
    """The page of another attempt of the selection, with the same layers; empty if there is none."""
    if not 0 <= position < len(chosen.rows):
        return ""
    layers = {name: params.values[name] for name in ("tree", "roadmap") if params.values.get(name)}
    row = chosen.rows.iloc[position].to_dict()
    return problem_address(params.run, row, chosen.values | layers, position)


def _others(run: str, same: pd.DataFrame, index: Any) -> list[dict[str, Any]]:
    """All attempts at the same problem, the fastest first."""
    fastest_first = same.sort_values("ms")
    return [
        {
            "address": problem_address(run, row, {}, 0), "planner": planner_title(row["planner"]),
            "configuration": row["configuration"], "memory": memory_name(row), "ended": ending(row),
            "ms": number(row["ms"], 3), "here": at == index,
        }
        for at, row in zip(fastest_first.index, fastest_first.to_dict("records"), strict=True)
    ]  # fmt: skip
