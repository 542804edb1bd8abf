"""Retrain a library: gather a challenger with what was learned since, judge it, and promote it if better."""

from __future__ import annotations

import logging
import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from dashboards.cells import CellTable, as_markdown
from dashboards.verdicts.promotion import judgement_line, judgement_markdown, judgement_tables
from storage.places.data_folder import DataFolder
from storage.places.scratch import scratch_folder
from storage.tables.gained_experiences import gained_shards, snapshot_ids
from storage.vehicles.vehicle_files import label_of
from tasks.champions.conclude import settle, summary_of, verdict_on
from tasks.champions.new_experience import note_verdict
from tasks.fan_out.keys import key_of
from tasks.inputs.gained_on_the_job import snapshot_of_questions
from tasks.libraries.challenger import add_learned, gather_anew
from tasks.libraries.judge_library import (
    CHALLENGER,
    CHAMPION,
    Judging,
    LibraryJudgement,
    Side,
    judge_library,
)
from tasks.libraries.pending_library import LibraryRetraining, PendingLibrary, pending_library
from tasks.registry.champion_registry import Registry, Version
from tasks.registry.model_uris import memory_digest
from tasks.registry.register_library import log_library
from tasks.requests.gather import (
    GatherFlow,
    SourceCounts,
    gathered_metrics,
)
from tasks.requests.question_sources import settled_source
from tasks.session.folder_lock import locked_folder
from tasks.settings.errors import RunError, UsageError
from tasks.tracking.artifacts import publish_judgements
from tasks.tracking.logbook import judgement_metrics
from tasks.tracking.mlflow_runs import tracker

_LOG = logging.getLogger(__name__)


class RetrainedLibrary(NamedTuple):
    """A library that was gathered and judged."""

    folder: Path
    counts: Sequence[SourceCounts]  # what came of each source
    version: Version
    verdict: str
    summary: str  # one line
    tables: Sequence[CellTable]  # of the judgement


def retrain_library(
    data: Path, asked: LibraryRetraining, workers: int = 1, flow: GatherFlow | None = None
) -> RetrainedLibrary | None:
    """Gather a library with what was learned since the champion, and promote it if robots are there sooner.

    Questions of files and learned ones are split by their ids: one in four is never gathered, and only
    judges. The first library becomes the champion. If the command is killed, the same command goes on.

    Args:
        data: the data folder.
        asked: which library, and how.
        workers: number of worker processes.
        flow: gathers in worker processes (``gather``), in a flow that takes artifacts; None does everything
            in this process, and publishes none.

    Returns:
        the library and the verdict on it; None if there is nothing new.

    Raises:
        UsageError: the data folder is in object storage, or there is nothing to gather from.
        StorageError: a source cannot be read.
        RunError: the registry cannot be reached, no question can be answered, none is held back to judge
            by, or somebody changed the champion meanwhile.
    """
    with locked_folder(data) as folder:
        if folder.is_remote:
            raise UsageError(f"{data} is in object storage; libraries are retrained in a folder on a disk.")
        vehicle = asked.settings.vehicle
        asked = asked._replace(sources=tuple(settled_source(each, vehicle) for each in asked.sources))
        registry = Registry(folder)
        note_verdict(registry, registry.aliased(asked.registered))
        pending = pending_library(folder, asked, registry)
        _LOG.info(pending.line)
        if not pending.is_due:
            return None
        return _retrained(folder, asked, registry, pending, workers, flow)


