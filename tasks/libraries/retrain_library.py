"""Retrain a library: gather a challenger with what was learned since, judge it, and promote it if better."""

from __future__ import annotations

import logging
import math
import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from statistics import fmean
from typing import Any, NamedTuple

from dashboards.cells import CellTable, as_markdown
from dashboards.verdicts.promotion import judgement_line, judgement_markdown, judgement_tables
from planners.memory.library.plan_library import PlanLibrary, gathered_library
from planners.world.classes.problem_classes import CLASSES
from storage.archives.libraries import how_gathered, load_library, save_library
from storage.errors import StorageError
from storage.places.data_folder import MARK, DataFolder
from storage.places.files import remove_folder
from storage.places.mirror import fetch, is_remote, local_place
from storage.places.run_folder import checked_name
from storage.places.scratch import scratch_folder
from storage.tables.experiences import merge_experiences, read_experiences
from storage.tables.gained_experiences import gained_shards, read_gained, snapshot_ids
from storage.vehicles.vehicle_files import label_of
from storage.worlds.importing import ImportSettings
from tasks.champions.conclude import settle, summary_of, verdict_on
from tasks.champions.new_experience import is_judged, next_number, note_verdict
from tasks.fan_out.keys import key_of
from tasks.inputs.gained_on_the_job import snapshot_of_questions
from tasks.libraries.judge_library import (
    CHALLENGER,
    CHAMPION,
    Judging,
    LibraryJudgement,
    Side,
    judge_library,
)
from tasks.registry.champion_registry import Registry, Version
from tasks.registry.model_uris import memory_digest
from tasks.registry.register_library import log_library
from tasks.requests.gather import (
    GatherFlow,
    SourceCounts,
    check_asked_questions,
    gather,
    gathered_metrics,
)
from tasks.requests.gather_pieces import GatherRequest
from tasks.requests.question_sources import is_drawn, is_held_back, settled_source
from tasks.session.folder_lock import locked_folder
from tasks.settings.checks import check_count
from tasks.settings.errors import RunError, UsageError
from tasks.settings.run_settings import COMBINED
from tasks.tracking.artifacts import publish_judgements
from tasks.tracking.logbook import judgement_metrics
from tasks.tracking.mlflow_runs import tracker
from tasks.tracking.model_names import registered_name

_LOG = logging.getLogger(__name__)


class LibraryRetraining(NamedTuple):
    """Which library is retrained, and how."""

    name: str
    sources: tuple[str, ...]  # of questions, beside those that were learned
    plans: int  # questions that a library answers
    poses: float  # the share of drawn questions that ask for a pose
    difficulty: str  # of classes and families
    settings: ImportSettings
    test_problems: int  # held-back questions that a library is judged by
    approve: bool  # whether a better one waits for ``motion-memory promote``

    @property
    def registered(self) -> str:
        """The name in MLflow's registry."""
        return registered_name(self.name, label_of(self.settings.vehicle))

    def recipe(self) -> str:
        """A digest of everything that is asked for, but for what was learned."""
        return self.request(Path(), self.sources).asked

    def request(self, out: Path, sources: Sequence[str]) -> GatherRequest:
        """What is gathered from some sources."""
        return GatherRequest(
            *(tuple(sources), out, self.plans, self.poses, self.difficulty, self.settings, "train")
        )


class PendingLibrary(NamedTuple):
    """What a retraining would find to do now."""

    champion: Version | None
    number: int  # of the retraining
    is_anew: bool  # whether everything is gathered, and not only what is new
    is_due: bool
    line: str  # why it is, or is not


class RetrainedLibrary(NamedTuple):
    """A library that was gathered and judged."""

    folder: Path
    counts: Sequence[SourceCounts]  # what came of each source
    version: Version
    verdict: str
    summary: str  # one line
    tables: Sequence[CellTable]  # of the judgement


def library_retraining(
    name: str,
    sources: Sequence[str],
    plans: int,
    poses: float,
    difficulty: str,
    settings: ImportSettings,
    test_problems: int,
    approve: bool = False,
) -> LibraryRetraining:
    """Check what is asked for; paths become absolute. The arguments are those of ``LibraryRetraining``.

    Raises UsageError if a name or a number is wrong.
    """
    try:
        checked_name(name)
    except StorageError as error:
        raise UsageError(str(error)) from None
    if name in (*CLASSES, COMBINED):
        raise UsageError(f"{name} is the name of a run's memory: give the library another.")
    check_count("test problems", test_problems)
    check_asked_questions(plans, poses, difficulty, sources)
    own = [each if is_drawn(each) or is_remote(each) else str(Path(each).absolute()) for each in sources]
    return LibraryRetraining(*(name, tuple(own), plans, poses, difficulty, settings, test_problems, approve))


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


