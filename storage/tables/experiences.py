"""Experiences: solved problems with their plans."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from planners.memory.plans.experience import Experience
from planners.world.arrays import Array
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import CAR, Vehicle, state_size
from storage.errors import StorageError
from storage.fields import parse_json, short
from storage.tables.columns import (
    in_motion,
    list_column,
    lists_of,
    motion_columns,
    problem_columns,
    problems_of,
)
from storage.tables.schemas import EXPERIENCES
from storage.tables.shards import SCHEMA_KEY, metadata_of, read_table, shard_is_done, sound, write_table
from storage.vehicles.definitions import definition_of
from storage.vehicles.recorded_vehicle import refuse_another, vehicle_recorded

_CONTROL = 2
_VEHICLE = b"vehicle"  # in the file's metadata: the vehicle's settings, which also give the size of a state


class SearchedExperience(NamedTuple):
    """An experience, and the search that found its plan."""

    experience: Experience
    planner: str
    seed: int
    planning_seconds: float


def write_experiences(
    path: Path,
    experiences: Sequence[Experience],
    *,
    planners: Sequence[str],
    seeds: Sequence[int],
    planning_seconds: Sequence[float],
    key: str = "",
    vehicle: Vehicle = CAR,
) -> None:
    """Write ``experiences`` of a ``vehicle``, one a row.

    Args:
        path: the file to write.
        experiences: ``[n]``, all of the vehicle.
        planners: ``[n]``, the planner that found each.
        seeds: ``[n]``, the seed of each search.
        planning_seconds: ``[n]``, what each search took.
        key: what the experiences were made from.
        vehicle: the vehicle that drives them.
    """
    plans = [experience.plan for experience in experiences]
    columns = {
        **problem_columns([experience.problem for experience in experiences]),
        **motion_columns([experience.problem for experience in experiences]),
        **_plan_columns(plans),
        "planner": list(planners),
        "seed": list(seeds),
        "planning_seconds": list(planning_seconds),
    }
    table = pa.table(columns, schema=EXPERIENCES.with_metadata(_metadata(vehicle)))
    write_table(path, table, key)


def write_searched(path: Path, searched: Sequence[SearchedExperience], key: str, vehicle: Vehicle) -> None:
    """Like ``write_experiences``."""
    write_experiences(
        path,
        [each.experience for each in searched],
        planners=[each.planner for each in searched],
        seeds=[each.seed for each in searched],
        planning_seconds=[each.planning_seconds for each in searched],
        key=key,
        vehicle=vehicle,
    )


def read_experiences(path: Path, vehicle: Vehicle = CAR, count: int | None = None) -> list[Experience]:
    """The experiences of a ``vehicle`` in the file at ``path``, in order; only the first ``count``, if given.

    Raises StorageError if the file is missing, damaged, of another kind, or of another vehicle.
    """
    table = read_experience_table(path, vehicle)
    with sound(path):
        return experiences_of(table.slice(0, count), vehicle)


def experiences_of(table: pa.Table, vehicle: Vehicle) -> list[Experience]:
    """The experiences of a ``vehicle`` in a ``table``.

    Raises KeyError, TypeError or ValueError if a row is not one.
    """
    return [
        Experience(problem, _plan(problem, states, controls, dt, vehicle), vehicle)
        for problem, states, controls, dt in zip(
            in_motion(problems_of(table), table),
            lists_of(table["states"]),
            lists_of(table["controls"]),
            table["dt"].to_pylist(),
            strict=True,
        )
    ]


def _plan(problem: Problem, states: Array, controls: Array, dt: float, vehicle: Vehicle) -> Plan:
    plan = Plan(states.reshape(-1, state_size(vehicle)).copy(), controls.reshape(-1, _CONTROL).copy(), dt)
    finite = np.isfinite(states).all() and np.isfinite(controls).all()
    if len(plan.states) != len(plan.controls) + 1 or not finite or dt != vehicle.dt:
        raise ValueError(f"the plan of problem {short(problem.id)} does not belong to the vehicle")
    return plan


def read_searched(path: Path, rows: Sequence[int], vehicle: Vehicle) -> list[SearchedExperience]:
    """Some ``rows`` of the file at ``path``, with their searches; raises as ``read_experiences`` does."""
    table = read_experience_table(path, vehicle).take(pa.array(rows, pa.int64()))
    with sound(path):
        return searched_of(table, vehicle)


def searched_of(table: pa.Table, vehicle: Vehicle) -> list[SearchedExperience]:
    """The experiences in a ``table`` with their searches; raises as ``experiences_of`` does."""
    searches = [table[name].to_pylist() for name in ("planner", "seed", "planning_seconds")]
    return [*map(SearchedExperience, experiences_of(table, vehicle), *searches)]


def read_experience_table(path: Path, vehicle: Vehicle) -> pa.Table:
    """Like ``read_experiences``, as a table whose rows are not checked."""
    table = read_table(path, EXPERIENCES)
    refuse_another(path, _recorded(path), vehicle)
    return table


def experiences_are_done(shard: Path, key: str) -> bool:
    """Whether all of a ``shard`` of experiences can be read, and it was made from ``key``."""
    try:
        return shard_is_done(shard, key) and read_table(shard, EXPERIENCES) is not None
    except StorageError:
        return False


def merge_experiences(shards: Sequence[Path], path: Path, rows: Sequence[int], key: str = "") -> None:
    """Write some ``rows`` of the ``shards``, numbered through all of them, as one file at ``path``.

    Args:
        shards: files of experiences, in order.
        path: the file to write.
        rows: rows to take, counted from 0 through all shards.
        key: what the experiences were made from.

    Raises:
        StorageError: there are no shards, fewer rows in them, or plans of several vehicles.
    """
    tables = [read_table(shard, EXPERIENCES) for shard in shards]
    if not tables:
        raise StorageError(f"{path} cannot be made, because it has no shards; run collect.")
    if any(_recorded(shard) != _recorded(shards[0]) for shard in shards):
        raise StorageError(
            f"{path} would hold plans for several vehicles; run collect with a new data folder."
        )
    merged = pa.concat_tables(tables, promote_options="default")
    if max(rows, default=-1) >= merged.num_rows:
        raise StorageError(f"{path} needs more than the {merged.num_rows} rows that exist; run collect.")
    write_table(path, merged.take(pa.array(rows, pa.int64())), key)


def copy_experiences(source: Path, path: Path, key: str) -> int:
    """Write the experiences in the file ``source`` to ``path`` under another ``key``.

    Returns of how many problems they are.
    """
    table = read_table(source, EXPERIENCES)
    write_table(path, table, key)
    return len(table["id"].unique())


def _plan_columns(plans: Sequence[Plan]) -> dict[str, Any]:
    return {
        "states": list_column([plan.states for plan in plans], np.float64),
        "controls": list_column([plan.controls for plan in plans], np.float64),
        "dt": [plan.dt for plan in plans],
    }


def holds_experiences(path: Path) -> bool:
    """Whether the file at ``path`` is one of experiences, and not one of problems."""
    return path.suffix == ".parquet" and metadata_of(path).get(SCHEMA_KEY) == EXPERIENCES.metadata[SCHEMA_KEY]


def vehicle_of_experiences(path: Path) -> Vehicle:
    """The vehicle of the experiences in the file at ``path``. Raises StorageError if it names none."""
    vehicle = vehicle_recorded(_recorded(path))
    if vehicle is None:
        raise StorageError(f"{path} does not say which vehicle its plans are for; move it elsewhere.")
    return vehicle


def _metadata(vehicle: Vehicle) -> dict[bytes, bytes]:
    return {**EXPERIENCES.metadata, _VEHICLE: json.dumps(definition_of(vehicle)).encode()}


def _recorded(path: Path) -> Any:
    """The vehicle's settings that a file was written with."""
    return parse_json(metadata_of(path).get(_VEHICLE, b"null"), f"the vehicle of {path}")
