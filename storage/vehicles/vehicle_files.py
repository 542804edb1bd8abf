"""Vehicles by name or from a YAML file (docs/vehicles.md), and as text with the whole definition."""

from __future__ import annotations

import functools
import hashlib
import json
from pathlib import Path
from typing import Final

from planners.world.vehicles.vehicle import VEHICLES, Vehicle, name_of
from storage.errors import StorageError, ended
from storage.fields import nearest, parse_json, scale_of, short
from storage.vehicles.definitions import FIELDS, definition_of, is_built_in, vehicle_of
from storage.yaml_text import yaml_fields

ENDINGS: Final = (".yaml", ".yml")
BUILT_IN: Final = Path(__file__).parent / "built_in"  # a file for each vehicle that has a name
_MOST_BRACKETS: Final = 2_000  # a few hundred corners


def read_vehicle(file: Path) -> Vehicle:
    """The vehicle that a YAML ``file`` describes.

    Raises StorageError, with one line, if the file is missing or unreadable, if one of its fields is unknown,
    missing or out of range, or if its fields contradict each other.
    """
    if not file.is_file():
        raise StorageError(
            f"{file} does not exist; give a vehicle's file, or one of the names {', '.join(VEHICLES)}."
        )
    try:
        vehicle = vehicle_of(yaml_fields(file, "vehicle", FIELDS, _MOST_BRACKETS))
        if vehicle.about.name.decode() in VEHICLES and not is_built_in(vehicle):
            raise ValueError(
                f"has the name of another vehicle, {short(vehicle.about.name.decode())}; choose another name"
            )
    except ValueError as error:
        raise StorageError(ended(f"{file} {error}")) from None
    return vehicle


def scale_for_vehicle(stated: object, vehicle: Vehicle) -> float:
    """The scale of a problem or a map for a ``vehicle``: its own unless one is ``stated``.

    A vehicle from a file has the size that the file states, so another scale would be a mistake. The built-in
    vehicles stand for robots of any size. Raises ValueError, with the end of a sentence as its message.
    """
    scale = vehicle.scale if stated is None else scale_of(stated)
    if scale != vehicle.scale and not is_built_in(vehicle):
        raise ValueError(
            f"scale is {scale:g}, but the scale of {name_of(vehicle)} is {vehicle.scale:g}, which follows "
            "from its size; leave the scale out, or name the vehicle that the problem is for (--vehicle, in "
            "Python vehicle=)"
        )
    return scale


def label_of(vehicle: Vehicle) -> str:
    """A word that identifies a ``vehicle``: its name and, unless it is built in, a digest."""
    if is_built_in(vehicle):
        return name_of(vehicle)
    definition = json.dumps(definition_of(vehicle), sort_keys=True)
    name = vehicle.about.name.decode()
    return f"{name}-{hashlib.sha256(definition.encode()).hexdigest()[:8]}"


def text_of_vehicle(given: str) -> str:
    """The complete text for a vehicle that was ``given`` by name, by the path of its file, or by such a text.

    For a built-in vehicle this is its name. Raises StorageError, with one line, if there is no such vehicle.
    """
    if given in VEHICLES:
        return given
    return text_of(said_vehicle(given) if given.startswith("{") else read_vehicle(_path(given)))


def text_of(vehicle: Vehicle) -> str:
    """The complete text for a ``vehicle``: the name of a built-in one, else its definition as JSON."""
    return name_of(vehicle) if is_built_in(vehicle) else json.dumps(definition_of(vehicle))


def said_vehicle(text: str) -> Vehicle:
    """The vehicle that a text of ``text_of_vehicle``, or one of its arguments, describes.

    Raises StorageError, with one line, if there is none.
    """
    if text.startswith("{"):
        return _defined(text)
    return VEHICLES[text] if text in VEHICLES else read_vehicle(_path(text))


@functools.lru_cache(maxsize=64)
def _defined(text: str) -> Vehicle:
    fields = parse_json(text, "The vehicle")
    try:
        return vehicle_of(fields)
    except ValueError as error:
        raise StorageError(ended(f"The vehicle {error}")) from None


def _path(given: str) -> Path:
    path = Path(given)
    if path.suffix in ENDINGS:
        return path
    raise StorageError(
        f"Unknown vehicle {short(given)}{nearest(given, VEHICLES)}. Known: {', '.join(VEHICLES)}, or a "
        "vehicle's .yaml file."
    )
