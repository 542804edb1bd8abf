"""Overview: how much faster, where; solved shares; where the time goes; what was run when and where."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any, Final

import pandas as pd

from dashboards.cells import decimals_of, percent, reduction, share
from dashboards.figures.style import planner_title
from dashboards.statistics.distributions import PARTS, REST, time_split
from dashboards.statistics.panels import COMBINED, summarise
from dashboards.web.charts import Chart, Interval, Panel, intervals, stacks
from dashboards.web.notices import NoticeError
from dashboards.web.page import Page
from dashboards.web.query import Asked, link
from dashboards.web.site import Site, stamp_of
from dashboards.web.svg import short
from storage.places.data_folder import RunFolder
from storage.tables.attempts import readable_attempts
from storage.tables.configurations import BASELINE

PLANNING_TIME: Final = (
    "Planning time is everything between receiving the obstacles and returning a plan: drawing the grid, "
    "encoder, recall, checks, guide, repair, roadmap, search; failures count with the time they took."
)
VIEWS: Final = {"reduction": "How much faster", "solved": "Solved", "time": "Where the time goes"}
COLOURS: Final = {"closed": "0", "open": "3", "repair": "2", "fresh": "6", "none": "6"}
RESAMPLES: Final = 200  # where a run has no report of its own: the ends then stand on 5 resamples each
_FURTHEST: Final = (-1.0, 1.0)  # of an axis of reductions
_SPLIT: Final = (
    "problem_id", "problem_class", "planner", "assist", "top_k", "recall", "memory", "planning_seconds",
    *(column for part in PARTS for column in part.columns),
)  # fmt: skip


def overview(site: Site, asked: Asked) -> Page:
    """A run at a glance; without attempts, what there is of it."""
    run = site.run(asked.run)
    settings, name = site.settings(run), run.path.name
    view = asked.one_of("view", tuple(VIEWS), "reduction")
    values: dict[str, Any] = {
        "settings": settings,
        "stages": _stages(site.stages(run)),
        "places": list(_places(site, run)),
        "views": [(key, title, asked.also(view=key)) for key, title in VIEWS.items()],
        "view": view,
        "notice": "",
        "faults": (),
        "tables": [],
    }
    try:
        summary, told = summary_of(site, run)
    except NoticeError as error:
        return Page("overview.html.jinja", name, "Overview", name, values | {"notice": str(error)})
    if view == "time":
        charts = [time_chart(site, run)]
        values["faults"] = site.attempts(run).faults
    else:
        charts = [
            reduction_chart(summary, name, told) if view == "reduction" else solved_chart(summary, name)
        ]
    site.read_ahead(run)
    values["tables"] = _tables(summary, name)
    values["told"] = told
    values["best"] = _best(summary)
    return Page("overview.html.jinja", name, "Overview", name, values, charts)


def summary_of(site: Site, run: RunFolder) -> tuple[pd.DataFrame, str]:
    """The table of the run's report, or one made here with wider intervals; and where it is from."""
    found = site.summary(run)
    if found is not None:
        return found, "Numbers of the run's report."
    rows = site.attempts(run).rows
    made = site.kept(
        ("summarise", stamp_of(run.results)),
        lambda: summarise(rows.astype({"recall": object, "assist": object}), resamples=RESAMPLES),
    )
    return made, f"The run has no report yet: made here from its rows, with {RESAMPLES} resamples only."


def panels_of(summary: pd.DataFrame) -> Iterator[tuple[str, str, pd.DataFrame]]:
    """Panel, planner and rows, in reading order; planners after one another in each panel."""
    for (panel, planner), rows in summary.groupby(["panel", "planner"], sort=False):
        yield str(panel), str(planner), rows


def problems_address(run: str, panel: str, planner: str, configuration: str, **more: str) -> str:
    """The attempts behind a dot or a row."""
    place = {"memory": COMBINED} if panel == COMBINED else {"class": panel}
    return link(
        f"/runs/{run}/problems", {**place, "planner": planner, "configuration": configuration, **more}
    )


