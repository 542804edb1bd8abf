"""The fields of a vehicle file, and the vehicle that they describe.

A definition holds real metres, radians and seconds. Planners work with lengths that are divided by the
vehicle's scale, a power of two, so that no digit is lost in converting there and back.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, Final

from planners.world.vehicles.vehicle import (
    MOST_TRAILERS,
    VEHICLES,
    About,
    Car,
    CarWithTrailers,
    Corners,
    Costs,
    DifferentialDrive,
    Trailer,
    Vehicle,
    name_of,
    trailers_of,
)
from storage.fields import check_fields, short, text_of
from storage.vehicles.bodies_of_files import corners_in_file, outline_of
from storage.vehicles.sizes import check_sizes, scale_for
from storage.yaml_text import yaml_number

FIELDS: Final = ("name", "kind", "body", "wheelbase", "trailers", "limits", "costs", "step")
_MAY_LACK: Final = ("trailers", "costs")
_TRAILER: Final = ("hitch_length", "body", "max_hitch")
_LIMITS: Final = {  # of each kind
    "car": ("speed", "acceleration", "steering", "steering_rate"),
    "car-first-order": ("speed", "steering"),
    "differential-drive": ("speed", "acceleration", "turn_rate", "turn_acceleration"),
    "unicycle-first-order": ("speed", "turn_rate"),
}
_MAY_HAVE: Final = ("lateral_acceleration",)  # each kind
ALL_LIMITS: Final = (
    *("speed", "acceleration", "steering", "steering_rate", "turn_rate", "turn_acceleration"),
    *_MAY_HAVE,
)
_LEAST: Final = 0.001  # of every number: far less, and planning never ends
_RANGES: Final = {  # up to, unit
    "acceleration": (100.0, "m/s^2"),
    "lateral_acceleration": (100.0, "m/s^2"),
    "steering": (1.4, "rad"),
    "steering_rate": (100.0, "rad/s"),
    "turn_rate": (50.0, "rad/s"),
    "turn_acceleration": (1000.0, "rad/s^2"),
    "wheelbase": (100.0, "m"),
    "hitch_length": (100.0, "m"),
    "max_hitch": (1.57, "rad"),
    "step": (1.0, "s"),
}
_FASTEST: Final = 100.0  # m/s
_COSTS: Final = {  # the least of each, and what is expected
    "gear_change": (0.0, "0 to 100 (s)"),
    "forwards": (1.0, "1 to 100 (what a second forwards counts as)"),
    "backwards": (1.0, "1 to 100 (what a second backwards counts as)"),
}
_DEAREST: Final = 100.0
_NAME: Final = re.compile(r"[a-z0-9](-?[a-z0-9]){0,39}")
FIRST_ORDER: Final = "-first-order"


def vehicle_of(fields: Mapping[str, Any]) -> Vehicle:
    """The vehicle that the ``fields`` of a definition describe.

    Raises ValueError whose message, the end of a sentence, names the wrong field and what it should be.
    """
    check_fields(list(fields), FIELDS)
    kind = fields.get("kind")
    if not isinstance(kind, str) or kind not in _LIMITS:
        raise ValueError(f"has the kind {short(kind)}; known are {', '.join(_LIMITS)}")
    is_car = kind.startswith("car")
    wanted = [name for name in FIELDS if name not in _MAY_LACK and (is_car or name != "wheelbase")]
    _check_complete(fields, wanted, "")
    if not is_car:
        for name in ("wheelbase", "trailers"):
            if name in fields:
                raise ValueError(f"has the field {name}, which the kind {kind} does not have; leave it out")
    name = text_of(fields["name"], "name")
    if not _NAME.fullmatch(name):
        raise ValueError(f"has the name {short(name)}; expected up to 40 of a-z, 0-9 and single hyphens")
    limits = _limits(fields["limits"], kind)
    step = _ranged(fields["step"], "step")
    body, box = outline_of(fields["body"], "body")
    wheelbase = _ranged(fields["wheelbase"], "wheelbase") if is_car else 0.0
    trailers = [_trailer(each, i) for i, each in enumerate(_list_of_trailers(fields.get("trailers")), 1)]
    first_order = kind.endswith(FIRST_ORDER)
    least, most = limits["speed"]
    turning = limits["steering"] if is_car else limits["turn_rate"]
    change = limits.get("steering_rate" if is_car else "turn_acceleration", 2.0 * turning / step)
    real: dict[str, Any] = {  # lengths are still real metres
        "front": box.front, "rear": box.rear, "width": box.width, "min_speed": least, "max_speed": most,
        "max_acceleration": limits.get("acceleration", (most - least) / step),
        "max_lateral_acceleration": limits.get("lateral_acceleration", math.inf),
    }  # fmt: skip
    costs = _costs(fields["costs"]) if fields.get("costs") is not None else Costs()
    same: dict[str, Any] = {"dt": step, "first_order": first_order, "costs": costs}
    if is_car:
        real["wheelbase"] = wheelbase
        same |= {"max_steering": turning, "max_steering_rate": change}
    else:
        same |= {"max_turn_rate": turning, "max_turn_acceleration": change}
    vehicle = _assembled(name, real, same, body, trailers, is_car, 1.0)
    check_sizes(vehicle)
    return _assembled(name, real, same, body, trailers, is_car, scale_for(vehicle))


def definition_of(vehicle: Vehicle) -> dict[str, Any]:
    """The definition of a ``vehicle`` as JSON values; ``vehicle_of`` turns it back into the same vehicle."""
    is_car, scale = not isinstance(vehicle, DifferentialDrive), vehicle.scale
    kind = "car" if is_car else "unicycle" if vehicle.first_order else "differential-drive"
    limits: dict[str, Any] = {"speed": [scale * vehicle.min_speed, scale * vehicle.max_speed]}
    if not vehicle.first_order:
        limits["acceleration"] = scale * vehicle.max_acceleration
    if math.isfinite(vehicle.max_lateral_acceleration):
        limits["lateral_acceleration"] = scale * vehicle.max_lateral_acceleration
    if isinstance(vehicle, DifferentialDrive):
        turning = {"turn_rate": vehicle.max_turn_rate, "turn_acceleration": vehicle.max_turn_acceleration}
    else:
        turning = {"steering": vehicle.max_steering, "steering_rate": vehicle.max_steering_rate}
    if vehicle.first_order:
        turning.popitem()
    definition: dict[str, Any] = {
        "name": vehicle.about.name.decode(),
        "kind": kind + (FIRST_ORDER if vehicle.first_order else ""),
        "body": corners_in_file(vehicle, scale),
    }
    if not isinstance(vehicle, DifferentialDrive):
        definition["wheelbase"] = scale * vehicle.wheelbase
    if trailers_of(vehicle):
        definition["trailers"] = [
            {
                "hitch_length": scale * trailer.hitch_length,
                "body": corners_in_file(trailer, scale),
                "max_hitch": trailer.max_hitch,
            }
            for trailer in trailers_of(vehicle)
        ]
    definition |= {"limits": limits | turning}
    changed = {name: cost for name, cost in vehicle.costs._asdict().items() if cost != getattr(Costs(), name)}
    return definition | ({"costs": changed} if changed else {}) | {"step": vehicle.dt}


def first_difference(one: object, other: object, where: str = "") -> str:
    """The first difference between two definitions; empty if plans of one are plans of the other.

    Then they differ at most in the name and in what their drives cost.
    """
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        for name in [*one, *(name for name in other if name not in one)]:
            if where or name not in ("name", "costs"):
                path = f"{where}.{name}" if where else name
                if (name in one) != (name in other):
                    return f"{path} is given only {'there' if name in one else 'here'}"
                inner = first_difference(one[name], other[name], path)
                if inner:
                    return inner
        return ""
    if isinstance(one, list) and isinstance(other, list) and one and isinstance(one[0], Mapping):
        if len(one) != len(other):
            return f"{where} are {len(one)} there and {len(other)} here"
        pairs = enumerate(zip(one, other, strict=True), start=1)
        inner_ones = (first_difference(*pair, f"{where}.{i}") for i, pair in pairs)
        return next(filter(None, inner_ones), "")
    return "" if one == other else f"{where} is {short(one)} there and {short(other)} here"


def _assembled(
    name: str,
    real: Mapping[str, float],
    same: Mapping[str, Any],
    body: tuple[Corners, ...],
    trailers: Sequence[Trailer],
    is_car: bool,
    scale: float,
) -> Vehicle:
    """A vehicle whose lengths are divided by ``scale``."""
    values = {field: value / scale for field, value in real.items()}
    about = About(name.encode(), _divided(body, scale))
    common: dict[str, Any] = {**values, **same, "scale": scale, "about": about}
    if not is_car:
        return DifferentialDrive(**common)
    if not trailers:
        return Car(**common)
    towed = tuple(
        Trailer(
            trailer.hitch_length / scale,
            trailer.front / scale,
            trailer.rear / scale,
            trailer.width / scale,
            trailer.max_hitch,
            About(b"", _divided(trailer.about.outline, scale)),
        )
        for trailer in trailers
    )
    return CarWithTrailers(**common, trailers=towed)


def _divided(outline: tuple[Corners, ...], scale: float) -> tuple[Corners, ...]:
    return tuple(tuple((x / scale, y / scale) for x, y in polygon) for polygon in outline)


def _check_complete(fields: Mapping[str, Any], wanted: Sequence[str], where: str) -> None:
    for name in wanted:
        if fields.get(name) is None:
            raise ValueError(f"lacks the field {where}{name}; expected {', '.join(wanted)}")


def _limits(fields: object, kind: str) -> dict[str, Any]:
    if not isinstance(fields, Mapping):
        raise ValueError(f"has limits {short(fields)}; expected fields {', '.join(_LIMITS[kind])}")
    known = (*_LIMITS[kind], *_MAY_HAVE)
    for name in fields:
        if name in ALL_LIMITS and name not in known:
            raise ValueError(f"has the limit {name}, which the kind {kind} does not have; leave it out")
    check_fields([f"limits.{name}" for name in fields], [f"limits.{name}" for name in known])
    _check_complete(fields, _LIMITS[kind], "limits.")
    speeds = fields["speed"]
    if not isinstance(speeds, list) or len(speeds) != 2:
        raise ValueError(f"has limits.speed {short(speeds)}; expected [least, most] in m/s")
    least, most = (yaml_number(speed, "limits.speed") for speed in speeds)
    if not (-_FASTEST <= least < most <= _FASTEST and most >= _LEAST):
        raise ValueError(
            f"has limits.speed [{least:g}, {most:g}] m/s; expected [least, most] with most above the least, "
            f"from {_LEAST:g}, both within {_FASTEST:g}"
        )
    given = [name for name in known if name != "speed" and name in fields]
    others = {name: _ranged(fields[name], name, "limits.") for name in given}
    return {"speed": (least, most), **others}


def _costs(fields: object) -> Costs:
    if not isinstance(fields, Mapping):
        raise ValueError(f"has costs {short(fields)}; expected fields {', '.join(_COSTS)}")
    check_fields([f"costs.{name}" for name in fields], [f"costs.{name}" for name in _COSTS])
    costs = {name: yaml_number(fields[name], f"costs.{name}") for name in fields}
    for name, cost in costs.items():
        least, expected = _COSTS[name]
        if not least <= cost <= _DEAREST:
            raise ValueError(f"has costs.{name} {cost!r}; expected {expected}")
    return Costs(**costs)


def _list_of_trailers(trailers: object) -> list[Any]:
    if trailers is None:
        return []
    if not isinstance(trailers, list) or not 1 <= len(trailers) <= MOST_TRAILERS:
        raise ValueError(
            f"has trailers {short(trailers)}; expected a list of 1 to {MOST_TRAILERS} with "
            f"{', '.join(_TRAILER)}, or nothing"
        )
    return trailers


def _trailer(fields: object, number: int) -> Trailer:
    where = f"trailer {number} "
    if not isinstance(fields, Mapping):
        raise ValueError(f"has {where}{short(fields)}; expected fields {', '.join(_TRAILER)}")
    check_fields(list(fields), _TRAILER, where)
    _check_complete(fields, _TRAILER, where)
    outline, box = outline_of(fields["body"], where + "body")
    length, fold = (_ranged(fields[name], name, where) for name in ("hitch_length", "max_hitch"))
    return Trailer(length, *box, fold, About(b"", outline))


def _ranged(value: object, name: str, where: str = "") -> float:
    """A number in the range of its kind. Raises ValueError, which says the range and its unit."""
    most, unit = _RANGES[name]
    number = yaml_number(value, where + name)
    if not _LEAST <= number <= most:
        raise ValueError(f"has {where}{name} {number:g} {unit}; expected {_LEAST:g} to {most:g}")
    return number


def is_built_in(vehicle: Vehicle) -> bool:
    """Whether a ``vehicle`` is one of the built-in vehicles."""
    return VEHICLES.get(name_of(vehicle)) == vehicle
