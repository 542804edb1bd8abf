"""Progress: with more experience, more runs, more retrainings: does planning become faster, and stay so?"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime
from typing import Any, Final, NamedTuple

import numpy as np
import pandas as pd

from dashboards.cells import PLANNING_TIME, panel_title, planner_title
from dashboards.palette import BLUE, GREEN, SERIES
from dashboards.statistics.experience_recall import experience_rows
from dashboards.statistics.panels import COMBINED
from dashboards.web.charts import Chart, Drawing, Line, lines
from dashboards.web.data_reader import DataReader, class_names
from dashboards.web.notices import NoticeError
from dashboards.web.page import Page, menu
from dashboards.web.pages.overview_page import faster, faster_ends
from dashboards.web.pages.retraining_charts import (
    retraining_charts,
    retraining_rows,
    watched_charts,
    watched_rows,
)
from dashboards.web.parameters import Parameters, link
from storage.errors import StorageError
from storage.places.run_folder import RunFolder
from storage.tables.configurations import configurations_in
from storage.tables.gained_experiences import all_gained_shards
from storage.tables.recalls import read_recalls
from storage.tables.watched import read_watched

MOST_RUNS: Final = 30  # that are read for this page, the newest
_MAY_DIFFER: Final = {  # settings in which runs of growing experience may differ
    "preset", "classes", "worlds", "planners", "assists", "test_problems", "combined", "strict", "candidates",
    "continual", "experiences",
}  # fmt: skip


class MeasuredRun(NamedTuple):
    """A run that has attempts."""

    folder: RunFolder
    settings: dict[str, Any]
    summary: pd.DataFrame
    when: datetime

    @property
    def name(self) -> str:
        """The name of the run."""
        return self.folder.path.name


def progress(data: DataReader, params: Parameters) -> Page:
    """All runs that were measured, by time and by experience, and what became of retrainings."""
    names = [run.path.name for run in data.runs()]
    run = params.one_of("run", names, "")
    measured, left_out = _measured_runs(data)
    versions, unreached = data.versions()
    seen, damaged = read_watched(data.folder.watched)
    measured_ways = (way for each in measured for way in configurations_in(each.summary))
    labels = list(dict.fromkeys(way.label for way in measured_ways if way != way.baseline))
    chosen = params.one_of("configuration", labels, _default(labels))
    of_runs = []
    if measured and chosen:
        of_runs = [*_continual(measured, chosen), *_recall(measured), *_run_after_run(measured, chosen)]
    of_retrainings, of_watching = list(retraining_charts(versions, set(names))), list(watched_charts(seen))
    values = {
        "path": params.path,
        "run": run,
        "left_out": [*left_out, *unreached, *damaged],
        "count": len(measured),
        "learned": list(_learned(data)),
        "menu": menu("configuration", "Configuration", labels, chosen),
        "rows": [_row(each) for each in reversed(measured)],
        "continual": any(chart.name == "continual" for chart in of_runs),
        "retrained": retraining_rows(versions, set(names)),
        "watched": watched_rows(seen),
        "of_runs": of_runs,
        "of_retrainings": of_retrainings,
        "of_watching": of_watching,
    }
    charts = [*of_runs, *of_retrainings, *of_watching]
    return Page("progress.html.jinja", "Progress", "Progress", run, values, charts)


def _default(labels: list[str]) -> str:
    """What a reader most wants to see: repair with the best recall, else the first there is."""
    repairs = [label for label in labels if label.startswith("repair") and "encoder" not in label]
    return (repairs or labels or [""])[0]


def _measured_runs(data: DataReader) -> tuple[list[MeasuredRun], list[str]]:
    """The runs that have attempts, the oldest first, and why others cannot be read."""
    measured, left_out = [], []
    for run in data.runs()[:MOST_RUNS]:
        try:
            settings, (summary, _) = data.settings(run), data.summary(run)
        except NoticeError:
            continue
        except StorageError as error:
            left_out.append(str(error))
            continue
        began = [stage.get("began") for stage in data.stages(run) if stage.get("stage") == "benchmark"]
        measured.append(MeasuredRun(run, settings, summary, _time(str(began[-1]) if began else "", run)))
    return sorted(measured, key=lambda each: each.when), left_out


def _time(words: str, run: RunFolder) -> datetime:
    try:
        time = datetime.fromisoformat(words)
    except ValueError:
        return datetime.fromtimestamp(run.settings.stat().st_mtime, UTC)
    return time if time.tzinfo else time.replace(tzinfo=UTC)


def _families(measured: list[MeasuredRun]) -> Iterator[tuple[str, list[MeasuredRun]]]:
    """Runs that differ in how many experiences they have, and in what of it they measure.

    Comes with the ending of their charts' names: nothing for the first family, then numbers.
    """
    groups: dict[str, dict[int, MeasuredRun]] = {}
    for each in measured:
        alike = {name: value for name, value in each.settings.items() if name not in _MAY_DIFFER}
        groups.setdefault(repr(sorted(alike.items())), {})[each.settings["experiences"]] = each
    families = [group for group in groups.values() if len(group) > 1]
    for number, group in enumerate(families):
        yield f"-{number}" if number else "", [each for _, each in sorted(group.items())]


def _of_configuration(tables: list[pd.DataFrame], configuration: str) -> pd.DataFrame:
    rows = pd.concat(tables)
    return rows[(rows["configuration"] == configuration) & (rows["panel"] != COMBINED)]


def _continual(measured: list[MeasuredRun], configuration: str) -> Iterator[Chart]:
    """Mean time relative to the planner alone, by number of experiences."""
    for ending, family in _families(measured):
        tables = [each.summary.assign(experiences=each.settings["experiences"]) for each in family]
        rows = _of_configuration(tables, configuration)
        drawings = [
            _times(panel_title(str(panel), str(planner)), of_panel.sort_values("experiences"))
            for (panel, planner), of_panel in rows.groupby(["panel", "planner"], sort=False)
            if of_panel["experiences"].nunique() > 1
        ]
        if drawings:
            yield Chart(
                f"continual{ending}",
                f"Continual improvement: {configuration} with more and more experience",
                "Mean planning time of the same planner without memory over that with memory, paired by "
                "problem, with 95 % intervals; above the line at 1 is faster. Each point is a run of its "
                "own, from the first stage on. "
                f"{PLANNING_TIME}",
                drawings,
                rows,
            )


def _percents(rows: pd.DataFrame, *columns: str) -> list[Any]:
    return [100.0 * rows[column].to_numpy(float) for column in columns]


def _times(title: str, rows: pd.DataFrame) -> Drawing:
    times, low, high = (
        rows[column].map(faster).to_numpy(float)
        for column in ("reduction", "reduction_low", "reduction_high")
    )
    line = Line(title, rows["experiences"].to_numpy(float), times, BLUE, low, high, dots=True)
    return lines(
        title, [line], "experiences a class", "times faster", y_ends=faster_ends(rows), ratios=True,
        x_ticks=line.x.tolist() if len(line.x) < 8 else None,
    )  # fmt: skip


def _recall(measured: list[MeasuredRun]) -> Iterator[Chart]:
    """Fresh hit@5 by number of experiences."""
    for ending, family in _families(measured):
        tables = [table for each in family if len(table := _recall_rows(each))]
        if len(tables) < 2:
            continue
        rows = pd.concat(tables)
        drawings = []
        for panel, of_panel in rows.groupby("panel", sort=False):
            of_panel = of_panel.sort_values("plans")
            x = of_panel["plans"].to_numpy(float)
            hit, low, high, oracle = _percents(of_panel, "hit", "low", "high", "oracle")
            drawn = [
                Line("hit@5", x, hit, BLUE, low, high, dots=True),
                Line("oracle", x, oracle, GREEN, dots=True),
            ]
            axes = ("plans in the memory", "problems, %")
            drawings.append(lines(str(panel), drawn, *axes, y_ends=(0.0, 100.0)))
        yield Chart(
            f"recall{ending}",
            "What memories recall, with more and more experience",
            "Share of fresh problems with a free plan among the first five that the encoder ranks, with 95 % "
            "intervals, and with any free plan at all (oracle). No planning time is in this chart.",
            drawings,
            rows,
            [(BLUE, "hit@5"), (GREEN, "oracle: any stored plan is free")],
        )


def _recall_rows(run: MeasuredRun) -> pd.DataFrame:
    """What the run's memories recalled for their own classes; empty if that was not measured."""
    shards = [shard for name in class_names(run.settings) for shard in run.folder.shards("recalls", name)]
    try:
        rows = read_recalls(shards)
    except (StorageError, ValueError):
        return pd.DataFrame()
    return experience_rows(rows[rows["memory"] == rows["class"]])


