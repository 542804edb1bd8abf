"""Libraries of plans on disk: archives of the plans as plain arrays, and of the questions they answer."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from planners.memory.library.plan_library import PlanLibrary
from planners.memory.memory import Memory
from planners.memory.plans.plan_arrays import StoredPlans
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR, Vehicle
from storage.archives.archive import (
    archived_vehicle,
    check_sizes,
    kind_of,
    read_archive,
    read_header,
    write_archive,
)
from storage.archives.memories import load_memory
from storage.archives.plan_files import PLAN_FILES, files_of_plans, plans_in
from storage.errors import StorageError
from storage.fields import scale_of, short, text_of
from storage.places.run_folder import checked_name

_KIND: Final = "library"
_HEADER: Final = f"{_KIND}.json"
_KINDS: Final = ("memory", _KIND)
HEADERS: Final = tuple(f"{kind}.json" for kind in _KINDS)  # one is in the folder of a memory, of a library
_DRIFT: Final = 1e-6  # metres and radians by which states may differ from the simulated controls


class LibraryFacts(NamedTuple):
    """What a library says of itself, without its plans."""

    class_name: str  # of the questions
    questions: tuple[str, ...]  # [N] the id of the question that each plan answered
    scales: tuple[float, ...]  # of the questions: real metres in one metre of a plan
    vehicle: Vehicle


def holds_plans(folder: Path) -> bool:
    """Whether a folder is that of a memory or a library."""
    return any((folder / header).is_file() for header in HEADERS)


def save_library(folder: Path, library: PlanLibrary, gathered: Any = None) -> None:
    """Write a ``library`` as a ``folder``, whole or not at all; the same plans give the same bytes.

    Args:
        folder: where it is written.
        library: the library.
        gathered: JSON that says how it was gathered, for ``how_gathered``.
    """
    header = {
        "gathered": gathered,
        "class": library.class_name,
        "questions": list(library.questions),
        "scales": list(library.scales),
    }
    write_archive(folder, _KIND, library.vehicle, header, files_of_plans(library.plans))


def how_gathered(folder: Path) -> Any:
    """What ``save_library`` was told of how the library in a ``folder`` was gathered; None if nothing was.

    Raises StorageError if the library is damaged.
    """
    return read_header(folder, _KIND).get("gathered") if (folder / _HEADER).is_file() else None


def load_library(folder: Path, vehicle: Vehicle = CAR) -> PlanLibrary:
    """The library of a ``vehicle`` in a ``folder``; its plans are read from the disk when used.

    Checksums show that files are unchanged, not that they are true. Therefore the controls of every plan are
    simulated again, and must lead through its states.

    Raises StorageError if it is missing or damaged, contradicts its header, has another version, or is for
    another vehicle.
    """
    header, files = read_archive(folder, _KIND, vehicle)
    try:
        if files.keys() != PLAN_FILES:
            raise ValueError(f"missing or too many: {', '.join(sorted(files.keys() ^ PLAN_FILES))}")
        plans = plans_in(files, vehicle)
        _check_driven(plans, vehicle)
        facts = _facts(header, vehicle)
        return PlanLibrary(facts.class_name, vehicle, plans, facts.questions, facts.scales)
    except (KeyError, TypeError, ValueError, StorageError) as error:
        raise _incomplete(folder, error) from None


def library_facts(folder: Path) -> LibraryFacts:
    """What the library in a ``folder`` says of itself; of its plans only the lengths of their files count.

    Raises StorageError if its header or a file is missing or damaged, or it has another version.
    """
    header = read_header(folder, _KIND)
    vehicle = archived_vehicle(folder, header)
    check_sizes(folder, _KIND, header)
    try:
        return _facts(header, vehicle)
    except (KeyError, TypeError, ValueError) as error:
        raise _incomplete(folder, error) from None


def vehicle_of(folder: Path) -> Vehicle:
    """The vehicle for which the memory or the library in a ``folder`` was made. Raises as loading does."""
    return archived_vehicle(folder, read_header(folder, kind_of(folder, *_KINDS)))


def load_memory_or_library(folder: Path, vehicle: Vehicle = CAR) -> Memory | PlanLibrary:
    """The memory or the library of a ``vehicle`` in a ``folder``. Raises StorageError if there is neither."""
    load = load_library if kind_of(folder, *_KINDS) == _KIND else load_memory
    return load(folder, vehicle)


def _check_driven(plans: StoredPlans, vehicle: Vehicle) -> None:
    """Raise ValueError if the controls of a plan do not lead through its states."""
    for number, plan in enumerate(plans):
        driven = simulate(plan.states[0], plan.controls, vehicle)
        if not np.abs(driven - plan.states).max() <= _DRIFT:
            raise ValueError(f"the controls of its plan {number} do not lead through its states")


def _facts(header: dict[str, Any], vehicle: Vehicle) -> LibraryFacts:
    class_name = checked_name(text_of(header["class"], "class"))
    return LibraryFacts(class_name, _texts(header["questions"]), _scales(header["scales"]), vehicle)


def _incomplete(folder: Path, error: Exception) -> StorageError:
    reason = str(error).rstrip(".")
    return StorageError(f"{folder} is not a complete library ({reason}); gather it again.")


def _texts(value: object) -> tuple[str, ...]:
    if not isinstance(value, list):
        raise ValueError(f"its questions are {short(value)}, expected a list")
    return tuple(text_of(each, "question") for each in value)


def _scales(value: object) -> tuple[float, ...]:
    if not isinstance(value, list) or not value or len({scale_of(scale) for scale in value}) < len(value):
        raise ValueError(f"its scales are {short(value)}, expected distinct numbers")
    return tuple(scale_of(scale) for scale in value)