def pending_library(folder: DataFolder, asked: LibraryRetraining, registry: Registry) -> PendingLibrary:
    """Look up in the registry and the data folder whether there is something to do; write nothing.

    Args:
        folder: the data folder, which holds what was learned.
        asked: which library, and how.
        registry: the registry of the champions.

    Raises:
        RunError: the registry cannot be reached.
        UsageError: there are no sources, and nothing was learned.
    """
    vehicle, number = asked.settings.vehicle, next_number(registry)
    place = folder.gained_questions(label_of(vehicle))
    learned = [each.experience.problem for each in read_gained(place, vehicle)]
    champion = registry.aliased(asked.registered)
    if champion is None:
        if not asked.sources and not learned:
            raise UsageError(
                f"{asked.name} has no sources, and nothing was learned: name a class, a family of "
                "manoeuvres, a map, worlds or a file of problems, or solve problems with --learn."
            )
        line = f"{asked.name}: no champion yet; {_counted(len(learned), 'learned question')}"
        return PendingLibrary(None, number, True, True, line)
    judged = [each for each in registry.versions(asked.registered) if is_judged(each, champion)]
    seen = {identity for each in judged for identity in snapshot_ids(place, each.tag("learned"))}
    new = sum(question.id not in seen and not is_held_back(question) for question in learned)
    recipe, known = asked.recipe(), {each.tag("recipe") for each in (champion, *judged)}
    line = f"{asked.name}: champion is version {champion.number}; "
    line += f"{_counted(new, 'new question')} to learn from" if new else "nothing new was learned"
    line += "" if recipe in known else ", and it was not asked for in this way before"
    is_anew = recipe != champion.tag("recipe")
    return PendingLibrary(champion, number, is_anew, new > 0 or recipe not in known, line)


def library_dry_run(data: Path, asked: LibraryRetraining) -> str:
    """Say in a line what retraining a library would find to do now, and write nothing.

    Args:
        data: the data folder, which may not be there yet.
        asked: which library, and how.

    Raises:
        RunError: the registry cannot be reached.
        UsageError: there is nothing to gather from.
    """
    path = local_place(data).expanduser().absolute()
    if not fetch(path / MARK).is_file():
        return f"{data} is not a data folder yet: the first library {asked.name} would be gathered in it."
    folder = DataFolder(path)
    pending = pending_library(folder, asked, Registry(folder))
    return f"{pending.line}: {'a library would be gathered' if pending.is_due else 'nothing would be done'}"


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
            counts = _gathered(asked, sources, snapshot, out, workers, flow)
        else:
            seen = snapshot_ids(snapshot.parents[1], before.tag("learned"))
            counts = _added(asked, champion, snapshot, seen, out, workers, flow)
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


def _gathered(
    asked: LibraryRetraining,
    sources: Sequence[str],
    snapshot: Path | None,
    out: Path,
    workers: int,
    flow: GatherFlow | None,
) -> Sequence[SourceCounts]:
    """Gather a library from all sources: as many drawn questions as are asked for, and all learned ones."""
    vehicle = asked.settings.vehicle
    learned = [] if snapshot is None else read_experiences(snapshot, vehicle)
    plans = asked.plans + sum(not is_held_back(each.problem) for each in learned)
    settings = replace(asked.settings, count=asked.plans)  # a map's windows do not depend on what was learned
    return gather(sources, out, plans, asked.poses, asked.difficulty, settings, workers, flow, "train")


def _added(
    asked: LibraryRetraining,
    champion: Path,
    snapshot: Path,
    seen: set[str],
    out: Path,
    workers: int,
    flow: GatherFlow | None,
) -> Sequence[SourceCounts]:
    """Write the champion's plans, and those of the learned questions that are in no ``seen`` snapshot."""
    if (kept := how_gathered(out)) is not None:  # by a command that was killed later
        return [SourceCounts(**each) for each in kept["sources"]]
    vehicle = asked.settings.vehicle
    old = load_library(champion, vehicle)
    new_out = out.with_name(f"{out.name}-new")
    learned = read_experiences(snapshot, vehicle)
    rows = [
        row
        for row, each in enumerate(learned)
        if each.problem.id not in seen and not is_held_back(each.problem)
    ]
    new_questions = snapshot.with_name(f"{snapshot.stem}-new.parquet")
    merge_experiences([snapshot], new_questions, rows)
    counts = [
        _counts_of(old),
        *gather(
            *([str(new_questions)], new_out, len(rows), asked.poses, "standard", asked.settings),
            *(workers, flow, "train"),
        ),
    ]
    new = load_library(new_out, vehicle)
    answered = [*zip(old.questions, old.plans, strict=True), *zip(new.questions, new.plans, strict=True)]
    name = old.class_name if old.class_name == new.class_name else "general"
    scales = tuple(sorted({*old.scales, *new.scales}))
    sources = [each._asdict() for each in counts]
    save_library(out, gathered_library(name, vehicle, answered, scales), {"asked": "", "sources": sources})
    remove_folder(new_out)
    return counts


def _counts_of(library: PlanLibrary) -> SourceCounts:
    """What a library holds already, as a row of the table."""
    quickest: dict[str, float] = {}
    for question, plan in zip(library.questions, library.plans, strict=True):
        quickest[question] = min(plan.duration_s, quickest.get(question, math.inf))
    asked = len(quickest)
    return SourceCounts("the champion's", asked, asked, len(library.plans), fmean(quickest.values()))


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


def _counted(count: int, what: str) -> str:
    return f"{count:,} {what}{'' if count == 1 else 's'}"
