"""The vehicle that a problem's fields may state."""

from __future__ import annotations

from typing import Any

from planners.world.vehicles.vehicle import CAR, VEHICLES, Vehicle, name_of
from storage.errors import StorageError
from storage.fields import parse_json, short
from storage.vehicles.definitions import definition_of, first_difference
from storage.vehicles.recorded_vehicle import record_of, vehicle_recorded
from storage.vehicles.vehicle_files import text_of

FIELD = "vehicle"  # a name, or a whole definition as an object or, in a table, as text


def statement_of(vehicle: Vehicle) -> dict[str, Any]:
    """The field that a file of problems has for a ``vehicle``; there is none for the car."""
    record = record_of(vehicle)
    return {} if record == name_of(CAR) else {FIELD: record}


def as_text(fields: dict[str, Any]) -> dict[str, Any]:
    """The ``fields`` with the vehicle as text, for a table."""
    vehicle = stated_vehicle(fields)
    return fields if vehicle is None else fields | {FIELD: text_of(vehicle)}


def stated_vehicle(fields: Any) -> Vehicle | None:
    """The vehicle that the ``fields`` of a problem state, or None.

    Raises ValueError if they state one that this program does not know.
    """
    said = fields.get(FIELD) if isinstance(fields, dict) else None
    if said is None:
        return None
    try:
        recorded = parse_json(said, FIELD) if isinstance(said, str) and said.startswith("{") else said
    except StorageError:
        recorded = None
    vehicle = vehicle_recorded(recorded)
    if vehicle is None:
        raise ValueError(
            f"vehicle is {short(said)}, expected one of {', '.join(VEHICLES)} or a whole definition, as "
            "`draw --vehicle FILE` writes it; or leave it out, and name the file of the vehicle (--vehicle, "
            "in Python vehicle=)"
        )
    return vehicle


def refuse_another_driver(stated: Vehicle | None, driver: Vehicle) -> None:
    """Raise ValueError if a problem's ``stated`` vehicle, if there is one, is not the one that drives."""
    if stated is not None and _difference(stated, driver):
        raise ValueError(
            f"is for vehicle {name_of(stated)}, but {name_of(driver)} is to drive"
            f"{_unless_named(stated, driver)}; leave out --vehicle, or use a memory of the problem's "
            "vehicle; or, if any vehicle is meant, leave out the field vehicle"
        )


def refuse_memory_of_another(stated: Vehicle, memory: str, stored: Vehicle) -> None:
    """Raise ValueError if the vehicle that problems state is not the one whose plans a memory has stored."""
    if _difference(stated, stored):
        raise ValueError(
            f"is for vehicle {name_of(stated)}, but {memory} holds plans of {name_of(stored)}"
            f"{_unless_named(stated, stored)}: name a memory of {name_of(stated)}, which `gather` collects, "
            "or `adapt` makes of this one"
        )


def _difference(stated: Vehicle, other: Vehicle) -> str:
    return first_difference(definition_of(stated), definition_of(other))


def _unless_named(stated: Vehicle, other: Vehicle) -> str:
    """How two vehicles differ, if their names do not say that they do."""
    return f": {_difference(stated, other)}" if name_of(stated) == name_of(other) else ""
