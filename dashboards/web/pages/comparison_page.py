"""Compare: two runs, paired by problem, whatever machine each was made on."""

from __future__ import annotations

import json
from typing import Any, Final

import numpy as np
import pandas as pd

from dashboards.cells import panel_title, planner_title, with_interval
from dashboards.palette import BLUE, GREEN, GREY, VERMILLION
from dashboards.verdicts.comparison import ALARM, BETTER, SAME, WORSE, alarms, compare_runs, verdict
from dashboards.verdicts.comparison_tables import BY_COUNTS, HEADINGS, comparison_cells
from dashboards.web.charts import Chart, Dot, dots
from dashboards.web.data_reader import DataReader, stamp_of
from dashboards.web.notices import BadRequestError
from dashboards.web.page import Page, menu
from dashboards.web.parameters import Parameters
from dashboards.web.svg import WideScale
from storage.places.run_folder import RunFolder

DRAWN: Final = 2000
DRAWN_OF_MANY: Final = 500
MANY_ROWS: Final = 100_000
_COLOURS: Final = {BETTER: GREEN, WORSE: VERMILLION, ALARM: BLUE}


def comparison(data: DataReader, params: Parameters) -> Page:
    """The second run against the first; if fewer than two are named, a choice of runs."""
    names = [run.path.name for run in data.runs()]
    first, other = params.one_of("first", names, ""), params.one_of("other", names, "")
    options = {"": "choose"} | {name: name for name in names}
    values: dict[str, Any] = {
        "path": params.path, "names": names, "first": first, "other": other, "verdict": "", "settings": [],
        "tables": [], "how": BY_COUNTS, "alarms": [], "headings": HEADINGS,
        "menus": [
            menu("first", "First run", options, first), menu("other", "Other run", options, other)
        ],
        "swapped": params.also(first=other, other=first),
    }  # fmt: skip
    charts = []
    if first and first == other:
        raise BadRequestError(f"{first} is both runs; choose two.")
    if first and other:
        one, two = data.run(first), data.run(other)
        table = compared(data, one, two)
        if table.empty:
            values["verdict"] = (
                f"{other} and {first} have no attempt at the same problem in common; benchmark both with the "
                "same classes, difficulty and seed, or use `motion-memory compare --measure`."
            )
        else:
            charts = [_chart(table, first, other)]
            values["verdict"] = f"{other} against {first}: {verdict(table)}."
            values["alarms"] = alarms(table)
            values["settings"] = _different(data.settings(one), data.settings(two))
            values["tables"] = [
                (title, [[planner_title(row[0]), *row[1:]] for group in groups for row in group])
                for title, groups in comparison_cells(table)
            ]
    run = params.one_of("run", names, "") or other
    return Page("compare.html.jinja", "Compare", "Compare", run, values, charts)


def compared(data: DataReader, one: RunFolder, two: RunFolder) -> pd.DataFrame:
    """The run ``two`` against ``one``; raises NoticeError if one of them has no attempts yet."""
    first, other = (
        data.attempts(run).rows.astype({"problem_id": object, "assist": object, "recall": object})
        for run in (one, two)
    )
    drawn = DRAWN_OF_MANY if len(first) + len(other) > MANY_ROWS else DRAWN
    key = ("compare", stamp_of(one.results), stamp_of(two.results))
    return data.kept(key, lambda: compare_runs(first, other, drawn=drawn))


def _chart(table: pd.DataFrame, first: str, other: str) -> Chart:
    panels = []
    for (panel, planner), rows in table.groupby(["panel", "planner"], sort=False):
        title = panel_title(str(panel), str(planner))
        rows_of_panel = []
        for row in rows.to_dict("records"):
            less, low, high = (float(row[f"checks_reduction{end}"]) for end in ("", "_low", "_high"))
            fewer = f"{with_interval(less, low, high)} % fewer checks"
            why = f"{row['verdict']}{row['why'] and ': '}{row['why']}"
            words = f"{title}, {row['configuration']}: {fewer}, {why}"
            colour = _COLOURS.get(row["verdict"], GREY)
            rows_of_panel.append(
                Dot(row["configuration"], (100.0 * less, 100.0 * low, 100.0 * high), colour, words)
            )
        panels.append((title, rows_of_panel))
    return Chart(
        "comparison",
        "How much less work the other run needs",
        f"{other} against {first}, on the problems that are in both: collision checks, which no machine "
        "changes, with 95 % intervals that hold for all rows at once. Beyond 100 and −100 the axis is "
        "logarithmic. Colours say what is better or worse by problems solved, then seconds of driving, then "
        "checks, expansions and hits.",
        dots(panels, "fewer collision checks than the first run, %", _ends(table), WideScale),
        table,
        [(GREEN, BETTER), (VERMILLION, WORSE), (BLUE, ALARM), (GREY, SAME)],
    )


def _ends(table: pd.DataFrame) -> tuple[float, float]:
    """Ends of an axis in per cent that holds all dots and intervals of a ``table`` of ``compare_runs``."""
    percents = 100.0 * table[[f"checks_reduction{end}" for end in ("", "_low", "_high")]].to_numpy(float)
    finite = percents[np.isfinite(percents)]
    return 1.05 * float(finite.min(initial=-10.0)), 1.05 * float(finite.max(initial=100.0))


def _different(one: dict[str, Any], two: dict[str, Any]) -> list[tuple[str, str, str]]:
    """The settings in which the runs differ."""
    rows = [(name, json.dumps(one.get(name)), json.dumps(two.get(name))) for name in {**one, **two}]
    return [row for row in rows if row[1] != row[2]]
