"""Retrain: what became of challengers, and who is champion then."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import NamedTuple

from dashboards.verdicts.drift import usefulness
from dashboards.verdicts.promotion import (
    Judgement,
    judge,
    judgement_line,
    judgement_markdown,
    judgement_table,
)
from planners.world.vehicles.vehicle import vehicle_named
from storage.archives.memories import load_memory
from tasks.champions.new_experience import Round
from tasks.champions.promote import promote
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
    registered_name,
)
from tasks.registry.model_uris import memory_digest
from tasks.reports.report import console
from tasks.settings.retraining_settings import number_of
from tasks.stages.build_memory import BUILD_MEMORY
from tasks.stages.judge import judged
from tasks.tracking.artifacts import publish_judgements
from tasks.tracking.logbook import log_judgement, tracker


class Outcome(NamedTuple):
    """What became of one memory of a run."""

    memory: str
    version: Version
    verdict: str
    judgement: Judgement | None  # None where there was no champion to beat
    told: str  # in one line
    markdown: str


def conclude(data: str, made: Round, registry: Registry, approve: bool) -> None:
    """Judge the memories of a run, register them, and let the aliases follow.

    Everything but the verdict is written before the alias is, which is one step: a version without a verdict
    was interrupted, and is found and finished by the same command. ``approve``: challengers that are
    better wait for ``motion-memory promote``.
    """
    settings = made.settings
    outcomes = [_outcome(data, made, registry, memory, approve) for memory in made.memories]
    _show(outcomes)
    for each in outcomes:
        if each.verdict == FIRST and registry.aliased(each.version.name) is None:
            registry.point(each.version)
        elif each.verdict == PROMOTED:
            promote(registry, each.version)
        elif each.verdict == AWAITING:
            registry.point(each.version, CHALLENGER)
        registry.tagged(each.version, {"verdict": each.verdict})
    publish_judgements(settings.run_name, [(each.memory, each.told, each.markdown) for each in outcomes])


def _outcome(data: str, made: Round, registry: Registry, memory: str, approve: bool) -> Outcome:
    settings, run = made.settings, run_folder(data, made.settings)
    attempts = judged(data, settings, memory)
    champion = made.against.get(memory)
    judgement = None if champion is None else judge(*attempts)
    verdict = _verdict(judgement, approve)
    load_memory(run.memory(memory), vehicle_named(settings.vehicle))  # whole, or a StorageError
    (key,) = BUILD_MEMORY.keys(data, settings, memory)
    run_id, model_id = tracker(data).logged_memory(settings.run_name, memory, key)
    markdown = _markdown(made, memory, judgement)
    tags = {
        "memory": memory,
        "vehicle": settings.vehicle,
        "run": settings.run_name,
        "learned": settings.learned,
        "retraining": number_of(settings.retraining),
        "digest": memory_digest(run.memory(memory)),
        "benchmark": json.dumps({k: asdict(v) for k, v in usefulness(attempts.challenger).items()}),
        "against": "" if champion is None else champion.number,
    }
    if judgement is not None:
        figures = {name: f"{getattr(judgement, name):.6f}" for name in ("reduction", "low", "high")}
        tags |= figures | {"why": judgement.why}
    name = registered_name(memory, settings.vehicle)
    version = registry.register(name, run_id, model_id, key_of(settings.run_name, key), tags, markdown)
    log_judgement(data, settings, memory, verdict, judgement, markdown, attempts)
    return Outcome(
        memory, version, verdict, judgement, _told(version, champion, verdict, judgement), markdown
    )


def _verdict(judgement: Judgement | None, approve: bool) -> str:
    if judgement is None:
        return FIRST
    return REFUSED if not judgement.promoted else AWAITING if approve else PROMOTED


def _told(version: Version, champion: Version | None, verdict: str, judgement: Judgement | None) -> str:
    said = f"{version.name} version {version.number}"
    if judgement is None or champion is None:
        return f"{said} is the first champion; all its plans were checked"
    against = f"version {champion.number}"
    said = (
        f"{said} is {verdict}" if verdict != AWAITING else f"{said} awaits approval (motion-memory promote)"
    )
    return f"{said}, against {against}: {judgement.why}"


def _markdown(made: Round, memory: str, judgement: Judgement | None) -> str:
    settings = made.settings
    begin = f"Memory *{memory}* of run `{settings.run_name}`, learned: `{settings.learned or 'nothing'}`.\n\n"
    if judgement is None:
        return begin + "There was no champion: it is the first, once all its plans were checked.\n"
    return begin + judgement_markdown(judgement)


def _show(outcomes: Sequence[Outcome]) -> None:
    for each in outcomes:
        if each.judgement is not None:
            console().print(judgement_table(each.judgement))
            print(judgement_line(each.judgement))
        print(each.told)
