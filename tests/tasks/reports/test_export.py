from __future__ import annotations

import csv
import json
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from storage.errors import StorageError
from storage.places.files import write_json
from storage.places.run_folder import RunFolder
from storage.tables.attempts import write_attempts
from tasks.reports.export import export_run
from tasks.settings.errors import UsageError
from tests.storage.tables.test_tables import ATTEMPT, FAILED


@pytest.fixture
def run(tmp_path: Path) -> RunFolder:
    """A run of two classes that has a benchmark on record."""
    run = RunFolder(tmp_path / "laptop-labels-1")
    write_json(run.settings, {"seed": 7})
    record = {"stage": "benchmark", "began": "2026-11-21T18:00:00+00:00", "processor": "2 × Some CPU"}
    write_json(run.stages, [record])
    for name in ("curves", "trap"):
        rows = [{**ATTEMPT, "problem_class": name}, {**FAILED, "problem_class": name}]
        write_attempts(run.shard("results", name, 0), rows)
    return run


def test_csv_has_every_row_and_field(run: RunFolder, tmp_path: Path) -> None:
    export_run(run.path, "csv", tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(newline="") as text:
        rows = list(csv.DictReader(text))
    assert [(row["problem_class"], row["solved"]) for row in rows] == [
        ("curves", "True"), ("curves", "False"), ("trap", "True"), ("trap", "False"),
    ]  # fmt: skip
    assert rows[0]["recalled"] == "3 1 2"
    assert set(ATTEMPT) <= set(rows[0])
    assert float(rows[0]["planning_seconds"]) == ATTEMPT["planning_seconds"]


def test_an_experiment_says_where_and_how_it_was_made(run: RunFolder, tmp_path: Path) -> None:
    export_run(run.path, "planner-arena", tmp_path / "a.db")
    with closing(sqlite3.connect(tmp_path / "a.db")) as database:
        asked = "SELECT name, hostname, cpuinfo, date, seed, setup FROM experiments"
        found = database.execute(asked).fetchall()
    assert [row[0] for row in found] == ["laptop-labels-1/curves", "laptop-labels-1/trap"]
    assert found[0][1:5] == ("h", "2 × Some CPU\n", "2026-11-21 18:00:00", "1")
    assert json.loads(found[0][5]) == {"seed": 7}


@pytest.mark.parametrize(
    ("form", "name"), [("ompl", "logs"), ("planner-arena", "a.db"), ("csv", "retrieval.csv")]
)
def test_nothing_is_written_into_the_run(run: RunFolder, form: str, name: str) -> None:
    with pytest.raises(UsageError, match="is read"):
        export_run(run.path, form, run.path / name)
    assert not (run.path / name).exists()


def test_a_log_for_each_class(run: RunFolder, tmp_path: Path) -> None:
    export_run(run.path, "ompl", tmp_path / "logs")
    assert sorted(path.name for path in (tmp_path / "logs").iterdir()) == ["curves.log", "trap.log"]


@pytest.mark.parametrize("form", ["ompl", "planner-arena", "csv"])
def test_what_is_no_run_is_told_and_nothing_written(form: str, run: RunFolder, tmp_path: Path) -> None:
    out = tmp_path / {"ompl": "logs", "planner-arena": "a.db", "csv": "a.csv"}[form]
    with pytest.raises(StorageError, match="is not a run"):
        export_run(tmp_path, form, out)
    for path in run.results.rglob("*.parquet"):
        path.write_bytes(path.read_bytes()[:-9])  # cut off
    with pytest.raises(StorageError, match="not a complete Parquet file"):
        export_run(run.path, form, out)
    assert [path.name for path in tmp_path.iterdir()] == [run.path.name]


def test_a_folder_that_is_there_is_not_replaced(run: RunFolder, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="already exists"):
        export_run(run.path, "ompl", run.path)
    assert run.settings.exists()
