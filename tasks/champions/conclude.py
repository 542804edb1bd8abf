"""The last step of a retraining: judge its memories, register them, and decide which is champion."""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Final, NamedTuple

from dashboards.verdicts.drift import Usefulness, usefulness
from dashboards.verdicts.promotion import (
    Judgement,
    judge,
    judgement_line,
    judgement_markdown,
    judgement_tables,
)
from storage.archives.memories import load_memory
from storage.vehicles.vehicle_files import said_vehicle
from tasks.champions.new_experience import RetrainingRun
from tasks.champions.promote import ChangedChampionError, promote
from tasks.fan_out.chunk import run_folder
from tasks.fan_out.keys import key_of
from tasks.registry.champion_registry import (
    AWAITING,
    CHALLENGER,
    FIRST,
    PROMOTED,
    REFUSED,
    Registry,
    Version,
)
from tasks.registry.model_uris import memory_digest
from tasks.settings.errors import RunError
from tasks.settings.retraining_settings import number_of
from tasks.stages.build_memory import BUILD_MEMORY
from tasks.stages.judge import judged
from tasks.tracking.artifacts import publish_judgements
from tasks.tracking.logbook import log_judgement
from tasks.tracking.mlflow_runs import tracker
from tasks.tracking.model_names import registered_name

CHECKED: Final = "all its plans were checked"
UNOPPOSED: Final = f"there was no champion, and {CHECKED}"  # why a first champion is one

_LOG = logging.getLogger(__name__)


class JudgedVersion(NamedTuple):
    """A memory of a run, registered as a version, and the verdict on it."""

    memory: str
    version: Version
    verdict: str
    judgement: Judgement | None  # None if there was no champion to beat
    summary: str  # one line
    markdown: str


def conclude(data: str, run: RetrainingRun, registry: Registry, approve: bool) -> None:
    """Judge the memories of a run, register them, and point the aliases at the champions.

    The alias is moved in one step, and the verdict of a version is noted after that. So a version without a
    verdict was interrupted, and the same command finishes it.

    Args:
        data: the data folder.
        run: the run, whose stages are done.
        registry: where the memories are registered.
        approve: whether better challengers wait for ``motion-memory promote``.

    Raises:
        RunError: the registry cannot be reached, or somebody changed a champion meanwhile; the versions of
            other memories have their verdicts then.
        StorageError: a memory is damaged.
    """
    judged_versions = [_register(data, run, registry, memory, approve) for memory in run.memories]
    _log(judged_versions)
    faults = settle(registry, [(each.version, each.verdict) for each in judged_versions])
    publish_judgements(
        run.settings.run_name, [(each.memory, each.summary, each.markdown) for each in judged_versions]
    )
    if faults:
        raise RunError(" ".join(faults))


def benchmark_tag(benchmark: Mapping[str, Usefulness]) -> str:
    """The text of a version's tag ``benchmark``: how useful it was, for comparing it with its use at work."""
    return json.dumps({name: asdict(figures) for name, figures in benchmark.items()})


def settle(registry: Registry, judged_versions: Sequence[tuple[Version, str]]) -> list[str]:
    """Do what each verdict says, and note it.

    Args:
        registry: where the versions are registered.
        judged_versions: the versions and their verdicts.

    Returns:
        why some have no verdict: somebody has changed their champions meanwhile.
    """
    faults = []
    for version, verdict in judged_versions:
        try:
            if verdict == FIRST and registry.aliased(version.name) is None:
                registry.set_alias(version)
            elif verdict == PROMOTED:
                promote(registry, version)
            elif verdict == AWAITING:
                registry.set_alias(version, CHALLENGER)
        except ChangedChampionError as error:
            faults.append(str(error))
            continue
        registry.set_verdict(version, verdict)
    return faults


def _register(data: str, run: RetrainingRun, registry: Registry, memory: str, approve: bool) -> JudgedVersion:
    """Judge a memory of a run, register it, and log the judgement."""
    settings, folder = run.settings, run_folder(data, run.settings)
    attempts = judged(data, settings, memory)
    champion = run.champions.get(memory)
    judgement = None if champion is None else judge(*attempts)
    verdict = verdict_on(judgement, approve)
    load_memory(folder.memory(memory), said_vehicle(settings.vehicle))  # raises StorageError if damaged
    (key,) = BUILD_MEMORY.keys(data, settings, memory)
    run_id, model_id = tracker(data).logged_memory(settings.run_name, memory, key)
    markdown = _markdown(run, memory, verdict, judgement)
    tags = {
        "memory": memory,
        "vehicle": settings.vehicle_label,
        "run": settings.run_name,
        "learned": settings.learned,
        "retraining": number_of(settings.retraining),
        "digest": memory_digest(folder.memory(memory)),
        "benchmark": benchmark_tag(usefulness(attempts.challenger)),
        "against": "" if champion is None else champion.number,
    }
    if judgement is None:
        tags["why"] = UNOPPOSED
    else:
        figures = {name: f"{getattr(judgement, name):.6f}" for name in ("sooner_s", "low_s", "high_s")}
        tags |= figures | {"why": judgement.why}
    name = registered_name(memory, settings.vehicle_label)
    version = registry.register(name, run_id, model_id, key_of(settings.run_name, key), tags, markdown)
    log_judgement(data, settings, memory, verdict, judgement, markdown, attempts)
    summary = summary_of(version, champion, verdict, judgement)
    return JudgedVersion(memory, version, verdict, judgement, summary, markdown)


def verdict_on(judgement: Judgement | None, approve: bool) -> str:
    """What becomes of a challenger; without a ``judgement`` it is the first champion."""
    if judgement is None:
        return FIRST
    if not judgement.passes:
        return REFUSED
    return AWAITING if approve else PROMOTED


def summary_of(version: Version, champion: Version | None, verdict: str, judgement: Judgement | None) -> str:
    """What became of a version, in one line."""
    subject = f"{version.name} version {version.number}"
    if judgement is None or champion is None:
        return f"{subject} is the first champion; {CHECKED}"
    state = "awaits approval (motion-memory promote)" if verdict == AWAITING else f"is {verdict}"
    return f"{subject} {state}, against version {champion.number}: {judgement.why}"


def _markdown(run: RetrainingRun, memory: str, verdict: str, judgement: Judgement | None) -> str:
    learned = run.settings.learned or "nothing"
    heading = f"Memory *{memory}* of run `{run.settings.run_name}`, learned: `{learned}`.\n\n"
    if judgement is None:
        return heading + "There was no champion. This memory is the first; all its plans were checked.\n"
    return heading + judgement_markdown(judgement, verdict)


def _log(judged_versions: Sequence[JudgedVersion]) -> None:
    for judged_version in judged_versions:
        if judged_version.judgement is not None:
            for table in judgement_tables(judged_version.judgement):
                _LOG.info(table)
            _LOG.info(judgement_line(judged_version.judgement))
        _LOG.info(judged_version.summary)
