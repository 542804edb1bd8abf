"""Compare how useful a memory is at work with its benchmark, and send Prefect events about it.

``motion-memory.solved`` is sent after every file of problems; ``motion-memory.drift`` too, if hits fell or
total times rose. They go to the server at PREFECT_API_URL, or to the one that ``motion-memory serve`` runs
for a data folder.
"""

from __future__ import annotations

import asyncio
import json
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from dashboards.verdicts.drift import Drift, Usefulness, drifts, library_at_work, usefulness
from storage.errors import StorageError
from storage.places.data_folder import MARK, DataFolder
from storage.places.run_folder import RunFolder
from storage.tables.attempts import read_attempts, readable_attempts
from storage.tables.watched import add_watched
from tasks.registry.champion_registry import CHAMPION, Registry
from tasks.servers.access import auth_environment
from tasks.servers.prefect_server import CLIENT, running_server, set_environment
from tasks.settings.environment import default_data
from tasks.settings.errors import RunError

SOLVED: Final = "motion-memory.solved"
DRIFT: Final = "motion-memory.drift"
_COLUMNS: Final = (
    *("planner", "assist", "top_k", "recall", "polished"),
    *("hit", "source", "problem_class", "planning_seconds", "duration_s"),
)
RESOURCE: Final = "prefect.resource.id"  # the label of events that says of which memory they are ...
RESOURCE_OF: Final = "motion-memory.memory."  # ... and how that begins
RUN, LIBRARY = "run", "library"
KIND: Final = "motion-memory.kind"  # the label of events that says which of these a memory is of
_MODEL: Final = re.compile(r"models:/(?P<name>[^/@]+)(?:@(?P<alias>[^/]+)|/(?P<number>\d+))")


class BenchmarkedMemory(NamedTuple):
    """A memory, and how useful it was in its benchmark."""

    name: str  # as events name it: ``name/version``, or ``run/memory``
    benchmark: Mapping[str, Usefulness]  # by planner and configuration, or class of questions
    data_folder: Path  # the folder that the memory belongs to
    kind: str = RUN  # of memory: a run's, or a library


def benchmarked_memory(memory: str | None) -> BenchmarkedMemory | None:
    """Look up the benchmark of a memory: of a registered version, or of the run whose folder holds it.

    Args:
        memory: the value of ``--memory``: a folder or a model's address. None means that no memory is used.

    Returns:
        the memory, or None if it has no benchmark or the registry does not answer.
    """
    model = _MODEL.fullmatch(memory) if memory else None
    try:
        if model is not None:
            return _registered(**model.groupdict())
        return _of_run(Path(memory)) if memory and _MODEL.match(memory) is None else None
    except (RunError, StorageError, TypeError, ValueError):
        return None


def _registered(name: str, alias: str | None, number: str | None) -> BenchmarkedMemory | None:
    """The benchmark of a registered version, which is in its tags."""
    data_folder = default_data().absolute()
    registry = Registry(DataFolder(data_folder))
    if number is None:
        version = registry.aliased(name, alias or CHAMPION)
    else:
        version = next(
            (version for version in registry.versions(name) if str(version.number) == number), None
        )
    if version is None or not version.tag("benchmark"):
        return None
    figures = json.loads(version.tag("benchmark"))
    benchmark = {configuration: Usefulness(**values) for configuration, values in figures.items()}
    kind = LIBRARY if version.is_library else RUN
    return BenchmarkedMemory(f"{name}/{version.number}", benchmark, data_folder, kind)


def _of_run(folder: Path) -> BenchmarkedMemory | None:
    """The benchmark of a memory in a run's folder, from the attempts of that run."""
    memory_folder = folder.absolute()
    run = memory_folder.parent.parent
    results = RunFolder(run).results / memory_folder.name
    if memory_folder.parent.name != "memories" or not results.is_dir():
        return None
    rows = read_attempts(results, ("recalled",))
    benchmark = usefulness(rows[rows["memory"] == memory_folder.name])
    return BenchmarkedMemory(f"{run.name}/{memory_folder.name}", benchmark, run.parent.parent)


def usefulness_at_work(memory: BenchmarkedMemory, rows: Path) -> dict[str, Usefulness]:
    """How useful a memory was in a file of attempts, by planner and configuration.

    A file may hold problems of several kinds, which are answered by whole plans, by moved ones or by parts of
    plans. For the memory of a run each is another configuration: what is recalled is part of it. For a
    library, which is there for all of them, each class of questions is one.

    Args:
        memory: the memory.
        rows: the file, .parquet.
    """
    attempts, _ = readable_attempts(rows, _COLUMNS)
    return library_at_work(attempts, memory.benchmark) if memory.kind == LIBRARY else usefulness(attempts)


