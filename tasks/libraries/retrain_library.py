"""Retrain a library: gather a challenger with what was learned since, judge it, and promote it if better."""

from __future__ import annotations

import logging
import shlex
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple

from dashboards.cells import CellTable, as_markdown
from dashboards.verdicts.drift import FEWEST
from dashboards.verdicts.promotion import (
    FEWEST_SHOWN,
    Judgement,
    judgement_line,
    judgement_markdown,
    judgement_tables,
)
from storage.places.data_folder import DataFolder
from storage.places.mirror import remove
from storage.places.scratch import scratch_folder
from storage.tables.gained_experiences import gained_shards
from storage.vehicles.vehicle_files import label_of
from tasks.champions.conclude import UNOPPOSED, benchmark_tag, settle, summary_of, verdict_on
from tasks.champions.new_experience import note_verdict
from tasks.fan_out.keys import key_of
from tasks.inputs.gained_on_the_job import removed_if_it_fails, snapshot_of_questions
from tasks.libraries.challenger import LEARNED, are_plans_missing, make_challenger
from tasks.libraries.judge_library import (
    CHALLENGER,
    CHAMPION,
    Judging,
    LibraryJudgement,
    Side,
    judge_library,
    questions_of,
    sides_table,
    too_few,
)
from tasks.libraries.pending_library import LibraryRetraining, PendingLibrary, pending_library
from tasks.registry.champion_registry import FIRST, REFUSED, Registry, Version
from tasks.registry.model_uris import memory_digest
from tasks.registry.register_library import log_library
from tasks.requests.gather import (
    GatherFlow,
    SourceCounts,
    gathered_metrics,
)
from tasks.requests.gather_pieces import GatherRequest
from tasks.session.folder_lock import locked_folder
from tasks.settings.errors import RunError, UsageError
from tasks.tracking.artifacts import publish_judgements
from tasks.tracking.logbook import judgement_metrics
from tasks.tracking.mlflow_runs import tracker

HARM: Final = "robots are there later with it than without a memory"

_LOG = logging.getLogger(__name__)


class RetrainedLibrary(NamedTuple):
    """A library that was gathered and judged."""

    folder: Path
    counts: Sequence[SourceCounts]  # what came of each source
    version: Version
    verdict: str
    summary: str  # what became of it, in a line
    beside: str  # how it does beside the planner without a memory, in a line; empty if nothing was judged
    tables: Sequence[CellTable]  # of the judgement
    is_short: bool  # whether its sources gave fewer plans than were asked for


class _Made(NamedTuple):
    title: str
    folder: Path
    counts: Sequence[SourceCounts]
    learned: str  # name of the snapshot; empty if nothing was learned
    judgement: LibraryJudgement | None  # None if there was nothing to judge by


