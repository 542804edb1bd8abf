"""Problems in users' files: ``.json`` (one), ``.jsonl`` (one per line), ``.parquet``."""

from __future__ import annotations

import json
import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from planners.world.checked_problem import checked_problem
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import CAR, Vehicle
from storage.errors import StorageError, ended
from storage.exchange.obstacle_fields import groups_of, points_of
from storage.exchange.problem_files import (
    MOVING,
    ProblemSlice,
    Unreadable,
    check_problem_fields,
    format_of,
    raw_problems,
    raw_slice,
)
from storage.exchange.question_fields import (
    goal_of,
    hints_of,
    numbers_of,
    question_fields,
    start_motion_of,
)
from storage.fields import short, text_of
from storage.places.files import whole_file, write_json
from storage.vehicles.recorded_vehicle import record_of
from storage.vehicles.stated_vehicle import (
    FIELD,
    as_text,
    refuse_another_driver,
    stated_vehicle,
    statement_of,
)
from storage.vehicles.vehicle_files import scale_for_vehicle

_LOG = logging.getLogger(__name__)
UNKNOWN_CLASS: Final = "unknown"
_MIXED: Final = (
    "names its vehicle where the first problem names none, or the other way round; put problems for "
    "different vehicles into different files"
)
_REQUIRED: Final = ("start", "goal", "bounds", "obstacles")


def read_problems(path: Path, vehicle: Vehicle = CAR) -> list[Problem]:
    """All problems in the file at ``path``, checked for a ``vehicle`` as by ``iterate_problems``."""
    return list(iterate_problems(path, vehicle))


def read_problem(
    path: Path, vehicle: Vehicle = CAR, pick: str | None = None, driving: bool = False
) -> Problem:
    """The one problem in the file at ``path`` that is asked for; only this one is checked.

    Args:
        path: the file.
        vehicle: the vehicle that drives.
        pick: the id of the problem, or else its number as messages tell it: its line, or counted from 1. Its
            id and place are logged. None takes the only one.
        driving: whether the vehicle drives along a plan: as of ``problem_fault``.

    Raises:
        StorageError: the file has no such problem, or several where none is picked; or it is malformed.
    """
    found: list[tuple[int, Any]] = []
    count = last = 0
    first_id = ""
    for count, (last, fields) in enumerate(raw_problems(path), start=1):
        identity = (fields.get("id") if isinstance(fields, Mapping) else None) or _default_id(path, last)
        first_id = first_id or identity
        if pick is not None and pick == identity:
            found = [(last, fields)]
            break
        if pick == str(last) or (pick is None and count == 1):
            found = [(last, fields)]
    if not found or (pick is None and count > 1):
        asked = "" if pick is None else f", none with the id or number {short(pick)}"
        ways = f"by its id (the first is {short(first_id)}) or its number (1 to {last})"
        choose = f"; choose one with --pick, {ways}" if count else ""
        raise StorageError(f"{path} holds {count:,} problem{'s' * (count != 1)}{asked}{choose}.")
    ((where, problem),) = _checked(path, found, vehicle, driving)
    if isinstance(problem, str):
        raise StorageError(ended(f"{where}: {problem}"))
    if pick is not None:
        _LOG.info("problem  %s (%s)", problem.id, where)
    return problem


def iterate_problems(path: Path, vehicle: Vehicle = CAR) -> Iterator[Problem]:
    """The problems in the file at ``path`` one by one, each checked for a ``vehicle`` when it is read.

    Raises StorageError if a problem is malformed, impossible or has the id of another; the message names
    file, line and id, and what to do.
    """
    for where, problem in problems_or_faults(path, vehicle):
        if isinstance(problem, str):
            raise StorageError(ended(f"{where}: {problem}"))
        yield problem


def problems_or_faults(path: Path, vehicle: Vehicle = CAR) -> Iterator[tuple[str, Problem | str]]:
    """Where each problem in the file at ``path`` stands, and the problem or what is wrong with it.

    Args:
        path: file in a format that its ending names.
        vehicle: the vehicle that must have room at the start.

    Raises:
        StorageError: the file itself is missing, unreadable or of an unknown format.
    """
    return _checked(path, raw_problems(path), vehicle)


def problems_or_faults_of(piece: ProblemSlice, vehicle: Vehicle = CAR) -> Iterator[tuple[str, Problem | str]]:
    """Like ``problems_or_faults``, for the slice ``piece``; an id may occur in another slice, too."""
    return _checked(piece.path, raw_slice(piece), vehicle, warns=piece.first == 1)


def _checked(
    path: Path,
    raw: Iterable[tuple[int, Any]],
    vehicle: Vehicle,
    driving: bool = False,
    *,
    warns: bool = True,
) -> Iterator[tuple[str, Problem | str]]:
    seen: set[str] = set()
    told: set[str] = set()  # kinds of hints
    first = None  # whether the first problem states its vehicle
    for number, fields in raw:
        where = f"{path} {'line' if path.suffix == '.jsonl' else 'problem'} {number}"
        if isinstance(fields, Unreadable):
            yield where, fields.reason
            continue
        identity = fields.get("id") if isinstance(fields, Mapping) else None
        with_id = f"{where} (id {short(identity)})" if isinstance(identity, str) and identity else where
        try:
            problem = problem_of(fields, _default_id(path, number), vehicle, driving)
            stated = isinstance(fields, Mapping) and stated_vehicle(fields) is not None
            first = stated if first is None else first
            if stated != first:
                raise ValueError(_MIXED)
        except ValueError as error:
            yield with_id, str(error)
            continue
        if problem.id in seen:
            yield f"{where} (id {short(problem.id)})", "this id occurs twice; give every problem its own"
            continue
        seen.add(problem.id)
        for kind, hint in (hints_of(fields, problem, vehicle) if warns else {}).items():
            if kind not in told:
                _LOG.warning("%s: %s.", with_id, hint)
                told.add(kind)
        yield where, problem


