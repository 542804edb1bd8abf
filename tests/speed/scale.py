"""What very many problems take, from what a run cost: cores, hours, bytes, and what gives way first.

``python -m tests.speed.scale RUN [--solved ROWS --seconds S]`` reads the folder of a finished run: how long
workers were busy in each stage (stages.json), how many rows they left, in how many bytes. With the rows of
``solve`` and the seconds that its workers took, it adds that. It prints costs a problem, and from these what
10^6, 10^8 and 10^10 problems take, as Markdown. Nothing is run.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import pyarrow.parquet as pq

from storage.places.run_folder import RunFolder
from tasks.reports.stage_times import stages_of

SIZES: Final = (10**6, 10**8, 10**10)
TASK_SECONDS: Final = 0.07  # of one task on Dask under Prefect
TASK_BYTES: Final = 20_000  # of one task in Prefect's database
BASE_BYTES: Final = 500_000_000  # that a worker holds before it has read a problem
FAN_OUTS: Final = {  # what a fan-out is called in stages.json, and what one of its units is
    "collect": ("collect", "candidates", "a problem drawn, solved, its plan judged"),
    "hallucinate": ("hallucinate", "hallucinated", "a problem made, drawn and labelled"),
    "relabel": ("label for the combined memory", "combined", "the labels of all classes' plans"),
    "train, epochs of a class": ("train", "trained", "a problem in one epoch"),
    "benchmark": ("benchmark", "results", "an attempt, its plan judged"),
}


class Cost(NamedTuple):
    """What one unit of a stage takes."""

    stage: str
    unit: str
    seconds: float  # of one core
    stored: float  # bytes on disk
    chunk: int  # units that one task does; 0: one task does all
    held: float  # bytes of a worker's memory, where these grow with the problems


def costs_of(run: RunFolder, epochs: int) -> list[Cost]:
    """The costs that a run's folder tells of; stages that it has not are left out."""
    tables = {
        name: _tables(run.path / name, {"combined"} if name == "hallucinated" else set())
        for name in ("candidates", "hallucinated", "results")
    }
    tables["combined"] = _tables(run.path / "hallucinated" / "combined", set())
    rows = {name: sum(pq.read_metadata(file).num_rows for file in files) for name, files in tables.items()}
    stored = {name: sum(file.stat().st_size for file in files) for name, files in tables.items()}
    taught = rows["hallucinated"] + rows["combined"]  # the combined memory is taught all of them again
    costs = []
    for record in stages_of(run):
        for load in record["fan_outs"]:
            stage, table, unit = FAN_OUTS.get(load["what"], ("", "", ""))
            units = epochs * taught if table == "trained" else rows.get(table, 0)
            if not units:
                continue
            held = 0.0
            if table == "trained":
                held = (load["last_bytes"] - BASE_BYTES) / max(rows["combined"], rows["hallucinated"])
            on_disk = 0.0 if table == "trained" else stored[table] / rows[table]
            chunk = 0 if table == "trained" else units // load["chunks"]
            costs.append(Cost(stage, unit, load["busy_seconds"] / units, on_disk, chunk, held))
    return costs


def projected(cost: Cost, units: int) -> list[str]:
    """How many, core time, bytes on disk, tasks, what these cost the server, bytes of memory."""
    tasks = -(-units // cost.chunk) if cost.chunk else 1
    return [
        f"{units:.0e}".replace("e+", "e"),
        _hours(units * cost.seconds),
        _bytes(units * cost.stored),
        f"{tasks:,}",
        _hours(tasks * TASK_SECONDS),
        _bytes(tasks * TASK_BYTES),
        _bytes(units * cost.held) if cost.held else "–",
    ]


def markdown(costs: Sequence[Cost]) -> str:
    """Two tables: what a unit costs, and what very many take."""
    each = [
        ["stage", "one unit is", "core µs", "bytes stored", "units a task"],
        *(
            [cost.stage, cost.unit, f"{1e6 * cost.seconds:,.0f}", f"{cost.stored:,.0f}", _count(cost.chunk)]
            for cost in costs
        ),
    ]
    many = [
        ["stage", "units", "core time", "on disk", "tasks", "server busy", "its database", "a worker holds"],
        *([cost.stage, *projected(cost, size)] for cost in costs for size in SIZES),
    ]
    return "\n\n".join(_table(rows) for rows in (each, many))


def _tables(folder: Path, but: set[str]) -> list[Path]:
    return [file for file in sorted(folder.rglob("*.parquet")) if not but & set(file.parts)]


def _table(rows: Sequence[Sequence[str]]) -> str:
    head, *others = ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join([head, "|---" * len(rows[0]) + "|", *others])


def _count(chunk: int) -> str:
    return f"{chunk:,}" if chunk else "all"


def _hours(seconds: float) -> str:
    for unit, size in (("years", 365.25 * 86_400), ("days", 86_400.0), ("hours", 3_600.0), ("min", 60.0)):
        if seconds >= 1.5 * size:
            return f"{seconds / size:,.0f} {unit}"
    return f"{seconds:,.0f} s"


def _bytes(size: float) -> str:
    for unit, factor in (("PB", 1e15), ("TB", 1e12), ("GB", 1e9), ("MB", 1e6)):
        if size >= factor:
            return f"{size / factor:,.3g} {unit}"
    return f"{size:,.0f} B"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path)
    parser.add_argument("--epochs", type=int, default=10)
    parser.add_argument("--solved", type=Path, help="rows of solve")
    parser.add_argument("--seconds", type=float, default=0.0, help="that its workers took, all together")
    asked = parser.parse_args()
    costs = costs_of(RunFolder(asked.run), asked.epochs)
    if asked.solved is not None:
        rows = pq.read_metadata(asked.solved).num_rows
        size = asked.solved.stat().st_size
        told = "a problem read, solved, its plan judged"
        costs.append(Cost("solve", told, asked.seconds / rows, size / rows, 500, 16.0))
    print(markdown(costs))


if __name__ == "__main__":
    main()
