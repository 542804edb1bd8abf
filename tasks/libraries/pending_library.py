"""What retraining a library has to do: what is asked for, and what is new."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from planners.world.classes.problem_classes import CLASSES
from planners.world.vehicles.vehicle import VEHICLES
from storage.errors import StorageError
from storage.places.data_folder import DataFolder, data_folder_at
from storage.places.run_folder import checked_name
from storage.tables.gained_experiences import read_gained, snapshot_ids
from storage.vehicles.vehicle_files import label_of
from storage.worlds.importing import ImportSettings
from tasks.champions.new_experience import champion_line, is_judged, next_number
from tasks.registry.champion_registry import REFUSED, Registry, Version
from tasks.requests.gather import check_asked_questions
from tasks.requests.gather_pieces import GatherRequest
from tasks.requests.question_sources import (
    OWN_SEEDS,
    drawn_source,
    is_data_folder,
    is_drawn,
    is_held_back,
    named_source,
)
from tasks.settings.checks import check_count
from tasks.settings.errors import UsageError
from tasks.settings.run_settings import COMBINED
from tasks.tracking.model_names import registered_name


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
        return self.request(Path()).asked

    def request(self, out: Path) -> GatherRequest:
        """What is gathered from the sources."""
        return GatherRequest(
            *(self.sources, out, self.plans, self.poses, self.difficulty, self.settings, "train")
        )


class PendingLibrary(NamedTuple):
    """What a retraining would find to do now."""

    champion: Version | None
    number: int  # of the retraining
    is_anew: bool  # whether everything is gathered, and not only what is new
    is_due: bool
    line: str  # why it is, or is not


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

    Raises UsageError if a name or a number is wrong, StorageError if a source is missing.
    """
    try:
        checked_name(name)
    except StorageError as error:
        raise UsageError(str(error)) from None
    label = label_of(settings.vehicle)
    if registered_name(name, label) in {
        registered_name(memory, vehicle) for memory in (*CLASSES, COMBINED) for vehicle in VEHICLES
    }:
        raise UsageError(f"{name} is the name of a run's memory: give the library another.")
    check_count("test problems", test_problems)
    check_asked_questions(plans, poses, difficulty, sources)
    if settings.seed >= OWN_SEEDS:
        raise UsageError(f"Seed {settings.seed}: give one below {OWN_SEEDS:,}; those above draw what judges.")
    for each in sources:
        if is_data_folder(each):
            raise UsageError(
                f"{each} is a data folder: what was learned in that of --data is a source in any case, and "
                "no other can be one."
            )
        if is_drawn(each):
            drawn_source(each, difficulty, settings.vehicle)
        else:
            named_source(each)
    own = [each if is_drawn(each) else str(Path(each).absolute()) for each in sources]
    for each in own:
        if own.count(each) > 1:
            raise UsageError(f"{each} is given twice: name each source once.")
    return LibraryRetraining(*(name, tuple(own), plans, poses, difficulty, settings, test_problems, approve))


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
    vehicle, number = asked.settings.vehicle, next_number(registry, asked.registered)
    place = folder.gained_questions(label_of(vehicle))
    learned = [each.experience.problem for each in read_gained(place, vehicle)]
    champion = registry.aliased(asked.registered)
    if champion is not None and champion.tag("vehicle") not in ("", label_of(vehicle)):
        raise UsageError(
            f"{asked.registered} is a library of {champion.tag('vehicle')}: give this one another name."
        )
    judged = [each for each in registry.versions(asked.registered) if _was_judged(each, champion)]
    if not judged:
        if not asked.sources and not learned:
            raise _nothing_to_gather(asked.name)
        line = f"{asked.name}: no champion yet; {_counted(len(learned), 'learned question')}"
        return PendingLibrary(None, number, True, True, line)
    seen = {identity for each in judged for identity in snapshot_ids(place, each.tag("learned"))}
    new = sum(question.id not in seen and not is_held_back(question) for question in learned)
    recipe, known = asked.recipe(), {each.tag("recipe") for each in judged}
    line = f"{champion_line(asked.name, champion, judged[-1])}; "
    line += f"{_counted(new, 'new question')} to learn from" if new else "nothing new was learned"
    if recipe not in known:
        line += f"{', and' if new else ', but'} it was not asked for in this way before"
    is_anew = champion is None or recipe != champion.tag("recipe")
    return PendingLibrary(champion, number, is_anew, new > 0 or recipe not in known, line)


def _was_judged(version: Version, champion: Version | None) -> bool:
    """Whether what a version was made of is not new: it was judged, or refused as the first one."""
    if champion is not None:
        return is_judged(version, champion)
    return version.tag("verdict") == REFUSED and not version.tag("against")


def check_there_is_something(data: Path, asked: LibraryRetraining) -> None:
    """Raise UsageError if there are no sources, and no data folder that may hold what was learned.

    Raises StorageError if there are none, and something else lies where the data folder would be.
    """
    if not asked.sources and data_folder_at(data) is None:
        raise _nothing_to_gather(asked.name)


def library_dry_run(data: Path, asked: LibraryRetraining) -> str:
    """Say in a line what retraining a library would find to do now, and write nothing.

    Args:
        data: the data folder, which may not be there yet.
        asked: which library, and how.

    Raises:
        RunError: the registry cannot be reached.
        StorageError: what is at ``data`` is no data folder.
        UsageError: there is nothing to gather from.
    """
    check_there_is_something(data, asked)
    folder = data_folder_at(data)
    if folder is None:
        return f"{data} is not a data folder yet: the first library {asked.name} would be gathered in it."
    pending = pending_library(folder, asked, Registry(folder))
    return f"{pending.line}: {'a library would be gathered' if pending.is_due else 'nothing would be done'}"


def _nothing_to_gather(name: str) -> UsageError:
    return UsageError(
        f"{name} has no sources, and nothing was learned: name a class, a family of manoeuvres, a map, "
        "worlds or a file of problems, or solve problems with --learn."
    )


def _counted(count: int, what: str) -> str:
    return f"{count:,} {what}{'' if count == 1 else 's'}"
