"""Attempts as the SQLite database that Planner Arena reads, like that of OMPL's own benchmark statistics.

Planner Arena reads tables and the first columns by position, so they stand in OMPL's order. Attempts stream
through, one shard at a time. An experiment is a problem class of the run; a run of a planner is one problem
of it.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

import pandas as pd

from planners.attempt import SOURCES
from planners.search.outcome import Status
from planners.search.query import Limits
from storage.tables.attempts import attempt_frames
from storage.tables.configurations import Configuration, configured

LIBRARY: Final = "Motion-Memory"
_SECONDS: Final = (
    "occupancy_seconds", "encode_seconds", "recall_seconds", "scene_seconds", "check_seconds",
    "guide_seconds", "repair_seconds", "roadmap_seconds", "search_seconds",
)  # fmt: skip
PROPERTIES: Final = {  # of each attempt; readers expect the first four in these columns
    "time": "REAL",  # s
    "memory": "REAL",  # MB, not measured
    "solved": "BOOLEAN",
    "status": "ENUM",
    "solution_length": "REAL",  # m
    "solution_duration": "REAL",  # s
    "source": "ENUM",
    **dict.fromkeys(_SECONDS, "REAL"),
    "collision_checks": "INTEGER",
    "expansions": "INTEGER",
    "nodes": "INTEGER",
    "problem_id": "VARCHAR(128)",
}
_MEANT: Final = {
    "time": "planning_seconds",
    "solution_length": "length_m",
    "solution_duration": "duration_s",
}
_SCHEMA: Final = f"""
CREATE TABLE experiments
    (id INTEGER PRIMARY KEY AUTOINCREMENT, name VARCHAR(512),
    totaltime REAL, timelimit REAL, memorylimit REAL, runcount INTEGER,
    version VARCHAR(128), hostname VARCHAR(1024), cpuinfo TEXT,
    date DATETIME, seed VARCHAR(24), setup TEXT);
CREATE TABLE plannerConfigs
    (id INTEGER PRIMARY KEY AUTOINCREMENT,
    name VARCHAR(512) NOT NULL, settings TEXT);
CREATE TABLE enums
    (name VARCHAR(512), value INTEGER, description TEXT,
    PRIMARY KEY (name, value));
CREATE TABLE runs
    (id INTEGER PRIMARY KEY AUTOINCREMENT, experimentid INTEGER, plannerid INTEGER,
    {", ".join(f"{name} {kind}" for name, kind in PROPERTIES.items())},
    FOREIGN KEY (experimentid) REFERENCES experiments(id) ON DELETE CASCADE,
    FOREIGN KEY (plannerid) REFERENCES plannerConfigs(id) ON DELETE CASCADE);
CREATE TABLE progress
    (runid INTEGER, time REAL, PRIMARY KEY (runid, time),
    FOREIGN KEY (runid) REFERENCES runs(id) ON DELETE CASCADE);
