"""The runs of the data folder, the newest first; an empty folder says what to do."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from dashboards.web.data_reader import DataReader
from dashboards.web.page import Page
from dashboards.web.parameters import Parameters
from planners.world.vehicles.vehicle import name_of
from storage.errors import StorageError
from storage.places.run_folder import RunFolder


def runs(data: DataReader, params: Parameters) -> Page:
    """Every run with its settings and how far it is; one that cannot be read says why."""
    rows = [_row(data, run) for run in data.runs()]
    return Page("runs.html.jinja", "Runs", values={"rows": rows, "data": str(data.folder.path)})


def _row(data: DataReader, run: RunFolder) -> dict[str, Any]:
    when = datetime.fromtimestamp(run.settings.stat().st_mtime, UTC)
    row: dict[str, Any] = {"name": run.path.name, "when": f"{when:%Y-%m-%d %H:%M} UTC", "fault": ""}
    try:
        settings, vehicle = data.settings(run), name_of(data.vehicle(run))
        stages = list(dict.fromkeys(str(stage.get("stage")) for stage in data.stages(run)))
    except StorageError as error:
        return row | {"fault": str(error)}
    worlds = [str(world).rstrip("/").rpartition("/")[2] for world in settings["worlds"]]
    return row | {
        "classes": ", ".join([*settings["classes"], *worlds]),
        "planners": ", ".join(settings["planners"]),
        "experiences": settings["experiences"],
        "problems": settings.get("test_problems"),
        "vehicle": vehicle,
        "stages": ", ".join(stages) or "none yet",
        "state": _state(run, stages),
    }


def _state(run: RunFolder, stages: list[str]) -> str:
    if run.summary("csv").is_file():
        return "reported"
    if "benchmark" in stages:
        return "benchmarked"
    return "benchmark begun" if any(run.results.rglob("*.parquet")) else "not benchmarked yet"