def panel_title(panel: str, planner: str) -> str:
    """Planner and class."""
    return f"{planner_title(planner)}, {'combined memory' if panel == COMBINED else panel}"


def reduction_chart(summary: pd.DataFrame, run: str, told: str) -> Chart:
    """Less planning time with each configuration, a panel a planner and class."""
    rows = summary[summary["configuration"] != BASELINE.label]
    lowest = rows.get("reduction_low", rows["reduction"]).min()
    ends = (max(_FURTHEST[0], min(-0.1, float(lowest) if lowest == lowest else -0.1)), _FURTHEST[1])
    drawn: list[Panel] = []
    for panel, planner, of_panel in panels_of(rows):
        found = [
            Interval(
                row["configuration"],
                row["reduction"],
                row.get("reduction_low", float("nan")),
                row.get("reduction_high", float("nan")),
                COLOURS.get(row["assist"], "5"),
                f"{panel_title(panel, planner)}, {row['configuration']}: {_reduction(row)} % less time, "
                f"{row['mean_ms']:.3g} ms",
                problems_address(run, panel, planner, row["configuration"]),
            )
            for row in of_panel.to_dict("records")
        ]
        axis = "less mean planning time, %"
        drawn.append(intervals(panel_title(panel, planner), found, axis, ends, in_percent))
    legend = [
        (COLOURS.get(name, "5"), "random plans" if name.startswith("random") else name)
        for name in dict.fromkeys(
            "random" if str(each).startswith("random") else str(each) for each in rows["assist"]
        )
    ]
    return Chart(
        "reduction",
        "How much less time planning takes with memory",
        "Reduction of the mean planning time against the same planner without memory, paired by problem, "
        "with "
        f"bootstrap 95 % intervals; right of the line at 0 is faster. {PLANNING_TIME} {told}",
        drawn,
        rows,
        legend,
    )


def solved_chart(summary: pd.DataFrame, run: str) -> Chart:
    """Share of problems solved."""
    low = min(0.9, float(summary["solved"].min()) - 0.02)
    drawn = []
    for panel, planner, of_panel in panels_of(summary):
        found = [
            Interval(
                row["configuration"],
                row["solved"],
                float("nan"),
                float("nan"),
                COLOURS.get(row["assist"], "5"),
                f"{panel_title(panel, planner)}, {row['configuration']}: {percent(row['solved'])} % of "
                f"{row['problems']} problems solved",
                problems_address(run, panel, planner, row["configuration"], show="failed"),
            )
            for row in of_panel.to_dict("records")
        ]
        ends = (max(0.0, low), 1.0)
        drawn.append(intervals(panel_title(panel, planner), found, "problems solved, %", ends, in_percent))
    return Chart(
        "solved",
        "Share of the problems that were solved",
        "Attempts end without a plan when the planner's expansions are used up; such attempts count in "
        "every time.",
        drawn,
        summary[["panel", "planner", "configuration", "problems", "solved"]],
    )


def time_chart(site: Site, run: RunFolder) -> Chart:
    """Mean milliseconds of each part of planning time."""

    def made() -> pd.DataFrame:
        frame, _ = readable_attempts(run.results, _SPLIT)
        return time_split(frame.astype({"recall": object, "assist": object}))

    split = site.kept(("time split", stamp_of(run.results)), made)
    names = [*(part.name for part in PARTS), REST]
    colours = dict(zip(names, ("7", "4", "0", "6", "2", "5", "3", "1", "8"), strict=True))
    drawn = []
    for (panel, planner), rows in split.groupby(["panel", "planner"], sort=False):
        stacked = {
            str(label): [(str(part), float(ms)) for part, ms in zip(each["part"], each["ms"], strict=True)]
            for label, each in rows.groupby("configuration", sort=False)
        }
        end = 1.05 * max((sum(ms for _, ms in parts) for parts in stacked.values()), default=1.0)
        drawn.append(
            stacks(
                panel_title(str(panel), str(planner)), stacked, colours, "mean planning time, ms", end, "ms"
            )
        )
    return Chart(
        "time",
        "Where planning time goes",
        f"Mean milliseconds of each part over all problems. {PLANNING_TIME} Rest: between the parts.",
        drawn,
        split,
        [(colours[name], name) for name in names],
    )


