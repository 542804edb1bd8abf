"""Overview: how much faster, where; shares solved; where the time goes; what was run when and where."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from math import nan
from typing import Any, Final

import pandas as pd

from dashboards.cells import (
    PLANNING_TIME,
    decimals_of,
    duration,
    panel_title,
    percent,
    planner_title,
)
from dashboards.palette import TIME_COLOURS, colour_of
from dashboards.report.findings import findings, for_pages
from dashboards.report.tables import driving_cells, reduction_cell
from dashboards.statistics.distributions import TIME_PARTS, time_split
from dashboards.statistics.panels import COMBINED, PLANNERS, ranked
from dashboards.web.charts import Chart, Dot, dots, stacks
from dashboards.web.data_reader import DataReader, class_names, stamp_of
from dashboards.web.notices import NoticeError
from dashboards.web.page import Page
from dashboards.web.parameters import Parameters, link
from dashboards.web.svg import LogScale
from storage.places.run_folder import RunFolder
from storage.tables.attempts import readable_attempts
from storage.tables.configurations import BASELINE, Configuration, as_found, configurations_in

VIEWS: Final = {"reduction": "How much faster", "solved": "Solved", "time": "Where the time goes"}
_SPLIT: Final = (
    "problem_id", "problem_class", "planner", "assist", "top_k", "recall", "polished", "memory",
    "planning_seconds",
    *(column for part in TIME_PARTS for column in part.columns),
)  # fmt: skip

Row = Mapping[Any, Any]  # of a summary


def overview(data: DataReader, params: Parameters) -> Page:
    """A run at a glance; without attempts, what there is of it."""
    run = data.run(params.run)
    name = run.path.name
    view = params.one_of("view", tuple(VIEWS), "reduction")
    settings, before = data.settings(run), data.earlier(run)
    values: dict[str, Any] = {
        "settings": settings,
        "before": before.path.name if before else "",
        "retrained": bool(settings.get("retraining")),
        "stages": _stages(data.stages(run)),
        "places": list(_places(data, run)),
        "views": [(key, title, params.also(view=key)) for key, title in VIEWS.items()],
        "view": view,
        "found": [],
        "classes": class_names(settings),
        "notice": "",
        "faults": (),
        "tables": [],
    }
    charts = []
    try:
        summary, origin = data.summary(run)
    except NoticeError as error:
        values["notice"] = str(error)
    else:
        match view:
            case "time":
                charts = [_time_chart(data, run)]
                values["faults"] = data.attempts(run).faults
            case "solved":
                charts = [_solved_chart(as_found(summary), name)]
            case _:
                charts = [_reduction_chart(as_found(summary), name, origin)]
        data.read_ahead(run)
        values |= {
            "tables": _tables(summary, name),
            "origin": origin,
            "found": for_pages(findings(summary)),
        }
    return Page("overview.html.jinja", name, "Overview", name, values, charts)


def faster(reduction: float) -> float:
    """How many times faster planning is whose mean time is less by a share."""
    return 1.0 / max(1.0 - reduction, 1e-4)


def faster_ends(rows: pd.DataFrame) -> tuple[float, float]:
    """Ends of an axis of times faster, for the ``rows`` of a summary."""
    low, high = (faster(each) for each in (rows["reduction_low"].min(), rows["reduction_high"].max()))
    finite = [each if each == each else 1.0 for each in (low, high)]
    return max(0.1, min(0.8, finite[0])), max(2.0, 1.1 * finite[1])


def _times_faster(row: Row) -> tuple[float, float, float]:
    """How many times faster the planner of a ``row`` is with memory, and the ends of the interval."""
    return faster(row["reduction"]), faster(row["reduction_low"]), faster(row["reduction_high"])


def _problems_address(run: str, row: Row, **more: str) -> str:
    """The attempts behind a row of a summary."""
    filters = {"memory": COMBINED} if row["panel"] == COMBINED else {"class": row["panel"]}
    filters |= {"planner": row["planner"], "configuration": row["configuration"], **more}
    return link(f"/runs/{run}/problems", filters)


def _dots(
    summary: pd.DataFrame,
    run: str,
    estimate: Callable[[Row], tuple[float, float, float]],
    words: Callable[[Row], str],
    **more: str,
) -> Iterator[tuple[str, list[Dot]]]:
    """Of each panel and planner a title, and a dot for each row with its ``estimate`` and ``words`` on it.

    The drawings of a panel begin with the planner that is told of first: the last of ``PLANNERS``.
    """
    ordered = [
        (panel, planner, of_panel[of_panel["planner"] == planner])
        for panel, of_panel in summary.groupby("panel", sort=False)
        for planner in ranked(of_panel["planner"], PLANNERS)[::-1]
    ]
    for panel, planner, rows in ordered:
        title = panel_title(str(panel), str(planner))
        yield (
            title,
            [
                Dot(
                    row["configuration"],
                    estimate(row),
                    colour_of(Configuration(*(row[name] for name in Configuration._fields))),
                    f"{title}, {row['configuration']}: {words(row)}",
                    _problems_address(run, row, **more),
                )
                for row in rows.to_dict("records")
            ],
        )


def _reduction_chart(summary: pd.DataFrame, run: str, origin: str) -> Chart:
    """How many times faster planning is with each configuration, a drawing a planner and class."""
    rows = summary[summary["configuration"] != BASELINE.label]
    ends = faster_ends(rows)

    def words(row: Row) -> str:
        times, low, high = _times_faster(row)
        return f"{times:.3g} times faster [{low:.3g}, {high:.3g}], {duration(row['mean_ms'])}"

    panels = _dots(rows, run, _times_faster, words)
    legend = {
        colour_of(each): "random plans" if each.recall == "random" else f"{each.assist} {each.top_k or ''}"
        for each in configurations_in(rows)
    }
    return Chart(
        "reduction",
        "How many times faster planning is with memory",
        "Mean planning time of the same planner without memory over that with memory, paired by problem, "
        "with 95 % bootstrap intervals; right of the line at 1 is faster. Arrows: the interval goes on. "
        f"{PLANNING_TIME} {origin}",
        dots(panels, "times faster", ends, LogScale),
        rows,
        list(legend.items()),
    )


def _solved_chart(summary: pd.DataFrame, run: str) -> Chart:
    """Share of problems solved."""
    lowest = max(0.0, min(90.0, 100.0 * float(summary["solved"].min()) - 2.0))
    panels = _dots(
        summary, run, lambda row: (100.0 * row["solved"], nan, nan),
        lambda row: f"{percent(row['solved'])} % of {row['problems']} problems solved", show="failed",
    )  # fmt: skip
    return Chart(
        "solved",
        "Share of the problems that were solved",
        "Attempts without a plan count in every time, however they ended.",
        dots(panels, "problems solved, %", (lowest, 100.0)),
        summary[["panel", "planner", "configuration", "problems", "solved"]],
    )


def _time_chart(data: DataReader, run: RunFolder) -> Chart:
    """Mean milliseconds of each part of planning time."""

    def made() -> pd.DataFrame:
        frame, _ = readable_attempts(run.results, _SPLIT)
        return time_split(as_found(frame).astype({"recall": object, "assist": object}))

    split = data.kept(("time split", stamp_of(run.results)), made)
    parts = {
        panel_title(str(panel), str(planner)): {
            str(label): list(zip(of_label["part"], of_label["ms"].tolist(), strict=True))
            for label, of_label in rows.groupby("configuration", sort=False)
        }
        for (panel, planner), rows in split.groupby(["panel", "planner"], sort=False)
    }
    return Chart(
        "time",
        "Where planning time goes",
        f"Mean milliseconds of each part over all problems. {PLANNING_TIME} Rest: in none of the parts.",
        stacks(parts, TIME_COLOURS, "mean planning time, ms", "ms"),
        split,
        [(colour, name) for name, colour in TIME_COLOURS.items()],
    )


def _tables(summary: pd.DataFrame, run: str) -> list[dict[str, Any]]:
    """The figures of a summary that are read most, a table a panel."""
    tables = []
    for panel, rows in summary.groupby("panel", sort=False):
        decimals = decimals_of(rows[["mean_ms", "median_ms"]].to_numpy(float))
        cells = [
            {
                "planner": planner_title(row["planner"]),
                "configuration": row["configuration"],
                "address": _problems_address(run, row),
                "numbers": [
                    *[f"{row[name]:,.{decimals}f}" for name in ("mean_ms", "median_ms", "p90_ms")],
                    percent(row["solved"]), reduction_cell(row), percent(row["slower"]), *driving_cells(row),
                ],
            }
            for row in rows.to_dict("records")
        ]  # fmt: skip
        tables.append({"title": str(panel), "problems": int(rows["problems"].max()), "rows": cells})
    return tables


def _stages(records: list[dict[str, Any]]) -> list[dict[str, str]]:
    return [
        {
            "stage": str(record.get("stage", "?")),
            "began": str(record.get("began", "")).replace("T", " ").replace("+00:00", " UTC"),
            "seconds": f"{float(record.get('seconds', 0.0)):,.1f}",
            "host": str(record.get("host", "")),
            "commit": str(record.get("commit", ""))[:10],
        }
        for record in records
    ]


def _places(data: DataReader, run: RunFolder) -> Iterator[tuple[str, str, str]]:
    """Where else to look: name, and its address or else the command that opens it."""
    tracking = os.environ.get("MLFLOW_TRACKING_URI", "")
    if "@" in tracking:  # a password may be in it
        tracking = f"{tracking.partition('://')[0]}://{tracking.rpartition('@')[2]}"
    if tracking.startswith(("http://", "https://")):
        yield "MLflow", tracking, ""
    else:
        store = tracking or f"sqlite:///{data.folder.mlflow_database}"
        yield "MLflow", "", f"mlflow ui --backend-store-uri {store}"
    server = os.environ.get("PREFECT_API_URL", "").removesuffix("/api")
    if server.startswith(("http://", "https://")):
        yield "Prefect", f"{server}/runs", ""
    else:
        yield "Prefect", "", f"motion-memory servers --data {data.folder.path}"
    yield "Folder", "", str(run.path)
