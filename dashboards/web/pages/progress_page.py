"""Progress: more experience, more runs, retrainings: is planning getting faster, and does it stay so?"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any, Final, NamedTuple

import numpy as np
import pandas as pd

from dashboards.figures.experience_curve import experience_rows
from dashboards.figures.style import planner_title
from dashboards.statistics.panels import COMBINED
from dashboards.web.charts import Chart, Line, Panel, lines
from dashboards.web.notices import NoticeError
from dashboards.web.page import Page
from dashboards.web.pages.overview_page import PLANNING_TIME, panel_title, summary_of
from dashboards.web.pages.retrainings_page import (
    retrained_charts,
    retrained_rows,
    watched_charts,
    watched_rows,
)
from dashboards.web.query import Asked, link
from dashboards.web.site import Site, stamp_of
from storage.errors import StorageError
from storage.places.data_folder import RunFolder
from storage.tables.recalls import read_recalls
from storage.tables.watched import read_watched

MOST_RUNS: Final = 30  # that are read for this page, the newest
_MAY_DIFFER: Final = {
    "preset", "classes", "worlds", "planners", "assists", "test_problems", "combined", "strict", "candidates",
    "continual", "experiences",
}  # fmt: skip
_COLOURS: Final = ("0", "1", "2", "3", "5", "4", "6", "7")


class Made(NamedTuple):
    """A run with its summary."""

    run: RunFolder
    settings: dict[str, Any]
    summary: pd.DataFrame
    when: datetime


def progress(site: Site, asked: Asked) -> Page:
    """All runs that were measured, by time and by experience."""
    configuration = asked.text("configuration")
    known = [each.path.name for each in site.runs()]
    run = asked.one_of("run", known, "")
    found, left_out = _made(site)
    retrained, unreached = site.retrained()
    seen, damaged = read_watched(site.data.watched)
    labels = list(
        dict.fromkeys(label for each in found for label in each.summary["configuration"] if label != "none")
    )
    chosen = asked.one_of("configuration", labels, _default(labels)) if configuration else _default(labels)
    charts = []
    if found and chosen:
        charts = [*_continual(found, chosen), *_recall(site, found), *_over_time(found, chosen)]
    of_retrainings = list(retrained_charts(retrained, set(known)))
    of_watching = list(watched_charts(seen))
    values = {
        "path": asked.path,
        "run": run,
        "left_out": [*left_out, *unreached, *damaged],
        "count": len(found),
        "learned": list(_learned(site)),
        "menu": {
            "name": "configuration",
            "title": "Configuration",
            "value": chosen,
            "options": [(label, label) for label in labels],
        },
        "rows": [_row(each) for each in reversed(found)],
        "continual": any(chart.name == "continual" for chart in charts),
        "retrained": retrained_rows(retrained, set(known)),
        "watched": watched_rows(seen),
        "of_runs": charts,
        "of_retrainings": of_retrainings,
        "of_watching": of_watching,
    }
    shown = [*charts, *of_retrainings, *of_watching]
    return Page("progress.html.jinja", "Progress", "Progress", run, values, shown)


def _default(labels: list[str]) -> str:
    """What a reader most wants to see: repair, by the best recall, else the first there is."""
    wanted = [label for label in labels if label.startswith("repair") and "centroid" not in label]
    return (wanted or labels or [""])[0]


def _made(site: Site) -> tuple[list[Made], list[str]]:
    """The runs that have attempts, the oldest first, and those that cannot be read."""
    found, left_out = [], []
    for run in site.runs()[:MOST_RUNS]:
        try:
            settings = site.settings(run)
            summary, _ = summary_of(site, run)
        except NoticeError:
            continue
        except StorageError as error:
            left_out.append(str(error))
            continue
        began = [str(each.get("began", "")) for each in site.stages(run) if each.get("stage") == "benchmark"]
        found.append(Made(run, settings, summary, _time(began[-1] if began else "", run)))
    return sorted(found, key=lambda each: each.when), left_out


def _time(said: str, run: RunFolder) -> datetime:
    try:
        found = datetime.fromisoformat(said)
    except ValueError:
        return datetime.fromtimestamp(run.settings.stat().st_mtime, UTC)
    return found if found.tzinfo else found.replace(tzinfo=UTC)


def _families(found: list[Made]) -> Iterator[list[Made]]:
    """Runs that differ in how many experiences they have, and in what of it they measure."""
    groups: dict[str, dict[int, Made]] = {}
    for each in found:
        alike = {name: value for name, value in each.settings.items() if name not in _MAY_DIFFER}
        groups.setdefault(repr(sorted(alike.items())), {})[int(each.settings.get("experiences", 0))] = each
    for group in groups.values():
        if len(group) > 1:
            yield [each for _, each in sorted(group.items())]


def _continual(found: list[Made], configuration: str) -> Iterator[Chart]:
    """Mean time relative to the planner alone, by number of experiences."""
    for number, family in enumerate(_families(found)):
        rows = pd.concat([each.summary.assign(experiences=each.settings["experiences"]) for each in family])
        rows = rows[(rows["configuration"] == configuration) & (rows["panel"] != COMBINED)]
        panels = []
        for (panel, planner), of_panel in rows.groupby(["panel", "planner"], sort=False):
            if of_panel["experiences"].nunique() > 1:
                panels.append(
                    _by(of_panel, "experiences", panel_title(str(panel), str(planner)), "experiences a class")
                )
        if panels:
            name = "continual" if number == 0 else f"continual-{number}"
            yield Chart(
                name,
                f"Continual improvement: {configuration} with more and more experience",
                "Less mean planning time than the same planner without memory, paired by problem, with 95 % "
                f"intervals; each point is a run of its own, from the first stage on. {PLANNING_TIME}",
                panels,
                rows,
            )


def _by(rows: pd.DataFrame, column: str, title: str, axis: str) -> Panel:
    rows = rows.sort_values(column)
    low, high = (
        100.0 * rows.get(name, rows["reduction"]).to_numpy(float)
        for name in ("reduction_low", "reduction_high")
    )
    line = Line(
        title, rows[column].to_numpy(float), 100.0 * rows["reduction"].to_numpy(float), "0", low, high, True
    )
    ends = (min(0.0, max(-100.0, float(np.nanmin(low)))), 100.0)
    return lines(title, [line], axis, "less planning time, %", y_ends=ends)


def _recall(site: Site, found: list[Made]) -> Iterator[Chart]:
    """Fresh hit@5 by number of experiences."""
    for number, family in enumerate(_families(found)):
        tables = []
        for each in family:
            shards = [
                shard for name in each.settings["classes"] for shard in each.run.shards("recalls", str(name))
            ]
            if shards:
                try:
                    rows = read_recalls(shards)
                except (StorageError, ValueError):
                    continue
                own = rows[rows["memory"] == rows["class"]]
                tables.append(experience_rows(own))
        tables = [table for table in tables if len(table)]
        if len(tables) < 2:
            continue
        rows = pd.concat(tables)
        panels = []
        for panel, of_panel in rows.groupby("panel", sort=False):
            of_panel = of_panel.sort_values("plans")
            x = of_panel["plans"].to_numpy(float)
            hit, low, high, oracle = (
                100.0 * of_panel[name].to_numpy(float) for name in ("hit", "low", "high", "oracle")
            )
            drawn = [Line("hit@5", x, hit, "0", low, high, True), Line("oracle", x, oracle, "2", dots=True)]
            panels.append(lines(str(panel), drawn, "plans in the memory", "problems, %", y_ends=(0.0, 100.0)))
        yield Chart(
            "recall" if number == 0 else f"recall-{number}",
            "What memories recall, with more and more experience",
            "Share of fresh problems with a free plan among the first five that the encoder ranks, with 95 % "
            "intervals, and with any free plan at all (oracle). No planning time is in this chart.",
            panels, rows, [("0", "hit@5"), ("2", "oracle: any stored plan is free")],
        )  # fmt: skip


def _over_time(found: list[Made], configuration: str) -> Iterator[Chart]:
    """Reduction run after run."""
    tables = [
        each.summary.assign(run=each.run.path.name, number=float(i + 1), when=f"{each.when:%Y-%m-%d %H:%M}")
        for i, each in enumerate(found)
    ]
    rows = pd.concat(tables)
    rows = rows[(rows["configuration"] == configuration) & (rows["panel"] != COMBINED)]
    if len(found) < 2 or not len(rows):
        return
    panels = []
    for panel, of_panel in rows.groupby("panel", sort=False):
        drawn = []
        for i, (planner, of_planner) in enumerate(of_panel.groupby("planner", sort=False)):
            y = 100.0 * of_planner["reduction"].to_numpy(float)
            drawn.append(
                Line(
                    planner_title(str(planner)),
                    of_planner["number"].to_numpy(float),
                    y,
                    _COLOURS[i % 8],
                    dots=True,
                )
            )
        low = min(0.0, max(-100.0, 100.0 * float(of_panel["reduction"].min())))
        numbers = np.arange(1, len(found) + 1, max(1, len(found) // 8), dtype=float).tolist()
        panels.append(
            lines(
                str(panel),
                drawn,
                "run, the oldest first (table below)",
                "less planning time, %",
                y_ends=(low, 100.0),
                x_ends=(0.8, len(found) + 0.2),
                x_ticks=numbers,
            )
        )
    planners = [str(each) for each in rows["planner"].drop_duplicates()]
    yield Chart(
        "runs",
        f"Run after run: {configuration}",
        "Reduction of the mean planning time in each run of this folder. Runs may differ in their "
        "settings and "
        f"machines: Compare shows two of them paired. {PLANNING_TIME}",
        panels, rows, [(_COLOURS[i % 8], planner_title(name)) for i, name in enumerate(planners)],
    )  # fmt: skip


def _learned(site: Site) -> Iterator[dict[str, Any]]:
    """What was learned on the job: files, newest change."""
    for folder in sorted((site.data.path / "learned").glob("[!.]*/")):
        stamps = stamp_of(folder)
        shards = [each for each in stamps if each[0].endswith(".parquet") and "/snapshots/" not in each[0]]
        if shards:
            newest = datetime.fromtimestamp(max(each[1] for each in shards) / 1e9, UTC)
            yield {"vehicle": folder.name, "files": len(shards), "newest": f"{newest:%Y-%m-%d %H:%M} UTC"}


def _row(each: Made) -> dict[str, Any]:
    name = each.run.path.name
    return {
        "name": name, "address": f"/runs/{name}", "when": f"{each.when:%Y-%m-%d %H:%M}",
        "experiences": each.settings.get("experiences"), "objective": each.settings.get("objective", ""),
        "compare": link("/compare", {"other": name}),
    }  # fmt: skip
