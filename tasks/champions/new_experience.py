"""What retraining has to do: which memories have no champion, and what is new for the others."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

from storage.archives.memories import load_memory, save_memory
from storage.places.data_folder import DataFolder
from storage.places.scratch import scratch_folder
from storage.tables.experiences import SearchedExperience
from storage.tables.gained_experiences import read_gained, snapshot_ids
from storage.vehicles.vehicle_files import said_vehicle
from tasks.fan_out.chunk import run_folder
from tasks.inputs.gained_on_the_job import with_gained
from tasks.registry.champion_registry import AWAITING, FIRST, PROMOTED, Registry, Version
from tasks.registry.model_uris import memory_digest
from tasks.settings.retraining_settings import Champion, Retraining
from tasks.settings.run_settings import COMBINED, RunSettings, world_class
from tasks.tracking.model_names import registered_name

WARM_SHARE: Final = 0.5  # of the epochs: an encoder that starts from trained weights needs fewer

_LOG = logging.getLogger(__name__)


class RetrainingRun(NamedTuple):
    """A run that makes memories, and the champions that they are judged against."""

    settings: RunSettings
    memories: Sequence[str]  # names of the memories to judge
    champions: Mapping[str, Version]  # by memory; empty if the run makes the first champions


class PendingRetraining(NamedTuple):
    """What a retraining would find to do now."""

    first_run: RunSettings | None  # a run for the memories without a champion; None if all have one
    without_champion: Sequence[str]  # names of these memories
    champions: Mapping[str, Version]  # by memory
    # all experiences gained on the job, for each class with a champion
    gained: Mapping[str, list[SearchedExperience]]
    # experiences that no judged version has seen; only for classes that have some
    fresh: Mapping[str, list[SearchedExperience]]
    last_judged: Mapping[str, Version]  # by memory: the newest judged version, which may be the champion


def pending_retraining(folder: DataFolder, settings: RunSettings, registry: Registry) -> PendingRetraining:
    """Look up in the registry and the data folder what a retraining would do; write nothing.

    Args:
        folder: the data folder, which holds the experiences gained on the job.
        settings: the settings of a run; they name the memories.
        registry: the registry of the champions.

    Raises:
        RunError: the registry cannot be reached.
    """
    champions, last_judged, seen_snapshots = {}, {}, {}
    for memory in settings.memory_names:
        name = registered_name(memory, settings.vehicle_label)
        champion = registry.aliased(name)
        if champion is None:
            continue
        judged = [version for version in registry.versions(name) if is_judged(version, champion)]
        champions[memory] = champion
        last_judged[memory] = judged[-1] if judged else champion
        seen_snapshots[memory] = {version.tag("learned") for version in judged}
    without_champion = [memory for memory in settings.memory_names if memory not in champions]
    gained_folder = folder.gained(settings.vehicle_label)
    all_gained = read_gained(gained_folder, said_vehicle(settings.vehicle))
    gained = {
        name: [each for each in all_gained if each.experience.problem.class_name == name]
        for name in settings.class_names
        if name in champions
    }
    fresh = {
        name: _fresh(gained_folder, experiences, seen_snapshots[name]) for name, experiences in gained.items()
    }
    return PendingRetraining(
        first_run=settings_for(settings, without_champion) if without_champion else None,
        without_champion=without_champion,
        champions=champions,
        gained=gained,
        fresh={name: experiences for name, experiences in fresh.items() if experiences},
        last_judged=last_judged,
    )


def settings_for(settings: RunSettings, memories: Sequence[str]) -> RunSettings:
    """The settings of a run that makes only the named memories.

    The combined memory needs all classes, so if it is among them the settings stay as they are.
    """
    if COMBINED in memories:
        return settings
    return replace(
        settings,
        classes=tuple(name for name in settings.classes if name in memories),
        worlds=tuple(path for path in settings.worlds if world_class(path) in memories),
        combined=False,
    )


def runs_to_make(folder: DataFolder, settings: RunSettings, registry: Registry) -> list[RetrainingRun]:
    """The runs of a retraining: one makes first champions, one makes challengers from new experiences.

    A line about each memory with a champion is logged. The new experiences are frozen under the number of
    the retraining, and the champions are copied into the folder of the run. A retraining that was interrupted
    uses the same experiences and the same copies again.

    Args:
        folder: the data folder.
        settings: the settings of a run.
        registry: the registry of the champions.

    Returns:
        None, one or two runs. There is none for classes without new experiences.

    Raises:
        RunError: the registry cannot be reached.
    """
    for memory in settings.memory_names:
        note_verdict(registry, registry.aliased(registered_name(memory, settings.vehicle_label)))
    pending = pending_retraining(folder, settings, registry)
    runs = []
    if pending.first_run is not None:
        runs.append(RetrainingRun(pending.first_run, pending.without_champion, {}))
    for memory, champion in pending.champions.items():
        _LOG.info(_summary(memory, champion, pending))
    if pending.fresh:
        runs.append(_challenger_run(folder, settings, registry, pending))
    return runs


def note_verdict(registry: Registry, champion: Version | None) -> None:
    """Note the verdict on a champion whose promotion was interrupted before the verdict was noted."""
    if champion is not None and champion.tag("key") and not champion.tag("verdict"):
        registry.set_verdict(champion, PROMOTED if champion.tag("previous") else FIRST)


def _challenger_run(
    folder: DataFolder, settings: RunSettings, registry: Registry, pending: PendingRetraining
) -> RetrainingRun:
    all_memories = settings.combined and COMBINED in pending.champions
    run_settings = settings if all_memories else settings_for(settings, list(pending.fresh))
    champions = {
        name: pending.champions[name] for name in run_settings.memory_names if name in pending.champions
    }
    number = next_number(registry)
    run_settings = with_gained(run_settings, folder.path, f"retrain-{number:04d}")
    vehicle = said_vehicle(settings.vehicle)
    with scratch_folder() as scratch:
        archives = {}
        for name, version in champions.items():
            download_folder = scratch / name
            download_folder.mkdir()
            archives[name] = registry.fetch(version, str(download_folder))
        run_settings = replace(
            run_settings,
            epochs=max(1, round(WARM_SHARE * settings.epochs)),
            continual="none",
            retraining=Retraining(
                number,
                tuple(
                    Champion(name, champions[name].tag("run"), memory_digest(archive))
                    for name, archive in archives.items()
                ),
            ),
        )
        run = run_folder(str(folder.path), run_settings)
        for name, archive in archives.items():
            save_memory(run.champion(name), load_memory(archive, vehicle))
    return RetrainingRun(run_settings, list(champions), champions)


def next_number(registry: Registry, of_library: str | None = None) -> int:
    """One more than that of the last retraining that was judged; an interrupted one keeps its number.

    Each library has numbers of its own, because it is retrained alone (``of_library``: its registered name).
    """
    numbers = [0]
    for name in registry.names() if of_library is None else [of_library]:
        champion = registry.aliased(name)
        numbers += [
            version.retraining
            for version in registry.versions(name)
            if is_judged(version, champion) and (of_library is not None or not version.is_library)
        ]
    return 1 + max(numbers)


def is_judged(version: Version, champion: Version | None) -> bool:
    """Whether a version has its verdict; a retraining that was interrupted leaves versions without."""
    return bool(version.tag("verdict")) or (champion is not None and version.number == champion.number)


def _fresh(
    folder: Path, gained: Sequence[SearchedExperience], snapshots: set[str]
) -> list[SearchedExperience]:
    """The experiences that are in none of the named snapshots."""
    seen_ids = {identity for name in snapshots - {""} for identity in snapshot_ids(folder, name)}
    return [each for each in gained if each.experience.problem.id not in seen_ids]


def _summary(memory: str, champion: Version, pending: PendingRetraining) -> str:
    """A line about a memory: its champion, the verdict on a newer version, the number of new experiences."""
    fresh_count = len(pending.fresh.get(memory, ()))
    news = f"{fresh_count:,} new experiences" if fresh_count else "nothing new was learned"
    return f"{champion_line(memory, champion, pending.last_judged[memory])}; {news}"


def champion_line(name: str, champion: Version | None, last: Version) -> str:
    """The champion of a memory or library, and the verdict on the version that was judged last if newer."""
    line = f"{name}: no champion" if champion is None else f"{name}: champion is version {champion.number}"
    if last.tag("verdict") == AWAITING:
        line += f", version {last.number} awaits approval (motion-memory promote)"
    elif champion is None or last.number != champion.number:
        line += f", version {last.number} was {last.tag('verdict')}"
    return line