def _retrained(
    folder: DataFolder,
    asked: LibraryRetraining,
    registry: Registry,
    pending: PendingLibrary,
    workers: int,
    flow: GatherFlow | None,
) -> RetrainedLibrary:
    vehicle, number = asked.settings.vehicle, pending.number
    snapshot = None
    if gained_shards(folder.gained_questions(label_of(vehicle))):
        snapshot = snapshot_of_questions(folder.place, vehicle, f"{asked.name}-{number:04d}")
    learned = "" if snapshot is None else snapshot.stem
    sources = (*asked.sources, *([] if snapshot is None else [str(snapshot)]))
    before = pending.champion
    made_of = key_of(asked.request(Path(), sources).asked, "" if before is None else before.number)
    title = f"{asked.name}-{number:04d}-{made_of[:6]}"
    out = folder.libraries / title
    with scratch_folder() as scratch:
        champion = None if before is None else registry.fetch(before, str(scratch))
        if before is None or champion is None or snapshot is None or pending.is_anew:
            counts = gather_anew(asked, sources, snapshot, out, workers, flow)
        else:
            seen = snapshot_ids(snapshot.parents[1], before.tag("learned"))
            counts = add_learned(asked, champion, snapshot, seen, out, workers, flow)
        judgement = _judged(folder, asked, number, sources, champion, out)
    ours = None if judgement is None else judgement.champion
    verdict = verdict_on(ours, asked.approve)
    parameters = {
        "sources": shlex.join([*asked.sources, *([learned] if learned else [])]),
        **{name: getattr(asked, name) for name in ("plans", "poses", "difficulty", "test_problems")},
        "seed": asked.settings.seed,
    }
    metrics = gathered_metrics(counts)
    logged = log_library(folder, asked.name, out, vehicle, parameters, metrics)
    tags: dict[str, Any] = {
        "memory": asked.name,
        "vehicle": label_of(vehicle),
        "learned": learned,
        "recipe": asked.recipe(),
        "retraining": number,
        "digest": logged.digest,
        "against": "" if before is None else before.number,
    }
    if judgement is not None:
        tags["sooner_than_alone_s"] = f"{judgement.alone.sooner_s:.6f}"
    if ours is not None:
        figures = {name: f"{getattr(ours, name):.6f}" for name in ("sooner_s", "low_s", "high_s")}
        tags |= figures | {"why": ours.why}
    markdown = _markdown(title, learned, verdict, judgement)
    key = key_of(title, logged.digest)
    version = registry.register(asked.registered, logged.run_id, logged.model_id, key, tags, markdown)
    _log_judgement(folder, logged.run_id, verdict, judgement, markdown)
    summary = summary_of(version, before, verdict, ours)
    if judgement is not None:
        summary += f"; beside the planner without a memory {judgement_line(judgement.alone, 'it')}"
    faults = settle(registry, [(version, verdict)])
    if flow is not None:
        publish_judgements(title, [(asked.name, summary, markdown)])
    if faults:
        raise RunError(" ".join(faults))
    tables = [] if judgement is None else [judgement.table]
    if ours is not None:
        tables += judgement_tables(ours)
    return RetrainedLibrary(out, counts, version, verdict, summary, tables)


def _judged(
    folder: DataFolder,
    asked: LibraryRetraining,
    number: int,
    sources: Sequence[str],
    champion: Path | None,
    challenger: Path,
) -> LibraryJudgement | None:
    """Judge a library by questions that no library is gathered from, others at each retraining."""
    questions = replace(
        asked.request(challenger, sources),
        plans=asked.test_problems,
        settings=replace(asked.settings, seed=number),
        asked_of="test",
    )
    sides = [
        Side(name, place, memory_digest(place))
        for name, place in ((CHAMPION, champion), (CHALLENGER, challenger))
        if place is not None
    ]
    out = folder.judged_libraries / f"{challenger.name}.parquet"
    judgement = judge_library(Judging(out, questions, tuple(sides)))
    if judgement is None and champion is not None:
        raise RunError(
            f"No question is held back to judge {asked.name} by: name a class, a family, a map or worlds "
            "among its sources, or learn more."
        )
    return judgement


def _markdown(title: str, learned: str, verdict: str, judgement: LibraryJudgement | None) -> str:
    parts = [f"Library *{title}*, learned: `{learned or 'nothing'}`."]
    if judgement is None or judgement.champion is None:
        parts.append("There was no champion. This library is the first; all its plans were checked.")
    else:
        parts.append(judgement_markdown(judgement.champion, verdict))
    if judgement is not None:
        parts.append(f"Beside the planner without a memory {judgement_line(judgement.alone, 'it')}.")
        parts.append(as_markdown([judgement.table]))
    return "\n\n".join(parts) + "\n"


def _log_judgement(
    folder: DataFolder, run_id: str, verdict: str, judgement: LibraryJudgement | None, markdown: str
) -> None:
    """Add the verdict and its figures to the library's run in MLflow."""
    log = tracker(folder.place)
    log.tag(run_id, {"verdict": verdict})
    if judgement is not None:
        alone = judgement_metrics(judgement.alone)
        log.metrics(run_id, [{f"alone/{name}": value for name, value in alone.items()}])
        if judgement.champion is not None:
            log.metrics(run_id, [judgement_metrics(judgement.champion)])
    with scratch_folder() as scratch:
        file = scratch / "verdict.md"
        file.write_text(markdown, encoding="utf-8")
        log.artifacts(run_id, file)
