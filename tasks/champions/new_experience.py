"""What was learned since the champions: whether there is anything to retrain for, and on what."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

from planners.memory.plans.experience import Experience
from planners.world.vehicles.vehicle import vehicle_named
from storage.archives.memories import load_memory, save_memory
from storage.places.data_folder import DataFolder
from storage.places.scratch import scratch_folder
from storage.tables.gained_experiences import read_gained, snapshot_ids
from tasks.fan_out.chunk import run_folder
from tasks.inputs.gained_on_the_job import with_gained
from tasks.registry.champion_registry import AWAITING, FIRST, PROMOTED, Registry, Version, registered_name
from tasks.registry.model_uris import memory_digest
from tasks.settings.retraining_settings import Champion, Retraining
from tasks.settings.run_settings import COMBINED, RunSettings, world_class

WARM_SHARE: Final = 0.5  # of the epochs: an encoder that begins where another ended needs fewer


class Round(NamedTuple):
    """One run to make, its memories that are judged, and their champions; none where they are the first."""

    settings: RunSettings
    memories: Sequence[str]
    against: Mapping[str, Version]


class News(NamedTuple):
    """What there is to do."""

    first: RunSettings | None  # a run for memories that have no champion
    without: Sequence[str]  # these memories
    champions: Mapping[str, Version]  # by memory
    gained: Mapping[str, list[Experience]]  # of each class with a champion: all there is
    fresh: Mapping[str, list[Experience]]  # of these, where there are some: what no judged version has seen
    judged: Mapping[str, Version]  # by memory: the last one judged, which may be the champion


def news(folder: DataFolder, settings: RunSettings, registry: Registry) -> News:
    """Look at registry and data folder; nothing is written. RunError: the registry cannot be reached."""
    champions, last, seen = {}, {}, {}
    for memory in settings.memory_names:
        versions = registry.versions(registered_name(memory, settings.vehicle))
        champion = registry.aliased(registered_name(memory, settings.vehicle))
        if champion is None:
            continue
        known = [each for each in versions if _is_judged(each, champion)]
        champions[memory], last[memory] = champion, known[-1] if known else champion
        seen[memory] = {each.tag("learned") for each in known}
    without = [memory for memory in settings.memory_names if memory not in champions]
    everything = read_gained(folder.gained(settings.vehicle), vehicle_named(settings.vehicle))
    gained = {
        name: [each for each in everything if each.problem.class_name == name]
        for name in settings.class_names
        if name in champions
    }
    place = folder.gained(settings.vehicle)
    fresh = {name: _fresh(place, found, seen[name]) for name, found in gained.items()}
    first = restricted(settings, without) if without else None
    return News(
        first, without, champions, gained, {name: found for name, found in fresh.items() if found}, last
    )


def restricted(settings: RunSettings, memories: Sequence[str]) -> RunSettings:
    """The settings of a run that makes some memories; for the combined one all classes are needed."""
    if COMBINED in memories:
        return settings
    return replace(
        settings,
        classes=tuple(name for name in settings.classes if name in memories),
        worlds=tuple(path for path in settings.worlds if world_class(path) in memories),
        combined=False,
    )


def rounds(folder: DataFolder, settings: RunSettings, registry: Registry) -> list[Round]:
    """The runs to make: one for memories without a champion, one for classes of which more was learned.

    What was learned is frozen under the retraining's number, and champions are copied into the run's folder;
    a retraining that was interrupted finds both again.
    """
    for name in (registered_name(memory, settings.vehicle) for memory in settings.memory_names):
        _note_verdict(registry, registry.aliased(name))
    found = news(folder, settings, registry)
    made = [] if found.first is None else [Round(found.first, found.without, {})]
    for memory, champion in found.champions.items():
        print(_told(memory, champion, found))
    if found.fresh:
        made.append(_retraining(folder, settings, registry, found))
    return made


def _note_verdict(registry: Registry, champion: Version | None) -> None:
    """Note the verdict on a champion if a kill came between its promotion and that."""
    if champion is not None and champion.tag("key") and not champion.tag("verdict"):
        registry.tagged(champion, {"verdict": PROMOTED if champion.tag("previous") else FIRST})


def _retraining(folder: DataFolder, settings: RunSettings, registry: Registry, found: News) -> Round:
    whole = settings.combined and COMBINED in found.champions
    asked = settings if whole else restricted(settings, list(found.fresh))
    against = {name: found.champions[name] for name in asked.memory_names if name in found.champions}
    number = _next_number(registry)
    asked = with_gained(asked, folder.path, f"retrain-{number:04d}")
    vehicle = vehicle_named(settings.vehicle)
    with scratch_folder() as scratch:
        archives = {}
        for name, version in against.items():
            place = scratch / name
            place.mkdir()
            archives[name] = registry.fetch(version, str(place))
        asked = replace(
            asked,
            epochs=max(1, round(WARM_SHARE * settings.epochs)),
            continual="none",
            retraining=Retraining(
                number,
                tuple(
                    Champion(name, against[name].tag("run"), memory_digest(archive))
                    for name, archive in archives.items()
                ),
            ),
        )
        run = run_folder(str(folder.path), asked)
        for name, archive in archives.items():
            save_memory(run.champion(name), load_memory(archive, vehicle))
    return Round(asked, list(against), against)


def _next_number(registry: Registry) -> int:
    """That of no retraining of any memory, but for one that was interrupted: it is the same one then."""
    numbers = [0]
    for name in registry.names():
        champion = registry.aliased(name)
        numbers += [each.retraining for each in registry.versions(name) if _is_judged(each, champion)]
    return 1 + max(numbers)


def _is_judged(version: Version, champion: Version | None) -> bool:
    """Whether all was done with a version: what it has seen is no news. A crash leaves one without."""
    return bool(version.tag("verdict")) or (champion is not None and version.number == champion.number)


def _fresh(place: Path, gained: Sequence[Experience], seen: set[str]) -> list[Experience]:
    """What is in none of the snapshots."""
    known = {identity for called in seen - {""} for identity in snapshot_ids(place, called)}
    return [each for each in gained if each.problem.id not in known]


def _told(memory: str, champion: Version, found: News) -> str:
    new = len(found.fresh.get(memory, ()))
    last = found.judged[memory]
    said = f"{memory}: champion is version {champion.number}"
    if last.tag("verdict") == AWAITING:
        said += f", version {last.number} awaits approval (motion-memory promote)"
    elif last.number != champion.number:
        said += f", version {last.number} was {last.tag('verdict')}"
    return f"{said}; {new:,} new experiences" if new else f"{said}; nothing new was learned"