def retrain_library(
    data: Path, asked: LibraryRetraining, workers: int = 1, flow: GatherFlow | None = None
) -> RetrainedLibrary | None:
    """Gather a library with what was learned since the champion, and promote it if robots are there sooner.

    Questions of files and learned ones are split by what they ask: one in four is never gathered, and only
    judges. The first library becomes the champion, unless robots are later with it than without a memory.
    If the command is killed, the same command goes on.

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
) -> RetrainedLibrary | None:
    with _learned(folder, asked, registry, pending.number) as snapshot:
        made = _challenger(folder, asked, registry, pending, snapshot, workers, flow)
    if made is None:
        if snapshot is not None:
            remove(snapshot)
        return None
    judgement = made.judgement
    ours = None if judgement is None else judgement.champion
    version, verdict, markdown = _registered(folder, asked, registry, pending, made)
    summary = summary_of(version, pending.champion, verdict, ours)
    if verdict == REFUSED and pending.champion is None:
        summary = f"{version.name} version {version.number} is {verdict}: {HARM}"
    faults = settle(registry, [(version, verdict)])
    if flow is not None:
        publish_judgements(made.title, [(asked.name, summary, markdown)])
    if faults:
        raise RunError(" ".join(faults))
    is_short = pending.is_anew and are_plans_missing(asked, made.counts)
    if judgement is None:
        return RetrainedLibrary(made.folder, made.counts, version, verdict, summary, "", [], is_short)
    if verdict != REFUSED:
        _warn_of_harm(made.title, judgement.alone)
    tables = [sides_table(judgement), *([] if ours is None else judgement_tables(ours))]
    beside = _beside(judgement)
    return RetrainedLibrary(made.folder, made.counts, version, verdict, summary, beside, tables, is_short)


@contextmanager
def _learned(
    folder: DataFolder, asked: LibraryRetraining, registry: Registry, number: int
) -> Iterator[Path | None]:
    """A snapshot of what was learned, which stays if the work with it is done or killed; None of nothing.

    If the work raises an error, the snapshot is removed, unless a version was made of it before.
    """
    vehicle = asked.settings.vehicle
    if not gained_shards(folder.gained_questions(label_of(vehicle))):
        yield None
        return
    used = {version.tag("learned") for version in registry.versions(asked.registered)}
    snapshot = snapshot_of_questions(folder.place, vehicle, f"{asked.name}-{number:04d}")
    with nullcontext() if snapshot.stem in used else removed_if_it_fails(snapshot):
        yield snapshot


def _challenger(
    folder: DataFolder,
    asked: LibraryRetraining,
    registry: Registry,
    pending: PendingLibrary,
    snapshot: Path | None,
    workers: int,
    flow: GatherFlow | None,
) -> _Made | None:
    """Gather and judge a library; None if the champion answers everything."""
    before, learned = pending.champion, "" if snapshot is None else snapshot.stem
    made_of = key_of(asked.recipe(), learned, "" if before is None else before.number)
    title = f"{asked.name}-{pending.number:04d}-{made_of[:6]}"
    out = folder.libraries / title
    questions = _held_back(asked, snapshot, pending.number, out, before is None)
    with scratch_folder() as scratch:
        champion = None if before is None else registry.fetch(before, str(scratch))
        begun = None if pending.is_anew else champion
        counts = make_challenger(asked, begun, snapshot, out, workers, flow)
        if not counts:
            _LOG.info("%s: the champion answers all questions that were learned", asked.name)
            return None
        return _Made(title, out, counts, learned, _judged(folder, questions, champion, out))


def _warn_of_harm(title: str, alone: Judgement) -> None:
    """Warn if robots are later with a library than without one, though it was not refused."""
    if alone.problems >= FEWEST_SHOWN and alone.high_s < 0.0:
        few = f"; {alone.problems} questions are too few to refuse it, {FEWEST} would do"
        _LOG.warning("%s: %s%s.", title, HARM, few if alone.problems < FEWEST else "")


def _registered(
    folder: DataFolder,
    asked: LibraryRetraining,
    registry: Registry,
    pending: PendingLibrary,
    made: _Made,
) -> tuple[Version, str, str]:
    """Log a library and the judgement in MLflow, and register it: the version, the verdict, and its text."""
    ours = None if made.judgement is None else made.judgement.champion
    verdict = _verdict(made.judgement, asked.approve)
    parameters = {
        "sources": shlex.join([*asked.sources, *([made.learned] if made.learned else [])]),
        **{name: getattr(asked, name) for name in ("plans", "poses", "difficulty", "test_problems")},
        "seed": asked.settings.seed,
    }
    vehicle = asked.settings.vehicle
    logged = log_library(folder, asked.name, made.folder, vehicle, parameters, gathered_metrics(made.counts))
    tags: dict[str, Any] = {
        "memory": asked.name,
        "vehicle": label_of(vehicle),
        "learned": made.learned,
        "recipe": asked.recipe(),
        "retraining": pending.number,
        "digest": logged.digest,
        "against": "" if pending.champion is None else pending.champion.number,
    }
    if made.judgement is not None:
        tags["sooner_than_alone_s"] = f"{made.judgement.alone.sooner_s:.6f}"
        tags["benchmark"] = benchmark_tag(made.judgement.benchmark)
    if ours is not None:
        figures = {name: f"{getattr(ours, name):.6f}" for name in ("sooner_s", "low_s", "high_s")}
        tags |= figures | {"why": ours.why}
    else:
        tags["why"] = _why_without_champion(made.judgement, verdict)
    markdown = _markdown(made, verdict)
    key = key_of(made.title, logged.digest)
    version = registry.register(asked.registered, logged.run_id, logged.model_id, key, tags, markdown)
    _log_judgement(folder, logged.run_id, made.judgement, markdown)
    return version, verdict, markdown


def _verdict(judgement: LibraryJudgement | None, approve: bool) -> str:
    """What becomes of a library: the first must do no harm, others have to be better than the champion."""
    if judgement is None:
        return FIRST
    if judgement.champion is not None:
        return verdict_on(judgement.champion, approve)
    does_harm = judgement.alone.problems >= FEWEST and judgement.alone.high_s < 0.0
    return REFUSED if does_harm else FIRST


def _held_back(
    asked: LibraryRetraining, snapshot: Path | None, number: int, library: Path, is_first: bool
) -> GatherRequest:
    """The questions that judge, which no library is gathered from; those that are drawn are others each time.

    Raises RunError if they are too few for a verdict; a first champion needs none.
    """
    learned = {} if snapshot is None else {LEARNED: str(snapshot)}
    request = replace(
        asked.request(library),
        sources=(*asked.sources, *learned),
        learned=learned,
        plans=asked.test_problems,
        settings=replace(asked.settings, seed=number),
        share="test",
    )
    count = len(questions_of(request))
    if count < FEWEST and not is_first:
        more = "raise --test-problems" if count == asked.test_problems else "solve more with --learn"
        raise RunError(
            f"{asked.name}: {too_few(count)}; {more}, or name a class, a family, a map or worlds among its "
            "sources."
        )
    return request


def _judged(
    folder: DataFolder, questions: GatherRequest, champion: Path | None, challenger: Path
) -> LibraryJudgement | None:
    if not questions_of(questions):
        return None
    sides = [
        Side(name, place, memory_digest(place))
        for name, place in ((CHAMPION, champion), (CHALLENGER, challenger))
        if place is not None
    ]
    out = folder.judged_libraries / f"{challenger.name}.parquet"
    return judge_library(Judging(out, questions, tuple(sides)))


def _markdown(made: _Made, verdict: str) -> str:
    judgement = made.judgement
    parts = [f"Library *{made.title}*, learned: `{made.learned or 'nothing'}`."]
    if verdict == FIRST:
        parts.append("There was no champion. This library is the first; all its plans were checked.")
    elif judgement is None or judgement.champion is None:
        parts.append(f"**{verdict}**: {HARM}.")
    else:
        parts.append(judgement_markdown(judgement.champion, verdict))
    if judgement is not None:
        parts.append(f"{_beside(judgement)}.")
        parts.append(as_markdown([sides_table(judgement)]))
    return "\n\n".join(parts) + "\n"


def _why_without_champion(judgement: LibraryJudgement | None, verdict: str) -> str:
    """Why a library that met no champion is the first one, or is refused, in one line."""
    why = HARM if verdict == REFUSED else UNOPPOSED
    return why if judgement is None else f"{why}. {_beside(judgement)}"


def _beside(judgement: LibraryJudgement) -> str:
    return f"Beside the planner without a memory {judgement_line(judgement.alone, 'it')}"


def _log_judgement(
    folder: DataFolder, run_id: str, judgement: LibraryJudgement | None, markdown: str
) -> None:
    """Add the figures and the text of the verdict to the library's run in MLflow."""
    log = tracker(folder.place)
    if judgement is not None:
        ends = {name: getattr(judgement.alone, name) for name in ("sooner_s", "low_s", "high_s")}
        log.metrics(run_id, [{f"beside-alone/{name}": value for name, value in ends.items()}])
        for side in judgement.sides:
            figures = {name: value for name, value in side._asdict().items() if name != "name"}
            log.metrics(run_id, [{f"{side.name}/{name}": value for name, value in figures.items()}])
        if judgement.champion is not None:
            log.metrics(run_id, [judgement_metrics(judgement.champion)])
    with scratch_folder() as scratch:
        file = scratch / "verdict.md"
        file.write_text(markdown, encoding="utf-8")
        log.artifacts(run_id, file)