"""


class Origin(NamedTuple):
    """What the attempts of a run have in common."""

    run_name: str
    version: str
    setup: str  # settings of the run, as text
    processor: str | None
    date: datetime


def enums() -> dict[str, list[str]]:
    """The texts that the numbers of each ENUM stand for."""
    return {"status": [str(each) for each in Status], "source": list(SOURCES)}


@contextmanager
def opened(path: Path) -> Iterator[sqlite3.Connection]:
    """The database at ``path``; it is committed unless an error is raised, and always closed."""
    with closing(sqlite3.connect(path)) as database, database:
        yield database


def write_planner_arena(path: Path, classes: dict[str, Path], origin: Origin) -> None:
    """Make a database at ``path`` from the attempts below the folder of each class.

    Args:
        path: file of the new database.
        classes: folder of the attempts of each class.
        origin: the run that made the attempts.

    Raises:
        StorageError: a folder has no attempts.
    """
    with opened(path) as database:
        database.executescript(_SCHEMA)
        database.executemany(
            "INSERT INTO enums VALUES (?, ?, ?)",
            [(name, i, text) for name, texts in enums().items() for i, text in enumerate(texts)],
        )
        planners: dict[tuple[str, str], int] = {}
        for name, folder in classes.items():
            _add_experiment(database, f"{origin.run_name}/{name}", folder, origin, planners)


def _add_experiment(
    database: sqlite3.Connection,
    name: str,
    folder: Path,
    origin: Origin,
    planners: dict[tuple[str, str], int],
) -> None:
    """Add one class. Its rows go through a temporary table, which brings those of a planner together."""
    columns = ", ".join(PROPERTIES)
    database.execute(f"CREATE TEMP TABLE staged (name, settings, {columns})")
    marks = ", ".join("?" * (2 + len(PROPERTIES)))
    hosts: set[str] = set()
    seeds: set[str] = set()
    for attempts in attempt_frames(folder, without=("recalled",)):
        hosts |= set(attempts["host"].dropna())
        seeds |= {str(seed) for seed in attempts["seed"].unique()}
        database.executemany(f"INSERT INTO staged VALUES ({marks})", _rows(attempts))
    (total,) = database.execute("SELECT sum(time) FROM staged").fetchone()
    groups = database.execute("SELECT name, settings, count(*) FROM staged GROUP BY 1, 2 ORDER BY min(rowid)")
    counts = {(planner, settings): count for planner, settings, count in groups}
    limits = Limits()
    cursor = database.execute(
        "INSERT INTO experiments VALUES (NULL, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
        (
            name, total, limits.seconds, 0.0, max(counts.values()), f"{LIBRARY} {origin.version}",
            "+".join(sorted(hosts)), origin.processor, f"{origin.date:%Y-%m-%d %H:%M:%S}",
            "+".join(sorted(seeds)), f"{origin.setup.strip()}\n",
        ),
    )  # fmt: skip
    for key in counts:
        if key not in planners:
            inserted = database.execute("INSERT INTO plannerConfigs VALUES (NULL, ?, ?)", key)
            planners[key] = int(inserted.lastrowid or 0)
        database.execute(
            f"INSERT INTO runs (experimentid, plannerid, {columns}) "
            f"SELECT ?, ?, {columns} FROM staged WHERE name = ? AND settings = ? ORDER BY rowid",
            (cursor.lastrowid, planners[key], *key),
        )
    database.execute("DROP TABLE staged")


def _rows(attempts: pd.DataFrame) -> Iterator[tuple[Any, ...]]:
    """Planner name, planner settings and ``PROPERTIES`` of each attempt; unknown values are None."""
    rows, configurations = configured(attempts)
    keys = ["planner", "configuration", "memory", "vehicle"]
    group, distinct = pd.factorize(pd.MultiIndex.from_frame(rows[keys]))
    names = [_name_and_settings(configurations, *key) for key in distinct]
    table = rows.assign(solved=rows["solved"].astype(int), memory=None)
    table["problem_id"] = [" ".join(id_.split()).replace("; ", ";") for id_ in rows["problem_id"]]
    for name, texts in enums().items():
        table[name] = table[name].map({text: i for i, text in enumerate(texts)})
    table = pd.DataFrame({name: table[_MEANT.get(name, name)] for name in PROPERTIES}, rows.index)
    values = table.astype(object).where(table.notna(), None).itertuples(index=False, name=None)
    return ((*names[i], *row) for i, row in zip(group, values, strict=True))


def _name_and_settings(
    configurations: dict[str, Configuration], planner: str, label: str, memory: object, vehicle: object
) -> tuple[str, str]:
    """A name like ``gust closed 5, memory trap``, and settings as OMPL's reader joins their lines."""
    of = f", memory {memory}" if isinstance(memory, str) else ""
    settings = {"planner": planner, **configurations[label]._asdict(), "memory": memory, "vehicle": vehicle}
    lines = [f"{name} = {value}" for name, value in settings.items() if value == value and value is not None]
    return f"{planner} {label}{of}", "".join(f"{line}\n;" for line in lines)
