"""The vehicle that a file was made for: how it is recorded, and how another vehicle is refused."""

from __future__ import annotations

import json
from typing import Any

from planners.world.vehicles.vehicle import VEHICLES, Vehicle, name_of
from storage.errors import StorageError


def fields_of(vehicle: Vehicle) -> dict[str, Any]:
    """The settings of a ``vehicle`` as JSON values."""
    fields: dict[str, Any] = json.loads(json.dumps(vehicle._asdict()))
    return fields


def refuse_another(where: object, made_for: object, wanted: Vehicle) -> None:
    """Raise StorageError unless ``made_for``, as ``where`` records it, is the vehicle ``wanted``."""
    if made_for == fields_of(wanted):
        return
    names = {json.dumps(fields_of(vehicle)): name for name, vehicle in VEHICLES.items()}
    text = json.dumps(made_for)
    raise other_vehicle(where, names.get(text, text), wanted)


def other_vehicle(where: object, made_for: str, wanted: Vehicle) -> StorageError:
    """The error that ``where`` was ``made_for`` the vehicle of that name, but ``wanted`` for another."""
    advice = f"ask for --vehicle {made_for}" if made_for in VEHICLES else "this program knows no such vehicle"
    return StorageError(
        f"{where} was made for vehicle {made_for}, expected {name_of(wanted)}; {advice}, or make one for "
        "the expected vehicle."
    )
