"""The vehicle that a file was made for: how it is recorded, and how another vehicle is refused."""

from __future__ import annotations

from typing import Any

from planners.world.vehicles.vehicle import (
    VEHICLES,
    CarWithTrailers,
    Vehicle,
    name_of,
    trailers_of,
)
from storage.errors import StorageError
from storage.fields import short
from storage.vehicles.definitions import definition_of, first_difference, is_built_in, vehicle_of


def record_of(vehicle: Vehicle) -> str | dict[str, Any]:
    """The record of a ``vehicle`` in a plan's file: the name of a built-in one, else its definition."""
    return name_of(vehicle) if is_built_in(vehicle) else definition_of(vehicle)


def refuse_another(where: object, made_for: object, wanted: Vehicle) -> None:
    """Raise StorageError unless ``made_for``, as ``where`` records it, is the vehicle ``wanted``.

    Args:
        where: the file or folder that records the vehicle.
        made_for: a definition, the name of a built-in vehicle, or the record of an earlier version. The name
            of any other vehicle is not enough.
        wanted: the vehicle that is wanted.
    """
    recorded = vehicle_recorded(made_for)
    if recorded is None:
        raise StorageError(
            f"{where} was made for vehicle {short(made_for)}, expected {name_of(wanted)}; this "
            "program knows no such vehicle, make one for the expected vehicle."
        )
    difference = first_difference(definition_of(recorded), definition_of(wanted))
    if difference:
        name = recorded.about.name.decode()
        advice = f"use --vehicle {name if is_built_in(recorded) else 'with the file of that vehicle'}"
        raise StorageError(
            f"{where} was made for vehicle {name}, expected {name_of(wanted)}: {difference}; {advice}, "
            "or make one for the expected vehicle (`motion-memory adapt` does so of a memory or library)."
        )


def vehicle_recorded(made_for: object) -> Vehicle | None:
    """The vehicle that ``made_for`` records: a definition, a name, or what earlier versions wrote of one.

    None if it records no vehicle that this program knows.
    """
    for name, vehicle in VEHICLES.items():
        if made_for == name or made_for == _once_recorded(vehicle):
            return vehicle
    try:
        return vehicle_of(made_for) if isinstance(made_for, dict) else None
    except ValueError:
        return None


def _once_recorded(vehicle: Vehicle) -> dict[str, Any]:
    """The record that earlier versions, which only knew the built-in vehicles, made of one."""
    later = ("max_lateral_acceleration", "first_order", "scale", "costs", "about", "trailers")
    fields = {name: value for name, value in vehicle._asdict().items() if name not in later}
    if isinstance(vehicle, CarWithTrailers):
        first = trailers_of(vehicle)[0]
        fields |= {
            "hitch_lengths": [trailer.hitch_length for trailer in trailers_of(vehicle)],
            "trailer_front": first.front,
            "trailer_rear": first.rear,
            "trailer_width": first.width,
            "max_hitch": first.max_hitch,
        }
    return fields
