"""Lists of numbers and bits as columns and back, without a Python object for each number."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pyarrow as pa

from planners.world.arrays import Array
from planners.world.problem import Arrival, Obstacles, Problem
from storage.fields import scale_of, short, text_of

Bits = np.ndarray[tuple[int, ...], np.dtype[np.uint8]]


def problem_columns(problems: Sequence[Problem]) -> dict[str, Any]:
    """``problems`` as the columns with which every table of whole problems begins.

    How a vehicle moves at the start and is to arrive is in ``motion_columns``.
    """
    return {
        "id": [problem.id for problem in problems],
        "class": [problem.class_name for problem in problems],
        "start": list_column([problem.start for problem in problems], np.float64),
        "goal": list_column([problem.goal for problem in problems], np.float64),
        "goal_radius": [problem.goal_radius for problem in problems],
        "bounds": list_column([problem.bounds for problem in problems], np.float64),
        "scale": [problem.scale for problem in problems],
        "vertices": list_column([problem.obstacles.vertices for problem in problems], np.float32),
        "piece_starts": list_column([problem.obstacles.piece_starts for problem in problems], np.int32),
        "obstacle_starts": list_column([problem.obstacles.obstacle_starts for problem in problems], np.int32),
    }


def motion_columns(problems: Sequence[Problem]) -> dict[str, Any]:
    """How the vehicle moves at the start of ``problems``, and how it is to arrive."""
    arrivals = [None if problem.arrival is None else problem.arrival._asdict() for problem in problems]
    return {"start_motion": [list(problem.start_motion) for problem in problems], "arrival": arrivals}


def in_motion(problems: Sequence[Problem], table: pa.Table) -> list[Problem]:
    """The ``problems`` of a table with its ``motion_columns``; as they are if an earlier version wrote it.

    Raises TypeError or ValueError if a row is none.
    """
    if not {"start_motion", "arrival"} <= set(table.column_names):
        return list(problems)
    rows = zip(problems, table["start_motion"].to_pylist(), table["arrival"].to_pylist(), strict=True)
    return [_in_motion(problem, tuple(motion or ()), arrival) for problem, motion, arrival in rows]


def _in_motion(problem: Problem, motion: tuple[float, ...], fields: dict[str, Any] | None) -> Problem:
    if not all(map(math.isfinite, motion)):
        raise ValueError(f"the start of problem {short(problem.id)} is not one of numbers")
    if fields is None:
        return replace(problem, start_motion=motion)
    lists = {name: tuple(fields[name]) for name in ("hitches", "hitch_tolerances")}
    arrival = Arrival(**fields | lists)
    numbers = (arrival.heading or 0.0, arrival.heading_tolerance, *arrival.hitches, *arrival.hitch_tolerances)
    speeds = arrival.least_speed, arrival.most_speed  # any: infinite
    if not all(map(math.isfinite, numbers)) or any(map(math.isnan, speeds)):
        raise ValueError(f"the arrival of problem {short(problem.id)} is not one of numbers")
    return replace(problem, start_motion=motion, arrival=arrival)


def problems_of(table: pa.Table) -> list[Problem]:
    """The problems of a ``table`` that has the columns of ``problem_columns``.

    Raises KeyError if a column is missing, TypeError or ValueError if a row is not a problem, because kernels
    would follow starts that point elsewhere.
    """
    rows = zip(
        table["id"].to_pylist(),
        table["class"].to_pylist(),
        map(tuple, table["start"].to_pylist()),
        map(tuple, table["goal"].to_pylist()),
        table["goal_radius"].to_pylist(),
        map(tuple, table["bounds"].to_pylist()),
        lists_of(table["vertices"]),
        lists_of(table["piece_starts"]),
        lists_of(table["obstacle_starts"]),
        table["scale"].to_pylist() if "scale" in table.column_names else [1.0] * len(table),
        strict=True,
    )
    return [_problem(row) for row in rows]


def _problem(row: tuple[Any, ...]) -> Problem:
    identity, class_name, start, goal, radius, bounds, vertices, pieces, obstacles, scale = row
    whole = (
        (len(start), len(goal), len(bounds), len(vertices) % 2) == (3, 2, 4, 0)
        and all(map(math.isfinite, (*start, *goal, radius, *bounds)))
        and bool(np.isfinite(vertices).all())
        and _are_starts(pieces, len(vertices) // 2)
        and _are_starts(obstacles, len(pieces) - 1)
    )
    if not whole:
        raise ValueError(f"the row of problem {short(identity)} is not a problem")
    corners = vertices.astype(np.float64).reshape(-1, 2)
    return Problem(
        text_of(identity, "id"),
        text_of(class_name, "class"),
        start,
        goal,
        radius,
        bounds,
        Obstacles(corners, pieces.copy(), obstacles.copy()),
        scale_of(scale),
    )


def _are_starts(starts: Array, count: int) -> bool:
    """Whether ``starts [n + 1]`` divide ``count`` things into n parts, none of them empty."""
    return len(starts) > 0 and starts[0] == 0 and starts[-1] == count and bool((np.diff(starts) > 0).all())


def list_column(lists: Iterable[Any], dtype: type[np.generic]) -> pa.Array:
    """A column with one list a row, from ``lists`` of any shape, flattened, of numbers of a ``dtype``."""
    arrays = [np.asarray(values, dtype=dtype).reshape(-1) for values in lists]
    starts = np.cumsum([0] + [len(array) for array in arrays], dtype=np.int32)
    values = np.concatenate(arrays) if arrays else np.empty(0, dtype)
    return pa.ListArray.from_arrays(pa.array(starts), pa.array(values))


def lists_of(column: pa.ChunkedArray) -> list[Array]:
    """The lists of a ``column``, each a read-only array that shares the column's memory."""
    return [
        values[first:last]
        for chunk in column.chunks
        for values, starts in [(chunk.values.to_numpy(), chunk.offsets.to_numpy())]
        for first, last in pairwise(starts.tolist())
    ]


def bits_column(packed: Bits) -> pa.Array:
    """A column with one value of b bytes a row, from ``packed`` bits ``uint8 [n, b]``."""
    rows, width = packed.shape
    data = pa.py_buffer(np.ascontiguousarray(packed, dtype=np.uint8))
    return pa.Array.from_buffers(pa.binary(width), rows, [None, data])


def bits_of(column: pa.ChunkedArray) -> Bits:
    """The packed bits ``uint8 [n, b]`` of a ``column``, in one copy."""
    width = column.type.byte_width
    parts = [
        np.frombuffer(chunk.buffers()[1], np.uint8, len(chunk) * width, chunk.offset * width)
        for chunk in column.chunks
        if len(chunk)
    ]
    return np.concatenate(parts or [np.empty(0, np.uint8)]).reshape(-1, width)
