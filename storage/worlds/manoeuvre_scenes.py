"""Published manoeuvres between poses: TPCAP, dynobench and Bench-MR, one reader each.

A reader gives the fields of a problem as ``storage.exchange.problems`` takes them, in the frame of the file.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from planners.world.vehicles.vehicle import DifferentialDrive, Vehicle, trailers_of
from storage.fields import number_of, parse_json, short, text_of
from storage.places.files import read_text
from storage.worlds.limits import check_file, whole_number
from storage.yaml_text import yaml_fields

LARGEST_FILE: Final = 10_000_000  # bytes
PARKED: Final = [0.05, math.radians(1.0)]  # metres and radians: how exactly a car must stop
AROUND_M: Final = 20.0  # how far the ground of a TPCAP case reaches around its ends; it has no border
DISTANCE: Final = 0.1  # dynobench's, weighted, within which a goal is reached
_BRACKETS: Final = 4_000  # of a dynobench environment in YAML

Fields = dict[str, Any]


def tpcap_cases(file: Path, vehicle: Vehicle) -> Iterator[tuple[str, Fields | str]]:
    """Cases of the Trajectory Planning Competition of Automated Parking: one in a ``.csv``, many in JSON.

    A ``.csv`` is one line: start and goal pose, the number of obstacles, of the corners of each, and these.
    JSON has ``cases``, each with ``id``, ``start``, ``goal`` and ``obstacles``. For any ``vehicle``. Raises
    ValueError or StorageError with what is wrong with the file.
    """
    check_file(file, LARGEST_FILE, "is it a case of TPCAP?")

    def read(case: Mapping[str, Any]) -> Fields:
        start, goal = _numbers(case, "start", 3), _numbers(case, "goal", 3)
        ends = list(zip(start[:2], goal[:2], strict=True))
        bounds = [min(end) - AROUND_M for end in ends] + [max(end) + AROUND_M for end in ends]
        return _pose_to_pose(start, goal, bounds, case.get("obstacles"))

    cases = [_case_of_line(file)] if file.suffix == ".csv" else _listed(_object(file), "cases")
    yield from _each(cases, read)


def _each(
    cases: Sequence[Mapping[str, Any]], read: Callable[[Mapping[str, Any]], Fields | str]
) -> Iterator[tuple[str, Fields | str]]:
    """The id of each case with its fields, or with why it cannot be read."""
    for number, case in enumerate(cases, start=1):
        identity = f"number {number}"
        try:
            identity = _id(case)
            fields = read(case)
        except ValueError as error:
            if len(cases) == 1:
                raise
            fields = str(error)
        yield identity, fields


def _pose_to_pose(start: list[float], goal: list[float], bounds: list[float], obstacles: object) -> Fields:
    poses = {"start": start, "goal": goal, "goal_tolerance": PARKED}
    return {**poses, "bounds": bounds, "obstacles": obstacles}


def _case_of_line(file: Path) -> Fields:
    words = [word.strip() for row in csv.reader(read_text(file).splitlines()) for word in row if word.strip()]
    numbers = iter(words)

    def next_number(what: str) -> float:
        word = next(numbers, "")
        try:
            return float(word)
        except ValueError:
            raise ValueError(f"has {short(word)} where {what} was expected; is it cut off?") from None

    def next_count(what: str) -> int:
        count = whole_number(word := next(numbers, ""))
        if count is None or count > len(words):
            raise ValueError(f"has {short(word)} where {what} was expected; is it cut off?")
        return count

    start, goal = ([next_number(f"a number of the {end}") for _ in range(3)] for end in ("start", "goal"))
    counts = [next_count("a number of corners") for _ in range(next_count("the number of obstacles"))]
    obstacles = [[[next_number("x"), next_number("y")] for _ in range(count)] for count in counts]
    if (extra := next(numbers, None)) is not None:
        raise ValueError(f"continues with {short(extra)} after its last obstacle; are its counts right?")
    return {"id": file.stem, "start": start, "goal": goal, "obstacles": obstacles}


def bench_mr_scenes(file: Path, vehicle: Vehicle) -> Iterator[tuple[str, Fields | str]]:
    """Problems between poses in Bench-MR's polygon scenes, packed as JSON, for any ``vehicle``.

    The file has ``environments``, lists of polygons by name, and ``problems``, each with ``id``,
    ``environment``, ``start``, ``goal`` and ``bounds``. The bounds contain the reference point, not the body,
    so they are widened by the vehicle's reach. Raises ValueError or StorageError.
    """
    check_file(file, LARGEST_FILE, "is it a file with scenes of Bench-MR?")
    fields = _object(file)
    environments = fields.get("environments")
    if not isinstance(environments, Mapping):
        raise ValueError("has no environments (polygons by name of scene); is it from Bench-MR?")
    reach = vehicle.scale * math.hypot(max(vehicle.front, vehicle.rear), 0.5 * vehicle.width)

    def read(problem: Mapping[str, Any]) -> Fields:
        name = text_of(problem.get("environment"), "environment")
        if name not in environments:
            raise ValueError(f"has no environment {short(name)}; it has {', '.join(environments)}")
        start, goal = _numbers(problem, "start", 3), _numbers(problem, "goal", 3)
        bounds = _widened(_corners(problem.get("bounds")), reach)
        return _pose_to_pose(start, goal, bounds, environments[name])

    yield from _each(_listed(fields, "problems"), read)


def dynobench_problems(file: Path, vehicle: Vehicle) -> Iterator[tuple[str, Fields | str]]:
    """Problems of dynobench, one in its YAML or many packed as JSON, or why they are not for a ``vehicle``.

    The vehicle of the model ``car1_v0`` is called ``dynobench-car1-v0``. JSON has ``problems``, each with
    ``id``, ``model``, ``start``, ``goal``, ``bounds`` and ``obstacles``. The bounds contain the reference
    point; they are widened so far that whoever stays in them keeps it there. Raises ValueError or
    StorageError.
    """
    check_file(file, LARGEST_FILE, "is it a problem of dynobench?")

    def read(problem: Mapping[str, Any]) -> Fields | str:
        model = text_of(problem.get("model"), "model")
        wanted = f"dynobench-{model.replace('_', '-')}"
        if vehicle.about.name.decode() != wanted:
            return f"is for the model {model}; use it with a --vehicle named {wanted}"
        fields: Fields = {"bounds": _widened(_corners(problem.get("bounds")), _inscribed(vehicle))}
        fields["obstacles"] = [_box(each) for each in _listed(problem, "obstacles")]
        size = 3 + (len(trailers_of(vehicle)) if vehicle.first_order else 2)
        fields |= _start(_numbers(problem, "start", size), vehicle)
        return fields | _goal(_numbers(problem, "goal", size), vehicle)

    yield from _each(_listed(_object(file), "problems") if file.suffix == ".json" else [_in_yaml(file)], read)


def _inscribed(vehicle: Vehicle) -> float:
    """How far the first body extends from its reference point in every direction, in metres."""
    return vehicle.scale * min(vehicle.front, vehicle.rear, 0.5 * vehicle.width)


def _widened(bounds: list[float], by: float) -> list[float]:
    x_min, y_min, x_max, y_max = bounds
    return [x_min - by, y_min - by, x_max + by, y_max + by]


def _in_yaml(file: Path) -> Fields:
    fields = yaml_fields(file, "problem of dynobench", ("name", "environment", "robots"), _BRACKETS)
    environment, robots = fields.get("environment"), fields.get("robots")
    if not (isinstance(environment, Mapping) and isinstance(robots, list) and len(robots) == 1):
        raise ValueError("has no environment with one robot; problems of several are not supported")
    robot = robots[0]
    if not isinstance(robot, Mapping):
        raise ValueError("has a robot without type, start and goal; is it from dynobench?")
    return {
        "id": file.stem,
        "model": robot.get("type"),
        "start": robot.get("start"),
        "goal": robot.get("goal"),
        "bounds": [environment.get("min"), environment.get("max")],
        "obstacles": environment.get("obstacles"),
    }


def _start(state: list[float], vehicle: Vehicle) -> Fields:
    x, y, heading, *rest = state
    fields: Fields = {"start": [x, y, heading]}
    if not vehicle.first_order:
        turning = "start_turn_rate" if isinstance(vehicle, DifferentialDrive) else "start_steering"
        fields |= {"start_speed": rest[0], turning: rest[1]}
    elif rest:  # the headings of the trailers
        fields["start_hitch"] = _hitches(heading, rest)
    return fields


def _goal(state: list[float], vehicle: Vehicle) -> Fields:
    """What is asked at the goal: all of it together is within dynobench's distance.

    That is 1 m of place and 0.5 of each heading, and for speeds 0.25 of each (0.2 for ``car2_v0``). Speeds of
    the first order are controls and may be any. Neither turn rate nor steering can be asked for at the goal.
    """
    x, y, heading, *rest = state
    fields: Fields = {"goal": [x, y, heading], "goal_tolerance": [0.4 * DISTANCE, 1.2 * DISTANCE]}
    low, high = vehicle.scale * vehicle.min_speed, vehicle.scale * vehicle.max_speed
    fields["goal_speed"] = [low, high]
    if not vehicle.first_order:
        fields["goal_tolerance"] = [0.4 * DISTANCE, 0.6 * DISTANCE]
        fields["goal_speed"] = [max(rest[0] - 0.4 * DISTANCE, low), min(rest[0] + 0.4 * DISTANCE, high)]
    elif rest:
        angle = 0.4 * DISTANCE  # of the car, and as much again of the hitch
        fields |= {"goal_tolerance": [0.4 * DISTANCE, angle], "goal_hitch": _hitches(heading, rest)}
        fields["goal_hitch_tolerance"] = [angle] * len(rest)
    return fields


def _hitches(heading: float, trailers: list[float]) -> list[float]:
    """Hitch angles of a car of this heading whose trailers have these."""
    return [ahead - behind for ahead, behind in zip([heading, *trailers], trailers, strict=False)]


def _box(obstacle: Mapping[str, Any]) -> list[list[float]]:
    if obstacle.get("type", "box") != "box":
        raise ValueError(f"has an obstacle of type {short(obstacle['type'])}; only boxes are supported")
    (x, y), (length, width) = (_any_numbers(obstacle, name)[:2] for name in ("center", "size"))
    return [[x + u * length, y + w * width] for u, w in ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))]


def _object(file: Path) -> Mapping[str, Any]:
    fields = parse_json(read_text(file), str(file))
    if not isinstance(fields, Mapping):
        raise ValueError(f"holds {short(fields)}, expected an object")
    return fields


def _listed(fields: Mapping[str, Any], name: str) -> list[Mapping[str, Any]]:
    values = fields.get(name)
    if not isinstance(values, list) or not all(isinstance(each, Mapping) for each in values):
        raise ValueError(f"has no list of {name}; is it in this format?")
    return values


def _id(fields: Mapping[str, Any]) -> str:
    return text_of(fields.get("id"), "id")


def _any_numbers(fields: Mapping[str, Any], name: str) -> list[float]:
    values = fields.get(name)
    if not isinstance(values, list) or len(values) < 2:
        raise ValueError(f"{name} must be a list of numbers, got {short(values)}")
    return [number_of(value, name) for value in values]


def _numbers(fields: Mapping[str, Any], name: str, count: int) -> list[float]:
    values = _any_numbers(fields, name)
    if len(values) != count:
        raise ValueError(f"{name} must be a list of {count} numbers, got {short(values)}")
    return values


def _corners(bounds: object) -> list[float]:
    """Least x and y, greatest x and y, of two corners."""
    if not isinstance(bounds, list) or len(bounds) != 2:
        raise ValueError(f"bounds must be two corners, got {short(bounds)}")
    low, high = (_any_numbers({"bounds": corner}, "bounds")[:2] for corner in bounds)
    return [*low, *high]


Reader = Callable[[Path, Vehicle], Iterator[tuple[str, Fields | str]]]
READERS: Final[dict[str, Reader]] = {
    "tpcap": tpcap_cases,
    "bench-mr": bench_mr_scenes,
    "dynobench": dynobench_problems,
}
