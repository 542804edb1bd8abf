"""The attempts of a run as a table: filtered, sorted, a page at a time; each row opens its problem."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pandas as pd

from dashboards.cells import NOTHING
from dashboards.figures.style import planner_title
from dashboards.web.attempt_rows import SHOWS, SORTS, Attempts, ordered
from dashboards.web.page import Page
from dashboards.web.query import Asked, link
from dashboards.web.site import Site

ROWS: Final = 50  # a page
HEADINGS: Final = {
    "id": "problem", "ms": "ms", "ratio": "× alone", "": "planner, configuration", "checks": "checks",
    "length": "length m",
}  # fmt: skip
_FIRST: Final = {"slowest": ("ms", True), "hurt": ("ratio", True), "helped": ("ratio", False)}
FILTERS: Final = ("class", "planner", "configuration", "memory", "show", "id", "sort", "order")


@dataclass(frozen=True)
class Selection:
    """Rows in order, and the parameters that select them."""

    attempts: Attempts
    rows: pd.DataFrame
    values: dict[str, str]
    sort: str
    descending: bool


def selection(site: Site, asked: Asked) -> Selection:
    """What the parameters of an address select of a run's attempts."""
    attempts = site.attempts(site.run(asked.run))
    wanted = {
        "problem_class": asked.one_of("class", attempts.names("problem_class"), ""),
        "planner": asked.one_of("planner", attempts.names("planner"), ""),
        "configuration": asked.one_of("configuration", list(attempts.configurations), ""),
        "memory": asked.one_of("memory", attempts.names("memory"), ""),
    }
    show = asked.one_of("show", tuple(SHOWS), "all")
    sort, falling = _FIRST.get(show, ("id", False))
    sort = asked.one_of("sort", SORTS, sort)
    descending = asked.one_of("order", ("up", "down"), "down" if falling else "up") == "down"
    rows = ordered(attempts.chosen(wanted, show, asked.text("id")), sort, descending)
    values = {name: asked.values[name] for name in FILTERS if asked.values.get(name)}
    return Selection(attempts, rows, values, sort, descending)


def problems(site: Site, asked: Asked) -> Page:
    """The table."""
    run = asked.run
    chosen = selection(site, asked)
    count = len(chosen.rows)
    last = max(1, -(-count // ROWS))
    page = min(asked.number("page", 1, 10**9, 1), last)
    shown = chosen.rows.iloc[(page - 1) * ROWS : page * ROWS]
    first = (page - 1) * ROWS
    lines = [
        _line(row, problem_address(run, row, chosen.values, first + i))
        for i, row in enumerate(shown.to_dict("records"))
    ]
    heads = [
        {
            "title": title,
            "address": asked.also(sort=name, order=_other(chosen, name), page=None) if name else "",
            "sorted": ("descending" if chosen.descending else "ascending") if name == chosen.sort else "none",
        }
        for name, title in HEADINGS.items()
    ]
    values = {
        "lines": lines, "heads": heads, "count": count, "whole": len(chosen.attempts.rows), "number": page,
        "last": last,
        "before": asked.also(page=page - 1) if page > 1 else "",
        "after": asked.also(page=page + 1) if page < last else "",
        "fields": fields(chosen.attempts, asked), "faults": chosen.attempts.faults, "path": asked.path,
        "words": asked.text("id"), "first": first,
    }  # fmt: skip
    return Page("problems.html.jinja", f"Problems of {run}", "Problems", run, values)


def fields(attempts: Attempts, asked: Asked) -> list[dict[str, Any]]:
    """The filters as menus."""
    menus = {
        "show": ("Show", SHOWS),
        "class": ("Class", _menu(attempts.names("problem_class"))),
        "planner": (
            "Planner",
            {"": "any"} | {name: planner_title(name) for name in attempts.names("planner")},
        ),
        "configuration": ("Configuration", _menu(list(attempts.configurations))),
        "memory": ("Memory", _menu(attempts.names("memory"))),
    }
    return [
        {"name": name, "title": title, "options": list(options.items()), "value": asked.values.get(name, "")}
        for name, (title, options) in menus.items()
    ]


def problem_address(run: str, row: Mapping[Any, Any], values: dict[str, str], place: int) -> str:
    """The page of one attempt, which knows the selection it was found in."""
    of_row = {
        "problem": row["problem_id"], "by": row["planner"], "how": row["configuration"],
        "with": row["memory"] if isinstance(row["memory"], str) else "", "place": place,
    }  # fmt: skip
    return link(f"/runs/{run}/problem", of_row | values)


def number(value: float, decimals: int) -> str:
    """A number, or a dash."""
    return NOTHING if value is None or not np.isfinite(value) else f"{value:,.{decimals}f}"


def _line(row: Mapping[Any, Any], address: str) -> dict[str, Any]:
    memory = row["memory"] if isinstance(row["memory"], str) else ""
    ended = row["source"] if row["solved"] else row["status"]
    return {
        "id": row["problem_id"], "address": address, "planner": planner_title(row["planner"]),
        "configuration": row["configuration"], "memory": memory, "ended": str(ended),
        "solved": bool(row["solved"]), "missed": bool(row["missed"]),
        "numbers": [
            number(row["ms"], 3), number(row["ratio"], 2), number(row["collision_checks"], 0),
            number(row["length_m"], 1),
        ],
    }  # fmt: skip


def _menu(names: list[str]) -> dict[str, str]:
    return {"": "any"} | {name: name for name in names}


def _other(chosen: Selection, sort: str) -> str:
    """A second click turns the order round."""
    if sort == chosen.sort:
        return "up" if chosen.descending else "down"
    return "up" if sort == "id" else "down"
