"""The vehicle that a command means: the given one, else that of the problems, else that of the memory."""

from __future__ import annotations

from pathlib import Path

from planners.world.vehicles.vehicle import Vehicle, name_of
from storage.archives.libraries import holds_plans, vehicle_of
from storage.errors import ended
from storage.exchange.problem_files import FORMATS
from storage.exchange.problems import vehicle_of_problems
from storage.vehicles.stated_vehicle import refuse_another_driver, refuse_memory_of_another
from storage.vehicles.vehicle_files import said_vehicle, text_of
from tasks.registry.model_uris import memory_folder
from tasks.settings.checks import checked_vehicle
from tasks.settings.errors import UsageError
from tasks.settings.run_settings import DEFAULT_VEHICLE


def settled_vehicle(given: str | None, problems: Path | None = None, memory: str | None = None) -> str:
    """A complete description of the vehicle that drives (``storage.vehicles.vehicle_files.said_vehicle``).

    Args:
        given: the name or file that the user gave, or None.
        problems: a file of problems, whose first may state its vehicle; None or any other path states none.
        memory: the address of a memory, which is for one vehicle, or None.

    Raises:
        UsageError: there is no vehicle with the given name, its file is wrong, or the problems are for
            another than the given one or that of the memory.
        StorageError: the problems are damaged, or the memory is missing or damaged.
        RunError: MLflow does not have the memory.
    """
    stated = _vehicle_of_problems(problems)
    if stated is None:
        stored = _vehicle_of_memory(memory) if given is None else None
        return checked_vehicle(given or (DEFAULT_VEHICLE if stored is None else text_of(stored)))
    driver = text_of(stated) if given is None else checked_vehicle(given)
    try:
        refuse_memory_of_another(stated, str(memory), _vehicle_of_memory(memory) or stated)
        refuse_another_driver(stated, said_vehicle(driver))
    except ValueError as error:
        raise UsageError(ended(f"{problems} {error}")) from None
    return driver


def vehicle_line(
    driver: str, given: str | None, problems: Path | None = None, memory: str | None = None
) -> str:
    """The line that tells people which vehicle drives, and that it is the default if nothing names one.

    Args:
        driver: what ``settled_vehicle`` returned.
        given: the name or file that the user gave, or None.
        problems: a file of problems, whose first may state its vehicle, or None.
        memory: the address of a memory, which is for one vehicle, or None.
    """
    is_named = given is not None or memory is not None or _vehicle_of_problems(problems) is not None
    default = "" if is_named else ", the default; --vehicle names another"
    return f"vehicle  {name_of(said_vehicle(driver))}{default}"


def _vehicle_of_problems(problems: Path | None) -> Vehicle | None:
    """The vehicle that the first problem of a file states; None if it states none, or is no such file."""
    is_file = problems is not None and problems.suffix in FORMATS and problems.is_file()
    return vehicle_of_problems(problems) if problems is not None and is_file else None


def _vehicle_of_memory(memory: str | None) -> Vehicle | None:
    """The vehicle of the memories at an address; None if there are none."""
    with memory_folder(memory) as folder:
        for place in () if folder is None else (folder, *sorted(folder.glob("memories/[!.]*"))):
            if holds_plans(place):
                return vehicle_of(place)
    return None
