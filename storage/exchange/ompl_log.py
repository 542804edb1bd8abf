"""Attempts as OMPL benchmark logs, one per problem class, which ``ompl_benchmark_statistics`` reads."""

from __future__ import annotations

import sqlite3
from pathlib import Path
from typing import TextIO

from storage.exchange.planner_arena import PROPERTIES, Origin, enums, opened, write_planner_arena
from storage.places.files import whole_folder


def write_ompl_logs(folder: Path, classes: dict[str, Path], origin: Origin) -> None:
    """Make a ``folder`` of logs ``<class>.log``, completely or not at all.

    The rows go through a database for Planner Arena, which sorts them by planner on the disk.

    Args:
        folder: where the logs are written.
        classes: folder of the attempts of each class.
        origin: the run that made the attempts.
    """
    with whole_folder(folder) as temporary:
        sorted_rows = temporary / "attempts.db"
        write_planner_arena(sorted_rows, classes, origin)
        with opened(sorted_rows) as database:
            experiments = database.execute("SELECT * FROM experiments ORDER BY id").fetchall()
            for name, experiment in zip(classes, experiments, strict=True):
                with (temporary / f"{name}.log").open("w", encoding="utf-8") as log:
                    _write_log(log, database, experiment)
        sorted_rows.unlink()


def _write_log(log: TextIO, database: sqlite3.Connection, experiment: tuple[object, ...]) -> None:
    """Write one experiment with the words that the reader looks for."""
    number, name, total, seconds, megabytes, count, version, host, processor, date, seed, setup = experiment
    library, _, release = str(version).partition(" ")
    log.write(f"{library} version {release}\nExperiment {name}\nRunning on {host}\nStarting at {date}\n")
    log.write(f"<<<|\n{setup}|>>>\n")
    if processor is not None:
        log.write(f"<<<|\n{processor}|>>>\n")
    log.write(f"{seed} is the random seed\n{seconds!r} seconds per run\n{megabytes!r} MB per run\n")
    log.write(f"{count} runs per planner\n{total!r} seconds spent to collect the data\n")
    log.write(f"{len(enums())} enum types\n")
    for kind, texts in enums().items():
        log.write(f"{'|'.join([kind, *texts])}\n")
    planners = database.execute(
        "SELECT plannerid, name, settings, count(*) FROM runs JOIN plannerConfigs p ON plannerid = p.id "
        "WHERE experimentid = ? GROUP BY plannerid ORDER BY min(runs.id)",
        (number,),
    ).fetchall()
    log.write(f"{len(planners)} planners\n")
    for planner, called, settings, runs in planners:
        lines = str(settings).split("\n;")[:-1]
        log.write(f"{called}\n{len(lines)} common properties\n")
        log.writelines(f"{line}\n" for line in lines)
        log.write(f"{len(PROPERTIES)} properties for each run\n")
        log.writelines(f"{kind} {affinity}\n" for kind, affinity in PROPERTIES.items())
        log.write(f"{runs} runs\n")
        columns = ", ".join(PROPERTIES)
        query = f"SELECT {columns} FROM runs WHERE experimentid = ? AND plannerid = ? ORDER BY id"
        for row in database.execute(query, (number, planner)):
            log.write("".join("; " if value is None else f"{value}; " for value in row) + "\n")
        log.write(".\n")
