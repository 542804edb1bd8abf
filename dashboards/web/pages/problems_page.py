"""The attempts of a run as a table: filtered, sorted, a page at a time; each row opens its problem."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pandas as pd

from dashboards.cells import NOTHING, planner_title
from dashboards.web.attempt_rows import SHOWS, SORTS, Attempts, ordered
from dashboards.web.data_reader import DataReader
from dashboards.web.page import Page, menu
from dashboards.web.parameters import Parameters, link

ROWS: Final = 50  # a page
HEADINGS: Final = {  # by what they sort
    "id": "problem", "ms": "ms", "ratio": "× alone", "": "planner, configuration", "checks": "checks",
    "length": "length m",
}  # fmt: skip
FILTERS: Final = ("class", "planner", "configuration", "memory", "show", "id", "sort", "order")
_FIRST: Final = {"slowest": ("ms", True), "hurt": ("ratio", True), "helped": ("ratio", False)}


@dataclass(frozen=True)
class Selection:
    """Attempts in order, and the parameters that select them."""

    attempts: Attempts  # of the run
    rows: pd.DataFrame
    values: dict[str, str]
    sort: str
    descending: bool


def selection(data: DataReader, params: Parameters) -> Selection:
    """What ``params`` select of a run's attempts."""
    attempts = data.attempts(data.run(params.run))
    filters = {
        "problem_class": params.one_of("class", attempts.names("problem_class"), ""),
        "planner": params.one_of("planner", attempts.names("planner"), ""),
        "configuration": params.one_of("configuration", list(attempts.configurations), ""),
        "memory": params.one_of("memory", attempts.names("memory"), ""),
    }
    show = params.one_of("show", tuple(SHOWS), "all")
    first, falls = _FIRST.get(show, ("id", False))
    sort = params.one_of("sort", tuple(SORTS), first)
    descending = params.one_of("order", ("up", "down"), "down" if falls else "up") == "down"
    rows = ordered(attempts.chosen(filters, show, params.text("id")), sort, descending)
    values = {name: params.values[name] for name in FILTERS if params.values.get(name)}
    return Selection(attempts, rows, values, sort, descending)


def problems(data: DataReader, params: Parameters) -> Page:
    """A page of the table, with its filters."""
    chosen = selection(data, params)
    count = len(chosen.rows)
    last = max(1, -(-count // ROWS))
    page = min(params.number("page", 1, 10**9, 1), last)
    first = (page - 1) * ROWS
    shown = chosen.rows.iloc[first : first + ROWS].to_dict("records")
    direction = "descending" if chosen.descending else "ascending"
    values = {
        "lines": [
            _line(row, problem_address(params.run, row, chosen.values, position))
            for position, row in enumerate(shown, start=first)
        ],
        "heads": [
            {
                "title": title,
                "address": _sorted_address(params, chosen, name) if name else "",
                "sorted": "none" if name != chosen.sort else direction,
            }
            for name, title in HEADINGS.items()
        ],
        "count": count, "whole": len(chosen.attempts.rows), "number": page, "last": last,
        "before": params.also(page=page - 1) if page > 1 else "",
        "after": params.also(page=page + 1) if page < last else "",
        "menus": _menus(chosen.attempts, params), "faults": chosen.attempts.faults, "path": params.path,
        "words": params.text("id"),
    }  # fmt: skip
    return Page("problems.html.jinja", f"Problems of {params.run}", "Problems", params.run, values)


def problem_address(run: str, row: Mapping[Any, Any], values: dict[str, str], position: int) -> str:
    """The page of one attempt, which knows the selection it was opened from.

    Args:
        run: name of the run.
        row: row of the attempt.
        values: parameters of the selection.
        position: place of the attempt in the selection, from 0.
    """
    of_row = {
        "problem": row["problem_id"], "by": row["planner"], "how": row["configuration"],
        "with": memory_name(row), "place": position,
    }  # fmt: skip
    return link(f"/runs/{run}/problem", of_row | values)


def memory_name(row: Mapping[Any, Any]) -> str:
    """The memory of the ``row`` of an attempt; empty if it used none."""
    return row["memory"] if isinstance(row["memory"], str) else ""


def ending(row: Mapping[Any, Any]) -> str:
    """How the attempt of a ``row`` ended: where its plan came from, or why there is none."""
    return str(row["source"] if row["solved"] else row["status"])


def number(value: float, decimals: int) -> str:
    """A number with some ``decimals``; a dash if it is missing."""
    return NOTHING if value is None or not np.isfinite(value) else f"{value:,.{decimals}f}"


def _menus(attempts: Attempts, params: Parameters) -> list[dict[str, Any]]:
    """The filters as menus."""
    titles = {name: planner_title(name) for name in attempts.names("planner")}
    options = {
        "Show": SHOWS,
        "Class": {"": "any"} | {name: name for name in attempts.names("problem_class")},
        "Planner": {"": "any"} | titles,
        "Configuration": {"": "any"} | {label: label for label in attempts.configurations},
        "Memory": {"": "any"} | {name: name for name in attempts.names("memory")},
    }
    return [
        menu(title.lower(), title, choices, params.values.get(title.lower(), ""))
        for title, choices in options.items()
    ]


def _line(row: Mapping[Any, Any], address: str) -> dict[str, Any]:
    return {
        "id": row["problem_id"], "address": address, "planner": planner_title(row["planner"]),
        "configuration": row["configuration"], "memory": memory_name(row), "ended": ending(row),
        "solved": bool(row["solved"]), "missed": bool(row["missed"]),
        "numbers": [
            number(row["ms"], 3), number(row["ratio"], 2), number(row["collision_checks"], 0),
            number(row["length_m"], 1),
        ],
    }  # fmt: skip


def _sorted_address(params: Parameters, chosen: Selection, sort: str) -> str:
    """The table sorted by another column; a second click on a heading turns its order round."""
    rises = chosen.descending if sort == chosen.sort else sort == "id"
    return params.also(sort=sort, order="up" if rises else "down", page=None)