def _run_after_run(measured: list[MeasuredRun], configuration: str) -> Iterator[Chart]:
    """How many times faster planning is in each run, one after another."""
    tables = [
        run.summary.assign(run=run.name, number=float(number), when=f"{run.when:%Y-%m-%d %H:%M}")
        for number, run in enumerate(measured, start=1)
    ]
    rows = _of_configuration(tables, configuration)
    if len(measured) < 2 or not len(rows):
        return
    planners = {str(name): SERIES[i % len(SERIES)] for i, name in enumerate(rows["planner"].unique())}
    numbers = np.arange(1, len(measured) + 1, max(1, len(measured) // 8), dtype=float).tolist()
    drawings = []
    for panel, of_panel in rows.groupby("panel", sort=False):
        drawn = [
            Line(
                planner_title(str(planner)), of_planner["number"].to_numpy(float),
                of_planner["reduction"].map(faster).to_numpy(float), planners[str(planner)], dots=True,
            )
            for planner, of_planner in of_panel.groupby("planner", sort=False)
        ]  # fmt: skip
        ends = faster_ends(
            of_panel.assign(reduction_low=of_panel["reduction"], reduction_high=of_panel["reduction"])
        )
        drawings.append(
            lines(
                str(panel), drawn, "run, the oldest first (table below)", "times faster",
                y_ends=ends, x_ends=(0.8, len(measured) + 0.2), x_ticks=numbers, ratios=True,
            )
        )  # fmt: skip
    yield Chart(
        "runs",
        f"Run after run: {configuration}",
        "How many times faster planning is with memory in each run of this folder. Runs may differ in their "
        f"settings and machines: Compare shows two of them paired. {PLANNING_TIME}",
        drawings,
        rows,
        [(colour, planner_title(planner)) for planner, colour in planners.items()],
    )


def _learned(data: DataReader) -> Iterator[dict[str, Any]]:
    """What was learned from solving: files and the newest change, by vehicle."""
    for folder in data.folder.gained_folders():
        times = []
        for shard in all_gained_shards(folder):
            with suppress(FileNotFoundError):  # it has just been merged
                times.append(shard.stat().st_mtime)
        if times:
            newest = datetime.fromtimestamp(max(times), UTC)
            yield {"vehicle": folder.name, "files": len(times), "newest": f"{newest:%Y-%m-%d %H:%M} UTC"}


def _row(run: MeasuredRun) -> dict[str, Any]:
    return {
        "name": run.name, "address": f"/runs/{run.name}", "when": f"{run.when:%Y-%m-%d %H:%M}",
        "experiences": run.settings["experiences"], "objective": run.settings.get("objective", ""),
        "compare": link("/compare", {"other": run.name}),
    }  # fmt: skip