def in_percent(fraction: float) -> str:
    """A tick of a fraction, in per cent."""
    return short(round(100.0 * fraction, 6))


def _tables(summary: pd.DataFrame, run: str) -> list[dict[str, Any]]:
    """A table a panel: every figure of the summary that is read most."""
    tables = []
    for panel, rows in summary.groupby("panel", sort=False):
        decimals = decimals_of(rows[["mean_ms", "median_ms"]].to_numpy(float)) if "median_ms" in rows else 2
        cells = []
        for row in rows.to_dict("records"):
            cells.append(
                {
                    "planner": planner_title(row["planner"]),
                    "configuration": row["configuration"],
                    "address": problems_address(run, str(panel), row["planner"], row["configuration"]),
                    "numbers": [
                        f"{row['mean_ms']:,.{decimals}f}",
                        *[f"{row[name]:,.{decimals}f}" for name in ("median_ms", "p90_ms") if name in row],
                        percent(row["solved"]),
                        _reduction(row),
                        share(row.get("slower", float("nan"))),
                    ],
                }
            )
        tables.append({"title": str(panel), "problems": int(rows["problems"].max()), "rows": cells})
    return tables


def _best(summary: pd.DataFrame) -> list[dict[str, str]]:
    """Of each panel, the configuration with the lowest mean time."""
    best = []
    for panel, rows in summary.groupby("panel", sort=False):
        row = rows.iloc[int(rows["mean_ms"].argmin())]
        ends = [100.0 * row.get(f"reduction_{end}", float("nan")) for end in ("low", "high")]
        between = f" [{ends[0]:.0f}, {ends[1]:.0f}]" if ends[0] == ends[0] else ""
        alone = row["configuration"] == BASELINE.label
        said = "" if alone else f": {100.0 * row['reduction']:.0f} % less{between}"
        best.append(
            {
                "panel": "combined memory" if panel == COMBINED else str(panel),
                "time": f"{row['mean_ms']:.3g} ms",
                "how": f"{planner_title(row['planner'])}, {row['configuration']}{said}",
            }
        )
    return best


def _reduction(row: dict[Any, Any]) -> str:
    nothing = float("nan")
    return reduction(row["reduction"], row.get("reduction_low", nothing), row.get("reduction_high", nothing))


def _stages(records: list[dict[str, Any]]) -> list[dict[str, str]]:
    return [
        {
            "stage": str(each.get("stage", "?")),
            "began": str(each.get("began", "")).replace("T", " ").replace("+00:00", " UTC"),
            "seconds": f"{float(each.get('seconds', 0.0)):,.1f}",
            "host": str(each.get("host", "")),
            "commit": str(each.get("commit", ""))[:10],
        }
        for each in records
    ]


def _places(site: Site, run: RunFolder) -> Iterator[tuple[str, str, str]]:
    """Where else to look: name, address if it is one, else the command that opens it."""
    tracking = os.environ.get("MLFLOW_TRACKING_URI", "")
    if "@" in tracking:  # a password may be in it
        tracking = f"{tracking.partition('://')[0]}://{tracking.rpartition('@')[2]}"
    if tracking.startswith(("http://", "https://")):
        yield "MLflow", tracking, ""
    else:
        yield (
            "MLflow",
            "",
            f"mlflow ui --backend-store-uri {tracking or f'sqlite:///{site.data.mlflow_database}'}",
        )
    server = os.environ.get("PREFECT_API_URL", "").removesuffix("/api")
    if server.startswith(("http://", "https://")):
        yield "Prefect", f"{server}/runs", ""
    else:
        yield "Prefect", "", f"motion-memory servers --data {site.data.path}"
    yield "Folder", "", str(run.path)
