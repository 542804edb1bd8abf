"""The runs of the data folder, the newest first; what an empty folder is told to do."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from dashboards.web.page import Page
from dashboards.web.query import Asked
from dashboards.web.site import Site
from storage.errors import StorageError
from storage.places.data_folder import RunFolder


def runs(site: Site, asked: Asked) -> Page:
    """Every run with what it was asked for and how far it is; broken ones say why they cannot be read."""
    rows = [_row(site, run) for run in site.runs()]
    return Page("runs.html.jinja", "Runs", values={"rows": rows, "data": str(site.data.path)})


def _row(site: Site, run: RunFolder) -> dict[str, Any]:
    when = datetime.fromtimestamp(run.settings.stat().st_mtime, UTC)
    row: dict[str, Any] = {"name": run.path.name, "when": f"{when:%Y-%m-%d %H:%M} UTC", "fault": ""}
    try:
        settings = site.settings(run)
        stages = list(dict.fromkeys(str(each.get("stage")) for each in site.stages(run)))
    except StorageError as error:
        return row | {"fault": str(error)}
    classes = [
        *settings["classes"],
        *(str(world).rstrip("/").rpartition("/")[2] for world in settings["worlds"]),
    ]
    return row | {
        "classes": ", ".join(classes),
        "planners": ", ".join(settings.get("planners", [])),
        "experiences": settings.get("experiences"),
        "problems": settings.get("test_problems"),
        "vehicle": settings.get("vehicle", "car"),
        "stages": ", ".join(stages) or "none yet",
        "state": _state(run, stages),
    }


def _state(run: RunFolder, stages: list[str]) -> str:
    if run.summary("csv").is_file():
        return "reported"
    if "benchmark" in stages:
        return "benchmarked"
    return "benchmark begun" if any(run.results.rglob("*.parquet")) else "not benchmarked yet"
