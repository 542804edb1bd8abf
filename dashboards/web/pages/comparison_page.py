"""Compare: two runs, paired by problem, whatever machine each was made on."""

from __future__ import annotations

import json
from typing import Any, Final

import pandas as pd

from dashboards.cells import NOTHING, decimals_of, percent, share
from dashboards.figures.style import planner_title
from dashboards.verdicts.comparison import FASTER, SLOWER, compare_runs, verdict
from dashboards.web.charts import Chart, Interval, intervals
from dashboards.web.notices import WrongQuestionError
from dashboards.web.page import Page
from dashboards.web.pages.overview_page import PLANNING_TIME, in_percent, panel_title
from dashboards.web.query import Asked
from dashboards.web.site import Site, stamp_of
from storage.places.data_folder import RunFolder

RESAMPLES: Final = 1000
RESAMPLES_OF_MANY: Final = 200
MANY_ROWS: Final = 100_000
_COLOURS: Final = {FASTER: "2", SLOWER: "1"}


def comparison(site: Site, asked: Asked) -> Page:
    """The second run against the first; with fewer than two named, which there are to choose from."""
    names = [run.path.name for run in site.runs()]
    first, other = asked.one_of("first", names, ""), asked.one_of("other", names, "")
    options = [("", "choose"), *((name, name) for name in names)]
    run = asked.one_of("run", names, "") or other
    values: dict[str, Any] = {
        "path": asked.path,
        "names": names,
        "verdict": "",
        "settings": [],
        "tables": [],
        "first": first,
        "other": other,
        "menus": [
            {"name": "first", "title": "First run", "options": options, "value": first},
            {"name": "other", "title": "Other run", "options": options, "value": other},
        ],
        "swapped": asked.also(first=other, other=first),
        "resamples": RESAMPLES,
    }
    if not (first and other):
        return Page("compare.html.jinja", "Compare", "Compare", run, values)
    if first == other:
        raise WrongQuestionError(f"{first} is both runs; choose two.")
    one, two = site.run(first), site.run(other)
    table, resamples = _compared(site, one, two)
    if table.empty:
        values["verdict"] = (
            f"{other} and {first} have no attempt at the same problem in common; benchmark both with the "
            "same "
            "classes, difficulty and seed."
        )
        return Page("compare.html.jinja", "Compare", "Compare", run, values)
    values |= {
        "verdict": f"{other} against {first}: {verdict(table)}.",
        "settings": _different(site.settings(one), site.settings(two)),
        "tables": _tables(table),
        "resamples": resamples,
    }
    return Page("compare.html.jinja", "Compare", "Compare", run, values, charts=[_chart(table, first, other)])


def _compared(site: Site, one: RunFolder, two: RunFolder) -> tuple[pd.DataFrame, int]:
    first, other = (
        site.attempts(run).rows.astype({"problem_id": object, "assist": object, "recall": object})
        for run in (one, two)
    )
    resamples = RESAMPLES_OF_MANY if len(first) + len(other) > MANY_ROWS else RESAMPLES
    key = ("compare", stamp_of(one.results), stamp_of(two.results))
    return site.kept(key, lambda: compare_runs(first, other, resamples=resamples)), resamples


def _chart(table: pd.DataFrame, first: str, other: str) -> Chart:
    panels = []
    lowest = table["reduction_low"].min()
    ends = (max(-1.0, min(-0.1, float(lowest) if lowest == lowest else -0.1)), 1.0)
    for (panel, planner), rows in table.groupby(["panel", "planner"], sort=False):
        found = [
            Interval(
                row["configuration"], row["reduction"], row["reduction_low"], row["reduction_high"],
                _COLOURS.get(row["verdict"], "6"),
                f"{panel_title(str(panel), str(planner))}, {row['configuration']}: "
                f"{100 * row['reduction']:.0f} % less "
                f"[{100 * row['reduction_low']:.0f}, {100 * row['reduction_high']:.0f}], {row['verdict']}",
            )
            for row in rows.to_dict("records")
        ]  # fmt: skip
        title = panel_title(str(panel), str(planner))
        axis = "less planning time than the first run, %"
        panels.append(intervals(title, found, axis, ends, in_percent))
    return Chart(
        "comparison",
        "How much less time the other run needs",
        f"{other} against {first}, on the problems that are in both. A planner's times are taken relative "
        "to what it "
        "needed without memory in the same run, so a faster machine is no progress; the row “none” shows "
        "how much the "
        f"machines differ. Bootstrap 95 % intervals. {PLANNING_TIME}",
        panels, table, [("2", FASTER), ("1", SLOWER), ("6", "open: the interval reaches over 0")],
    )  # fmt: skip


def _tables(table: pd.DataFrame) -> list[dict[str, Any]]:
    tables = []
    for panel, rows in table.groupby("panel", sort=False):
        decimals = decimals_of(rows[["first_ms", "ms"]].to_numpy(dtype=float))
        lines = [
            {
                "planner": planner_title(row["planner"]), "configuration": row["configuration"],
                "numbers": [
                    *[f"{row[name]:,.{decimals}f}" for name in ("first_ms", "ms")],
                    *[_interval(row, name) for name in ("reduction", "checks_reduction")],
                    share(row["slower"]), percent(row["solved"]),
                ],
                "verdict": row["verdict"],
            }
            for row in rows.to_dict("records")
        ]  # fmt: skip
        tables.append({"title": f"{panel}, {int(rows['problems'].max()):,} problems in both", "rows": lines})
    return tables


def _interval(row: dict[Any, Any], name: str) -> str:
    value, low, high = (row[f"{name}{end}"] for end in ("", "_low", "_high"))
    return NOTHING if value != value else f"{100 * value:.0f} [{100 * low:4.0f}, {100 * high:4.0f}]"


def _different(one: dict[str, Any], two: dict[str, Any]) -> list[tuple[str, str, str]]:
    """The settings in which the runs differ."""
    names = dict.fromkeys([*one, *two])
    rows = [(name, json.dumps(one.get(name)), json.dumps(two.get(name))) for name in names]
    return [row for row in rows if row[1] != row[2]]
