"""The fields of a problem that describe the motion at the start and the arrival at the goal."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from planners.world.arrays import Point
from planners.world.problem import GOAL_RADIUS, POSE_RADIUS, POSE_TOLERANCE, Arrival, Problem
from planners.world.vehicles.vehicle import Vehicle, name_of, state_names
from storage.fields import degrees_hint, number_of, short

STARTS: Final = {"start_speed": "speed", "start_steering": "steering", "start_turn_rate": "turn_rate"}
ENDS: Final = ("goal_tolerance", "goal_speed", "goal_hitch", "goal_hitch_tolerance")
QUESTION_FIELDS: Final = (*STARTS, "start_hitch", *ENDS)
USUAL_POSE: Final = [POSE_RADIUS, POSE_TOLERANCE]  # metres, radians
_NAME_IT: Final = "name the vehicle that the problem is for (--vehicle, in Python vehicle=)"
ANY_HEADING: Final = 3.15  # rad; half a turn, rounded up, allows any heading
ANY_SPEED: Final = 1e6  # m/s, stands for no limit in a file


class Goal(NamedTuple):
    """What a problem asks for at the goal, in the units of its file."""

    place: Point  # metres
    radius: float  # metres
    arrival: Arrival | None


def start_motion_of(fields: Mapping[str, Any], vehicle: Vehicle) -> tuple[float, ...]:
    """The motion that ``fields`` give at the start, in the order of the state of a ``vehicle``, speed first.

    Raises ValueError if a field is malformed or does not apply to the vehicle.
    """
    names = state_names(vehicle)[3:]
    hitches = [name for name in names if name.startswith("hitch")]
    _refuse_other_hitches(fields, len(hitches), vehicle)
    if all(fields.get(name) is None for name in (*STARTS, "start_hitch")):
        return ()  # as slow as it can be, and straight
    motion = dict.fromkeys(names, 0.0)
    motion["speed"] = max(vehicle.scale * vehicle.min_speed, 0.0)  # as slow as it can be
    for field, name in STARTS.items():
        if fields.get(field) is None:
            continue
        if name not in motion:
            raise ValueError(
                f"has {field}, but the state of {short(name_of(vehicle))} has {', '.join(names)}; "
                f"leave it out, or {_NAME_IT}"
            )
        motion[name] = number_of(fields[field], field)
    if fields.get("start_hitch") is not None:
        motion.update(zip(hitches, numbers_of(fields, "start_hitch", len(hitches)), strict=True))
    values = list(motion.values())
    least = int(vehicle.min_speed > 0.0)  # its speed is never left out, as it would not be 0 then
    while len(values) > least and values[-1] == 0.0:
        values.pop()
    return tuple(values)


def _refuse_other_hitches(fields: Mapping[str, Any], trailers: int, vehicle: Vehicle) -> None:
    for name in ("start_hitch", "goal_hitch"):
        given = fields.get(name)
        asks_nothing = name == "goal_hitch" and given == []
        if isinstance(given, list) and len(given) != trailers and not asks_nothing:
            has = {0: "no trailer", 1: "1 trailer"}.get(trailers, f"{trailers} trailers")
            wanted = f"list {trailers} or " if trailers else ""
            raise ValueError(
                f"{name} lists {short(given)}, one angle per trailer, but {short(name_of(vehicle))} has "
                f"{has}; {wanted}{_NAME_IT}"
            )


def goal_of(fields: Mapping[str, Any]) -> Goal:
    """The goal that ``fields`` describe. Raises ValueError if it is malformed."""
    goal = fields["goal"]
    if not isinstance(goal, list) or len(goal) not in (2, 3):
        raise ValueError(f"goal must be a list of 2 numbers, or 3 for a pose, got {short(goal)}")
    x, y, *heading = numbers_of(fields, "goal", len(goal))
    if heading:
        _refuse(fields, "goal_radius", "a pose has goal_tolerance, [metres, radians]")
        radius, turn = numbers_of(fields, "goal_tolerance", 2, USUAL_POSE)
        pose: dict[str, Any] = {"heading": heading[0], "heading_tolerance": turn}
        speeds = numbers_of(fields, "goal_speed", 2, [0.0, 0.0])
    else:
        _refuse(fields, "goal_tolerance", "a place has goal_radius; a pose is a goal with 3 numbers")
        given = fields.get("goal_radius")
        radius = GOAL_RADIUS if given is None else number_of(given, "goal_radius")
        pose, turn = {}, 0.0
        speeds = numbers_of(fields, "goal_speed", 2, [-math.inf, math.inf])
    hitches, tolerances = (tuple(_any_numbers(fields, name)) for name in ENDS[2:])
    for name, angle in (("goal_tolerance", turn), *(("goal_hitch_tolerance", each) for each in tolerances)):
        if not math.isfinite(angle):
            raise ValueError(f"{name} is {angle:g} rad; expected a finite angle above 0")
    arrival = Arrival(
        **pose, least_speed=speeds[0], most_speed=speeds[1], hitches=hitches, hitch_tolerances=tolerances
    )
    return Goal((x, y), radius, None if arrival == Arrival() else arrival)


def question_fields(problem: Problem, vehicle: Vehicle) -> dict[str, Any]:
    """The fields of a ``problem`` for a ``vehicle`` that ``start_motion_of`` and ``goal_of`` read."""
    scale, arrival = problem.scale, problem.arrival or Arrival()
    named = dict(zip(state_names(vehicle)[3:], problem.start_motion, strict=False))
    if "speed" in named:
        named["speed"] *= scale
    start: dict[str, Any] = {field: named[name] for field, name in STARTS.items() if name in named}
    hitches = [value for name, value in named.items() if name.startswith("hitch")]
    if hitches:
        start["start_hitch"] = hitches + [0.0] * (len(state_names(vehicle)) - 5 - len(hitches))
    place = [scale * coordinate + by for coordinate, by in zip(problem.goal, problem.offset, strict=True)]
    speeds = [
        min(max(scale * speed, -ANY_SPEED), ANY_SPEED) for speed in (arrival.least_speed, arrival.most_speed)
    ]
    if arrival.heading is None:
        goal = {"goal": place, "goal_radius": scale * problem.goal_radius}
        usual = [-ANY_SPEED, ANY_SPEED]
    else:
        tolerance = [scale * problem.goal_radius, arrival.heading_tolerance]
        goal = {"goal": [*place, arrival.heading], "goal_tolerance": tolerance}
        usual = [0.0, 0.0]
    if speeds != usual:
        goal["goal_speed"] = speeds
    if arrival.hitches:
        goal |= {"goal_hitch": list(arrival.hitches), "goal_hitch_tolerance": list(arrival.hitch_tolerances)}
    return start | goal


def hints_of(fields: Mapping[str, Any], problem: Problem, vehicle: Vehicle) -> dict[str, str]:
    """What to say of a problem that ``fields`` describe and that is hardly what was meant, by kind."""
    hints = {"degrees": hint_of_degrees(problem), "tolerance": hint_of_tolerance(fields, vehicle)}
    return {kind: hint for kind, hint in hints.items() if hint is not None}


def hint_of_degrees(problem: Problem) -> str | None:
    """What to say of a problem with angles that are hardly meant as radians, or None.

    A heading may have turns added, so it is not an error.
    """
    arrival = problem.arrival or Arrival()
    return (
        degrees_hint("start heading", problem.start[2])
        or degrees_hint("goal heading", arrival.heading or 0.0)
        or degrees_hint(
            "goal_tolerance", arrival.heading_tolerance, ANY_HEADING, "which any heading is within"
        )
    )


def hint_of_tolerance(fields: Mapping[str, Any], vehicle: Vehicle) -> str | None:
    """What to say if it is left out how near to end, and the usual is far for the vehicle, or None."""
    is_pose = len(fields["goal"]) == 3
    field, usual, lengths = (
        ("goal_tolerance", POSE_RADIUS, 0.5) if is_pose else ("goal_radius", GOAL_RADIUS, 2.0)
    )
    length = float(fields.get("scale") or vehicle.scale) * (vehicle.front + vehicle.rear)
    if fields.get(field) is not None or usual <= lengths * length:
        return None
    return (
        f"{field} is left out, so a plan may end {usual:g} m from the goal, "
        f"{usual / length:.1f} times the length of {short(name_of(vehicle))}; give it to end nearer"
    )


def numbers_of(
    fields: Mapping[str, Any], name: str, count: int, default: list[float] | None = None
) -> list[float]:
    """The ``count`` numbers that the field ``name`` lists, or the ``default`` if it is left out.

    Raises ValueError if the field holds anything else.
    """
    values = fields.get(name)
    if values is None and default is not None:
        return default
    if not isinstance(values, list) or len(values) != count:
        raise ValueError(f"{name} must be a list of {count} numbers, got {short(values)}")
    return [number_of(value, name) for value in values]


def _any_numbers(fields: Mapping[str, Any], name: str) -> list[float]:
    values = fields.get(name)
    return numbers_of(fields, name, len(values) if isinstance(values, list) else 1, [])


def _refuse(fields: Mapping[str, Any], name: str, why: str) -> None:
    if fields.get(name) is not None:
        raise ValueError(f"has {name}, but {why}; leave it out")