def report_drift(memory: BenchmarkedMemory, now: Mapping[str, Usefulness], data: Path | None) -> list[str]:
    """Compare a memory with its benchmark, store the comparison, and send it to Prefect.

    Neither a failure to store nor a failure to send is raised: the problems are solved.

    Args:
        memory: the memory with its benchmark.
        now: how useful the memory was just now, by planner and configuration.
        data: a data folder whose Prefect server also receives the events, besides the default one, or None.

    Returns:
        a line for each comparison.
    """
    comparisons = drifts(memory.name, now, memory.benchmark)
    if memory.kind == LIBRARY and not comparisons:
        return [f"{memory.name}: not compared, as libraries are judged with the lattice, repair, polished"]
    lines = [str(drift) for drift in comparisons]
    lines += _store(memory.data_folder, comparisons)
    any_drifted = any(drift.has_drifted for drift in comparisons)
    server = _server([data, default_data()]) if comparisons else None
    if server is None:
        serve = "serve-library" if memory.kind == LIBRARY else "serve"
        return (
            lines + [f"no Prefect server received the event: `motion-memory {serve}` runs one"] * any_drifted
        )
    url = server["PREFECT_API_URL"]
    try:
        _send(server, events_of(comparisons), memory.kind)
    except Exception as error:  # whatever fails in Prefect, the problems are solved
        reason = (str(error) or type(error).__name__).splitlines()[0]
        return [*lines, f"Prefect at {url} did not receive the events: {reason}"]
    return lines + [f"event {DRIFT} sent to {url}"] * any_drifted


def _store(data_folder: Path, comparisons: Sequence[Drift]) -> list[str]:
    """Store comparisons in the memory's data folder, for the dashboard; return a line if that fails."""
    if not comparisons or not (data_folder / MARK).is_file():
        return []
    try:
        add_watched(DataFolder(data_folder).watched, [drift.to_row() for drift in comparisons])
    except StorageError as error:
        return [f"not stored: {error}"]
    return []


def _server(folders: Sequence[Path | None]) -> dict[str, str] | None:
    """Variables that make a client of the user's server, or of one that runs for one of the data folders."""
    if os.environ.get("PREFECT_API_URL"):
        environment = auth_environment() | os.environ
        return {name: environment[name] for name in CLIENT if name in environment}
    for folder in folders:
        server = None if folder is None else running_server(folder.absolute())
        if server is not None and folder is not None:
            set_environment(folder.absolute())
            return server.environment
    return None


def events_of(comparisons: Sequence[Drift]) -> list[tuple[str, Drift]]:
    """The events of a file: ``SOLVED`` for each comparison, ``DRIFT`` once, as one retraining is enough."""
    drifted = [drift for drift in comparisons if drift.has_drifted]
    clearest = sorted(drifted, key=lambda drift: min(drift.p_value, drift.later_p_value))[:1]
    return [*((SOLVED, drift) for drift in comparisons), *((DRIFT, drift) for drift in clearest)]


def _send(server: Mapping[str, str], events: Sequence[tuple[str, Drift]], kind: str) -> None:
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.actions import ArtifactCreate
    from prefect.events import Event, Resource
    from prefect.events.clients import PrefectEventsClient
    from prefect.settings import temporary_settings

    from tasks.fan_out.progress_artifact import artifact_key

    def event(name: str, drift: Drift) -> Any:
        resource = Resource(
            {
                RESOURCE: f"{RESOURCE_OF}{drift.memory}",
                "prefect.resource.name": drift.memory,
                KIND: kind,
            }
        )
        return Event(event=name, resource=resource, payload=drift.to_json())

    async def send_events() -> None:
        async with PrefectEventsClient(reconnection_attempts=1) as client:
            for name, drift in events:
                await client.emit(event(name, drift))

    with temporary_settings(server):
        asyncio.run(send_events())
        markdown = "".join(f"- {drift}\n" for name, drift in events if name == SOLVED)
        key = artifact_key(f"watch-{events[0][1].memory}")
        artifact = ArtifactCreate(key=key, type="markdown", description="Hits and times", data=markdown)
        with get_client(sync_client=True) as client:  # an artifact outside of a flow: Prefect's own way warns
            client.create_artifact(artifact)