def _default_id(path: Path, number: int) -> str:
    """The id of a problem that has none."""
    return path.stem if path.suffix == ".json" else f"{path.stem}-{number}"


def vehicle_of_problems(path: Path) -> Vehicle | None:
    """The vehicle that the first problem in the file at ``path`` states, or None.

    Raises StorageError if the file is missing or unreadable, or states no vehicle that this program knows.
    """
    for _, fields in raw_problems(path):
        try:
            return stated_vehicle(fields)
        except ValueError as error:
            raise StorageError(ended(f"{path}: {error}")) from None
    return None


def write_problems(
    path: Path, problems: Sequence[Problem], vehicle: Vehicle = CAR, *, for_it_alone: bool = False
) -> None:
    """Write ``problems`` for a ``vehicle`` to ``path``, all or none, in the format of its ending.

    The file states its vehicle; the car only if the problems are ``for_it_alone``, as those of a family are.
    Each convex piece becomes a polygon; ``groups`` says which pieces belong to one obstacle. Files hold real
    metres, which are a problem's own lengths times its scale. Reading gives the same problems back: exactly,
    or up to the last digit if the scale is not 1.
    """
    statement = {FIELD: record_of(vehicle)} if for_it_alone else statement_of(vehicle)
    rows = [fields_of(problem, vehicle) | statement for problem in problems]
    match format_of(path):
        case ".json":
            if len(rows) != 1:
                raise StorageError(
                    f"{path} can hold only one problem, got {len(rows)}; use .jsonl or .parquet."
                )
            write_json(path, rows[0])
        case ".jsonl":
            with whole_file(path) as temporary, temporary.open("w", encoding="utf-8") as file:
                file.writelines(json.dumps(row, allow_nan=False, ensure_ascii=False) + "\n" for row in rows)
        case _:
            from storage.tables.schemas import PROBLEMS  # late: a robot may not have pyarrow
            from storage.tables.shards import table_of, write_table

            write_table(path, table_of([as_text(row) for row in rows], PROBLEMS, "problem"))


def problem_of(fields: object, default_id: str, vehicle: Vehicle = CAR, driving: bool = False) -> Problem:
    """The problem that ``fields`` of the exchange format describe, checked for a ``vehicle``.

    Args:
        fields: the fields by name.
        default_id: its id if it has none.
        vehicle: the vehicle that drives.
        driving: whether it drives along a plan: as of ``problem_fault``.

    Raises:
        ValueError: the fields describe no possible problem; the message says why.
    """
    if not isinstance(fields, Mapping):
        raise ValueError(f"is {type(fields).__name__}, expected an object with {', '.join(_REQUIRED)}")
    check_problem_fields(list(fields))
    if fields.get(MOVING) not in (None, []):
        raise ValueError(
            f"has 'moving' {short(fields[MOVING])}, but what moves is not supported; leave it out"
        )
    missing = [name for name in _REQUIRED if fields.get(name) is None]
    if missing:
        raise ValueError(f"field {missing[0]} is missing; expected {', '.join(_REQUIRED)}")
    refuse_another_driver(stated_vehicle(fields), vehicle)
    start, bounds = numbers_of(fields, "start", 3), numbers_of(fields, "bounds", 4)
    goal = goal_of(fields)
    scale = scale_for_vehicle(fields.get("scale"), vehicle)
    polygons = fields["obstacles"]
    if not isinstance(polygons, list):
        raise ValueError("obstacles must be a list of polygons, each a list of [x, y]")
    return checked_problem(
        (start[0], start[1], start[2]),
        goal.place,
        goal.radius,
        (bounds[0], bounds[1], bounds[2], bounds[3]),
        points_of(polygons),
        np.cumsum([0] + [len(polygon) for polygon in polygons], dtype=np.int64),
        vehicle=vehicle,
        problem_id=_text(fields, "id", default_id),
        class_name=_text(fields, "class", UNKNOWN_CLASS),
        scale=scale,
        groups=groups_of(fields.get("groups"), len(polygons)),
        start_motion=start_motion_of(fields, vehicle),
        arrival=goal.arrival,
        driving=driving,
    )


def _text(fields: Mapping[str, Any], name: str, default: str) -> str:
    value = fields.get(name)
    return default if value is None or value == "" else text_of(value, name)


def fields_of(problem: Problem, vehicle: Vehicle = CAR) -> dict[str, Any]:
    """The fields of the exchange format for a ``problem`` and a ``vehicle``, as ``problem_of`` takes them."""
    obstacles, scale, offset = problem.obstacles, problem.scale, problem.offset
    x, y, heading = problem.start
    groups = np.diff(obstacles.obstacle_starts).tolist()
    fields: dict[str, Any] = {
        "id": problem.id,
        "class": problem.class_name,
        "start": [scale * x + offset[0], scale * y + offset[1], heading],
        **question_fields(problem, vehicle),
        "bounds": [scale * bound + by for bound, by in zip(problem.bounds, (*offset, *offset), strict=True)],
        "obstacles": [(scale * piece + offset).tolist() for piece in obstacles.pieces()],
    }
    scaled = {} if scale == 1.0 else {"scale": scale}
    grouped = {} if all(size == 1 for size in groups) else {"groups": groups}
    return fields | scaled | grouped
