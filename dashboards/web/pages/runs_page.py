"""The runs of the data folder, the newest first, and its libraries; an empty folder says what to do."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from dashboards.cells import NOTHING, planner_title
from dashboards.statistics.headline import times_faster, used_by_default
from dashboards.statistics.panels import COMBINED
from dashboards.web.data_reader import DataReader, class_names
from dashboards.web.page import Page
from dashboards.web.parameters import Parameters
from planners.world.vehicles.vehicle import name_of
from storage.archives.libraries import LibraryFacts
from storage.errors import StorageError
from storage.places.run_folder import RunFolder
from storage.tables.configurations import as_found


def runs(data: DataReader, params: Parameters) -> Page:
    """Every run with its settings and how far it is, and every library; what cannot be read says why."""
    found, (libraries, faults) = data.runs(), data.libraries()
    values = {
        "rows": [_row(data, run) for run in found],
        "data": str(data.folder.path),
        "newest": found[0].path.name if found else "",
        "libraries": [_row_of_library(name, facts) for name, facts in libraries.items()],
        "faults": faults,
    }
    return Page("runs.html.jinja", "Runs", values=values)


def _row(data: DataReader, run: RunFolder) -> dict[str, Any]:
    when = datetime.fromtimestamp(run.settings.stat().st_mtime, UTC)
    row: dict[str, Any] = {"name": run.path.name, "when": f"{when:%Y-%m-%d %H:%M}", "fault": ""}
    try:
        settings, vehicle = data.settings(run), name_of(data.vehicle(run))
        stages = list(dict.fromkeys(str(stage.get("stage")) for stage in data.stages(run)))
    except StorageError as error:
        return row | {"fault": str(error)}
    return row | {
        "classes": ", ".join(class_names(settings)),
        "planners": ", ".join(map(planner_title, settings["planners"])),
        "experiences": settings["experiences"],
        "seed": settings.get("seed"),
        "objective": settings.get("objective"),
        "result": _result(data, run),
        "took": _took(data, run),
        "problems": settings.get("test_problems"),
        "vehicle": vehicle,
        "state": _state(run, stages),
    }


def _row_of_library(name: str, facts: LibraryFacts) -> dict[str, Any]:
    return {
        "name": name, "address": f"/libraries/{name}/try", "vehicle": name_of(facts.vehicle),
        "plans": f"{len(facts.questions):,}", "questions": f"{len(set(facts.questions)):,}",
        "class": facts.class_name, "scales": ", ".join(f"{scale:g}" for scale in facts.scales),
    }  # fmt: skip


def _result(data: DataReader, run: RunFolder) -> str:
    """How many times faster planning became and how much sooner robots arrive, means over classes."""
    if not run.summary("csv").is_file():  # to make it here would take seconds
        return NOTHING
    try:
        summary, _ = data.summary(run)
    except StorageError:
        return NOTHING
    own = as_found(summary[summary["panel"] != COMBINED])
    if own.empty or used_by_default(own).empty:
        return NOTHING
    faster, sooner_s = times_faster(own), used_by_default(own)["sooner_s"].mean()
    arrives = "sooner" if sooner_s >= 0.0 else "later"
    told = f"{faster:.1f} × faster", "" if sooner_s != sooner_s else f"{abs(sooner_s):.1f} s {arrives}"
    return ", ".join(each.replace(" ", "\N{NO-BREAK SPACE}") for each in told if each)


def _took(data: DataReader, run: RunFolder) -> str:
    """Seconds that all stages took together, in the unit that suits them."""
    seconds = sum(float(stage.get("seconds", 0.0)) for stage in data.stages(run))
    return f"{seconds / 60.0:.1f} min" if seconds >= 100.0 else f"{seconds:.0f} s" if seconds else NOTHING


def _state(run: RunFolder, stages: list[str]) -> str:
    if run.summary("csv").is_file():
        return "reported"
    if "benchmark" in stages:
        return "benchmarked"
    return "benchmark begun" if any(run.results.rglob("*.parquet")) else "not benchmarked yet"
