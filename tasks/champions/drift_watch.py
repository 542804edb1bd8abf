"""Watching a memory at work: what it answers now beside its benchmark, told to Prefect as events.

``motion-memory.solved`` after every file of problems, ``motion-memory.drift`` where hits have fallen. They go
to the server at PREFECT_API_URL, or to the one that ``motion-memory serve`` runs for a data folder.
"""

from __future__ import annotations

import asyncio
import json
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from dashboards.verdicts.drift import Drift, Usefulness, drifts, usefulness
from storage.errors import StorageError
from storage.places.data_folder import MARK, DataFolder
from storage.places.run_folder import RunFolder
from storage.tables.attempts import read_attempts
from storage.tables.watched import add_watched
from tasks.registry.champion_registry import CHAMPION, Registry
from tasks.servers.access import auth_environment
from tasks.servers.prefect_server import CLIENT, running_server, set_environment
from tasks.settings.environment import default_data
from tasks.settings.errors import RunError

SOLVED: Final = "motion-memory.solved"
DRIFT: Final = "motion-memory.drift"
_MODEL: Final = re.compile(r"models:/(?P<name>[^/@]+)(?:@(?P<alias>[^/]+)|/(?P<number>\d+))")


class Watched(NamedTuple):
    """A memory with what its benchmark says of it."""

    name: str  # with its version, where it has one
    benchmark: Mapping[str, Usefulness]
    home: Path  # the data folder that it is of


def watched(memory: str | None) -> Watched | None:
    """The benchmark of a memory, if there is one: of a registered version, or of the run that it lies in.

    None where nothing is known, or the registry does not answer: solving does not depend on it.
    """
    model = _MODEL.fullmatch(memory) if memory else None
    try:
        if model is not None:
            return _registered(**model.groupdict())
        return _of_run(Path(memory)) if memory and _MODEL.match(memory) is None else None
    except (RunError, StorageError, TypeError, ValueError):
        return None


def _registered(name: str, alias: str | None, number: str | None) -> Watched | None:
    home = default_data().absolute()
    registry = Registry(DataFolder(home))
    if number is None:
        version = registry.aliased(name, alias or CHAMPION)
    else:
        version = next((each for each in registry.versions(name) if str(each.number) == number), None)
    if version is None or not version.tag("benchmark"):
        return None
    known = json.loads(version.tag("benchmark"))
    return Watched(
        f"{name}/{version.number}", {key: Usefulness(**value) for key, value in known.items()}, home
    )


def _of_run(folder: Path) -> Watched | None:
    """Of a memory's own folder, whose run measured its class."""
    place = folder.absolute()
    results = RunFolder(place.parent.parent).results / place.name
    if place.parent.name != "memories" or not results.is_dir():
        return None
    rows = read_attempts(results, ("recalled",))
    run, of_memory = place.parent.parent, rows[rows["memory"] == place.name]
    return Watched(f"{run.name}/{place.name}", usefulness(of_memory), run.parent.parent)


def watch(known: Watched | None, now: Mapping[str, Usefulness], data: Path | None) -> list[str]:
    """Compare with the benchmark, keep it, and tell Prefect, if there is one to tell; the lines to print."""
    if known is None:
        return []
    found = drifts(known.name, now, known.benchmark)
    lines = [str(each) for each in found]
    lines += _keep(known.home, found)
    fallen = [each for each in found if each.has_fallen]
    server = _server([data, default_data()]) if found else None
    if server is None:
        return lines + ["no Prefect server to tell: `motion-memory serve` runs one"] * bool(fallen)
    place = server["PREFECT_API_URL"]
    try:
        _send(server, found)
    except Exception as error:  # solving is done, and told; who watches can be asked again
        reason = (str(error) or type(error).__name__).splitlines()[0]
        return [*lines, f"Prefect at {place} was not told: {reason}"]
    return lines + [f"event {DRIFT} sent to {place}"] * bool(fallen)


def _keep(home: Path, found: Sequence[Drift]) -> list[str]:
    """Write down what was seen in the memory's data folder, for the dashboard; a line where that fails."""
    if not found or not (home / MARK).is_file():
        return []
    try:
        add_watched(DataFolder(home).watched, [each.to_row() for each in found])
    except StorageError as error:  # as with telling: solving is done
        return [f"not kept: {error}"]
    return []


def _server(folders: Sequence[Path | None]) -> dict[str, str] | None:
    """What makes a client of the user's server, or of one that runs for a data folder."""
    if os.environ.get("PREFECT_API_URL"):
        environment = auth_environment() | os.environ
        return {name: environment[name] for name in CLIENT if name in environment}
    for folder in folders:
        server = None if folder is None else running_server(folder.absolute())
        if server is not None and folder is not None:
            set_environment(folder.absolute())
            return server.environment
    return None


def _send(server: Mapping[str, str], found: Sequence[Drift]) -> None:
    from prefect.artifacts import create_markdown_artifact
    from prefect.events import Event, Resource
    from prefect.events.clients import PrefectEventsClient
    from prefect.settings import temporary_settings

    from tasks.fan_out.progress_artifact import artifact_key

    def event(name: str, drift: Drift) -> Any:
        resource = Resource(
            {
                "prefect.resource.id": f"motion-memory.memory.{drift.memory}",
                "prefect.resource.name": drift.memory,
            }
        )
        return Event(event=name, resource=resource, payload=drift.to_json())

    async def send() -> None:
        async with PrefectEventsClient(reconnection_attempts=1) as client:
            for drift in found:
                await client.emit(event(SOLVED, drift))
                if drift.has_fallen:
                    await client.emit(event(DRIFT, drift))

    with temporary_settings(server):
        asyncio.run(send())
        told = "".join(f"- {each}\n" for each in found)
        create_markdown_artifact(
            told, key=artifact_key(f"watch-{found[0].memory}"), description="Hits and times"
        )
