"""Tables whose checksums are right and whose rows are none of their kind: one line, and no row of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from planners.memory.plans.experience import Experience
from storage.errors import StorageError
from storage.tables.experiences import read_experiences, write_experiences
from storage.tables.hallucinated import read_hallucinated_problems, read_labelled, write_hallucinated
from storage.tables.imported_problems import read_imported, write_imported
from storage.tables.recalls import read_recalls, write_recalls
from tests.storage.samples import box, plan, problem_with

PROBLEMS = [problem_with([box(20, 20 + i)], [box(30, 30)], identity=f"p-{i}") for i in range(3)]
PLANS = 5
LOADERS: dict[str, tuple[Callable[[Path], object], ...]] = {
    "experiences": (read_experiences,),
    "imported": (read_imported,),
    "hallucinated": (read_hallucinated_problems, lambda path: read_labelled([path])),
    "recalls": (lambda path: read_recalls([path]),),
}


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> dict[str, pa.Table]:
    folder = tmp_path_factory.mktemp("tables")
    write_experiences(
        folder / "experiences",
        [Experience(problem, plan(4 + i)) for i, problem in enumerate(PROBLEMS)],
        planners=["rrt"] * 3,
        seeds=[0, 1, 2],
        planning_seconds=[0.1, 0.2, 0.3],
    )
    write_imported(folder / "imported", PROBLEMS)
    write_hallucinated(
        folder / "hallucinated",
        PROBLEMS,
        plan_index=[-1, 0, 4],
        methods=["rearrange"] * 3,
        grids=np.zeros((3, 512), np.uint8),
        labels=np.zeros((3, 1), np.uint8),
        plans=PLANS,
    )
    row = {
        "problem_id": "p", "class": "trap", "memory": "trap", "protocol": "fresh", "recall": "encoder",
        "order": [4, 0], "free": [True] * PLANS, "nothing_recalled": False, "training_seed": 0,
        "made_for": -1,
    }  # fmt: skip
    write_recalls(folder / "recalls", [row, row, row], plans=PLANS)
    for name, loaders in LOADERS.items():
        for load in loaders:
            load(folder / name)
    return {name: pq.read_table(folder / name) for name in LOADERS}


def read(table: pa.Table, name: str, folder: Path) -> list[str]:
    """What the loaders of a kind refuse."""
    path = folder / f"{name}.parquet"
    pq.write_table(table, path)
    told = []
    for load in LOADERS[name]:
        try:
            load(path)
        except StorageError as error:
            told.append(str(error))
    assert all("\n" not in line and str(path) in line for line in told)
    return told


def with_column(table: pa.Table, name: str, column: Any) -> pa.Table:
    return table.set_column(table.schema.get_field_index(name), name, column)


LIES: dict[str, Callable[[pa.Field], Any]] = {
    "nulls": lambda field: pa.array([None] * 3, field.type),
    "texts": lambda field: pa.array(["x"] * 3),
    "numbers": lambda field: pa.array([1.5, -2.0, float("nan")]),
    "large": lambda field: pa.array([2**62] * 3),
    "bits": lambda field: pa.array([b"x"] * 3),
    "empty lists": lambda field: pa.array([[]] * 3, pa.list_(pa.float64())),
    "lists of null": lambda field: pa.array([[None] * 3] * 3, pa.list_(pa.float64())),
    "lists": lambda field: pa.array([[9.0, -1.0, float("inf")]] * 3),
    "whole numbers": lambda field: pa.array([[0, 10**6]] * 3, pa.list_(pa.int32())),
    "deep lists": lambda field: pa.array([[[1.0]]] * 3),
    "objects": lambda field: pa.array([{"a": 1}] * 3),
}
COLUMNS = [
    *[("experiences", name) for name in ("id", "class", "start", "goal", "goal_radius", "bounds", "scale")],
    *[("imported", name) for name in ("vertices", "piece_starts", "obstacle_starts")],
    *[("experiences", name) for name in ("states", "controls", "dt")],
    *[("hallucinated", name) for name in ("plan_index", "method", "grid", "labels")],
    *[("recalls", name) for name in ("order", "free", "problem_id", "made_for")],
]


@pytest.mark.parametrize(("name", "column"), COLUMNS)
def test_a_column_of_anything_else_is_refused_in_one_line(
    tables: dict[str, pa.Table], tmp_path: Path, name: str, column: str
) -> None:
    table = tables[name]
    field = table.schema.field(column)
    for lie, make in LIES.items():
        lying = make(field)
        told = read(with_column(table, column, lying), name, tmp_path)
        assert told or lying.type == field.type, lie
    assert read(table.drop_columns([column]), name, tmp_path) or column in (
        "scale",
        "method",
        "made_for",
        "problem_id",
    )


def changed(table: pa.Table, name: str, row: int, change: Callable[[Any], Any]) -> pa.Table:
    values = table[name].to_pylist()
    values[row] = change(values[row])
    return with_column(table, name, pa.array(values, table.schema.field(name).type))


@pytest.mark.parametrize(
    ("name", "column", "change"),
    [
        ("imported", "start", lambda value: [*value, 1.0]),
        ("imported", "goal", lambda value: value[:1]),
        ("imported", "bounds", lambda value: [*value[:3], float("nan")]),
        ("imported", "goal_radius", lambda value: float("inf")),
        ("imported", "scale", lambda value: 0.0),
        ("imported", "scale", lambda value: 1e-320),
        ("imported", "vertices", lambda value: value[:-1]),
        ("imported", "vertices", lambda value: [float("nan"), *value[1:]]),
        ("imported", "piece_starts", lambda value: [0, 10**9, value[-1]]),
        ("imported", "piece_starts", lambda value: [-(10**9), *value[1:]]),
        ("imported", "piece_starts", lambda value: value[::-1]),
        ("imported", "piece_starts", lambda value: []),
        ("imported", "obstacle_starts", lambda value: [0, 10**9]),
        ("experiences", "states", lambda value: value[:-1]),
        ("experiences", "states", lambda value: []),
        ("experiences", "states", lambda value: [float("nan"), *value[1:]]),
        ("experiences", "controls", lambda value: value[:-2]),
        ("experiences", "controls", lambda value: [float("inf"), *value[1:]]),
        ("experiences", "dt", lambda value: 0.0),
        ("experiences", "dt", lambda value: 1e-320),
        ("hallucinated", "plan_index", lambda value: PLANS),
        ("hallucinated", "plan_index", lambda value: -2),
        ("recalls", "order", lambda value: [PLANS]),
        ("recalls", "order", lambda value: [-1]),
    ],
)
@pytest.mark.parametrize("row", [0, 2])
def test_one_row_that_cannot_be_is_refused(
    tables: dict[str, pa.Table],
    tmp_path: Path,
    name: str,
    column: str,
    change: Callable[[Any], Any],
    row: int,
) -> None:
    assert read(changed(tables[name], column, row, change), name, tmp_path)


@pytest.mark.parametrize("name", LOADERS)
@pytest.mark.parametrize(
    "lie",
    [
        {b"schema": b"\xff"},
        {b"schema": b""},
        {b"plans": b"x"},
        {b"plans": b"-1"},
        {b"plans": b"9999999999999"},
        {b"vehicle": b"{"},
        {b"vehicle": b"\xff"},
        {b"vehicle": b"[" * 100_000},
    ],
)
def test_metadata_that_lie_are_refused_in_one_line(
    tables: dict[str, pa.Table], tmp_path: Path, name: str, lie: dict[bytes, bytes]
) -> None:
    metadata = tables[name].schema.metadata
    told = read(tables[name].replace_schema_metadata(metadata | lie), name, tmp_path)
    assert told or not lie.keys() <= metadata.keys()
