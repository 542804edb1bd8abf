"""How files record the vehicle they were made for, and refuse to be used for another."""

from __future__ import annotations

import json
from typing import Any

from planners.world.vehicles.vehicle import VEHICLES, Vehicle, name_of
from storage.errors import StorageError


def fields_of(vehicle: Vehicle) -> dict[str, Any]:
    """The vehicle's settings as JSON values."""
    fields: dict[str, Any] = json.loads(json.dumps(vehicle._asdict()))
    return fields


def refuse_another(where: object, made_for: object, wanted: Vehicle) -> None:
    """A StorageError that names both vehicles unless ``made_for``, as recorded, is the one wanted."""
    if made_for == fields_of(wanted):
        return
    names = {json.dumps(fields_of(vehicle)): name for name, vehicle in VEHICLES.items()}
    text = json.dumps(made_for)
    raise other_vehicle(where, names.get(text, text), wanted)


def other_vehicle(where: object, made_for: str, wanted: Vehicle) -> StorageError:
    """The error of something made for the vehicle of that name, wanted for another."""
    advice = f"ask for --vehicle {made_for}" if made_for in VEHICLES else "this program knows no such vehicle"
    return StorageError(
        f"{where} was made for vehicle {made_for}, wanted was {name_of(wanted)}; {advice}, or make one for "
        "the vehicle wanted."
    )
