"""The exports are what the ``ompl`` package's own benchmark statistics script makes and reads."""

from __future__ import annotations

import os
import sqlite3
import subprocess
import sys
from contextlib import closing
from datetime import datetime
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from storage.errors import StorageError
from storage.exchange.ompl_log import write_ompl_logs
from storage.exchange.planner_arena import PROPERTIES, Origin, write_planner_arena
from storage.tables.attempts import read_attempts, write_attempts
from tests.storage.tables.test_tables import ATTEMPT, FAILED

TABLES = ("experiments", "plannerConfigs", "enums", "runs", "progress")
ORIGIN = Origin(
    run_name="laptop-labels-1",
    version="1.2.3",
    setup='{\n  "seed": 1\n}\n',
    processor="2 × Some CPU @ 2.0GHz\n",
    date=datetime(2026, 11, 21, 18, 0),
)


@pytest.fixture
def classes(tmp_path: Path) -> dict[str, Path]:
    """Attempts of two classes and three configurations, some failed, in two files a class."""
    rng = np.random.default_rng(0)
    asked = [("none", 0, None), ("closed", 5, "own"), ("closed", 5, "combined")]
    for name in ("curves", "trap"):
        for chunk in range(2):
            rows = [
                {
                    **(FAILED if rng.random() < 0.3 else ATTEMPT),
                    "problem_id": f"{name}-{chunk}-{i}",
                    "problem_class": name,
                    "planner": planner,
                    "assist": assist,
                    "top_k": top_k,
                    "memory": name if memory == "own" else memory,
                    "planning_seconds": float(rng.lognormal(-7.0)),
                }
                for i in range(5)
                for planner in ("gust", "rrt")
                for assist, top_k, memory in asked
            ]
            write_attempts(tmp_path / "results" / name / f"{chunk:04d}.parquet", rows)
    return {name: tmp_path / "results" / name for name in ("curves", "trap")}


@pytest.fixture
def made_by_ompl(tmp_path: Path, classes: dict[str, Path]) -> Path:
    """The database that OMPL's script makes of our logs."""
    write_ompl_logs(tmp_path / "logs", classes, ORIGIN)
    logs = [str(tmp_path / "logs" / f"{name}.log") for name in classes]
    script = "from ompl.ompl_benchmark_statistics import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", script, "--database", str(tmp_path / "theirs.db"), *logs],
        capture_output=True, text=True, timeout=120, env=os.environ | {"PYTHONPATH": ""},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("Parsing data for") == 12
    return tmp_path / "theirs.db"


def table(path: Path, name: str) -> tuple[list[tuple[str, str]], list[tuple[object, ...]]]:
    with closing(sqlite3.connect(path)) as database:
        columns = [(row[1], row[2]) for row in database.execute(f"PRAGMA table_info({name})")]
        return columns, database.execute(f"SELECT * FROM {name} ORDER BY 1, 2").fetchall()


def test_the_log_through_ompl_s_reader_is_our_database(
    tmp_path: Path, classes: dict[str, Path], made_by_ompl: Path
) -> None:
    write_planner_arena(tmp_path / "ours.db", classes, ORIGIN)
    for name in TABLES:
        ours, theirs = table(tmp_path / "ours.db", name), table(made_by_ompl, name)
        assert ours[0] == theirs[0]
        assert len(ours[1]) == len(theirs[1])
        for mine, other in zip(ours[1], theirs[1], strict=True):
            for value, read in zip(mine, other, strict=True):
                assert type(value) is type(read)
                assert value == (pytest.approx(read, rel=1e-14) if isinstance(read, float) else read)


def test_first_columns_stand_where_planner_arena_reads_them(tmp_path: Path, classes: dict[str, Path]) -> None:
    write_planner_arena(tmp_path / "ours.db", classes, ORIGIN)
    names = {name: [column for column, _ in table(tmp_path / "ours.db", name)[0]] for name in TABLES}
    assert names["experiments"] == [
        "id", "name", "totaltime", "timelimit", "memorylimit", "runcount", "version", "hostname", "cpuinfo",
        "date", "seed", "setup",
    ]  # fmt: skip
    assert names["plannerConfigs"] == ["id", "name", "settings"]
    assert names["enums"] == ["name", "value", "description"]
    assert names["runs"][:8] == [
        "id", "experimentid", "plannerid", "time", "memory", "solved", "status", "solution_length",
    ]  # fmt: skip
    assert names["progress"][:2] == ["runid", "time"]


def test_every_attempt_is_a_run_of_its_class_and_planner(tmp_path: Path, classes: dict[str, Path]) -> None:
    write_planner_arena(tmp_path / "ours.db", classes, ORIGIN)
    asked = (
        "SELECT e.name AS experiment, p.name AS planner, s.description AS ended, r.* FROM runs r "
        "JOIN experiments e ON e.id = experimentid JOIN plannerConfigs p ON p.id = plannerid "
        "JOIN enums s ON s.name = 'status' AND s.value = r.status"
    )
    with closing(sqlite3.connect(tmp_path / "ours.db")) as database:
        runs = pd.read_sql(asked, database).sort_values(["problem_id", "planner"], ignore_index=True)
    rows = read_attempts(tmp_path / "results")
    memory = rows["memory"].map(lambda name: f", memory {name}", na_action="ignore").fillna("")
    label = rows["assist"] + rows["top_k"].map(lambda k: f" {k} encoder" if k else "")
    rows = rows.assign(planner=rows["planner"] + " " + label + memory)
    rows = rows.sort_values(["problem_id", "planner"], ignore_index=True)
    assert runs["experiment"].tolist() == [f"laptop-labels-1/{name}" for name in rows["problem_class"]]
    for ours, theirs in (("planner", "planner"), ("ended", "status"), ("problem_id", "problem_id")):
        assert runs[ours].tolist() == rows[theirs].tolist()
    np.testing.assert_array_equal(runs["time"], rows["planning_seconds"])
    np.testing.assert_array_equal(runs["solved"].astype(bool), rows["solved"])
    np.testing.assert_array_equal(runs["solution_length"], rows["length_m"])


def test_ids_that_would_break_a_log_s_line_do_not(tmp_path: Path) -> None:
    odd = {**ATTEMPT, "problem_id": "a; b\nc"}
    write_attempts(tmp_path / "results" / "odd" / "0000.parquet", [odd])
    write_ompl_logs(tmp_path / "logs", {"odd": tmp_path / "results" / "odd"}, ORIGIN._replace(processor=None))
    (line,) = [line for line in (tmp_path / "logs" / "odd.log").read_text().splitlines() if "a;b c" in line]
    assert len(line.split("; ")) == len(PROPERTIES) + 1


@pytest.mark.parametrize("kept", [True, False])
def test_a_class_without_attempts_leaves_nothing_half_written(tmp_path: Path, kept: bool) -> None:
    (tmp_path / "results").mkdir()
    if kept:
        (tmp_path / "logs").mkdir()
        (tmp_path / "logs" / "mine").touch()
    with pytest.raises(StorageError, match="holds no rows; run benchmark"):
        write_ompl_logs(tmp_path / "logs", {"trap": tmp_path / "results"}, ORIGIN)
    assert (tmp_path / "logs" / "mine").exists() == kept
    assert {path.name for path in tmp_path.iterdir()} == ({"results", "logs"} if kept else {"results"})
