"""The dashboard over a run of 450,000 rows, those of RUN repeated: ``python -m tests.speed.dashboard RUN``.

Prints seconds from a fresh process to the first page, of each page then, and the memory at the end.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from urllib.request import urlopen

import numpy as np
import psutil
import pyarrow as pa
import pyarrow.compute as pc

from storage.places.data_folder import open_data_folder
from storage.tables.schemas import ATTEMPTS
from storage.tables.shards import read_table, write_table

ROWS = 450_000
SHARD = 15_000
PAGES = {
    "problems": "/runs/huge/problems",
    "filter planner": "/runs/huge/problems?planner=gust",
    "filter configuration": "/runs/huge/problems?planner=rrt&configuration=none",
    "slowest": "/runs/huge/problems?show=slowest",
    "hurt most": "/runs/huge/problems?show=hurt",
    "missed": "/runs/huge/problems?show=missed&sort=ratio&order=down",
    "part of an id": "/runs/huge/problems?id=-77",
    "overview again": "/runs/huge",
    "where time goes": "/runs/huge?view=time",
    "where time goes, again": "/runs/huge?view=time",
}


def huge(source: Path, data: Path) -> None:
    """A run with the rows of another, again and again, each time as other problems."""
    run = open_data_folder(data).run("huge")
    run.path.mkdir(parents=True)
    for name in ("settings.json", "stages.json", "summary.csv"):
        shutil.copy(source / name, run.path / name)
    table = pa.concat_tables(
        [read_table(path, ATTEMPTS) for path in sorted((source / "results").rglob("*.parquet"))]
    )
    rng = np.random.default_rng(0)
    copies, shard, rows = [], 0, 0
    for number in range(-(-ROWS // len(table))):
        renamed = pc.binary_join_element_wise(table["problem_id"], f"{number:05d}", "")
        seconds = pc.multiply(table["planning_seconds"], rng.lognormal(0.0, 0.3))
        copy = table.set_column(table.schema.get_field_index("problem_id"), "problem_id", renamed)
        copies.append(
            copy.set_column(copy.schema.get_field_index("planning_seconds"), "planning_seconds", seconds)
        )
        rows += len(table)
        if rows >= SHARD or number == -(-ROWS // len(table)) - 1:
            write_table(run.shard("results", "random", shard), pa.concat_tables(copies))
            copies, rows, shard = [], 0, shard + 1


def main(source: str) -> None:
    """Measure."""
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "data"
        huge(Path(source), data)
        began = time.perf_counter()
        asked = ["dashboard", "--data", str(data), "--port", "0", "--no-browser"]
        server = subprocess.Popen(
            [sys.executable, "-m", "flows.cli.main", *asked], stdout=subprocess.PIPE, text=True
        )
        try:
            assert server.stdout is not None
            server.stdout.readline()
            address = server.stdout.readline().split()[1].rstrip("/")
            print(f"{'listening':24} {time.perf_counter() - began:.2f} s")
            tell("first page (overview)", address + "/runs/huge")
            for name, place in PAGES.items():
                tell(name, address + place)
            used = psutil.Process(server.pid).memory_info().rss / 1e6
            print(f"{'memory':24} {used:.0f} MB")
        finally:
            server.terminate()
            server.wait(10)


def tell(name: str, address: str) -> None:
    """Ask for a page and print how long it took."""
    began = time.perf_counter()
    with urlopen(address) as answer:  # while the server starts, this waits for it
        size = len(answer.read())
    print(f"{name:24} {time.perf_counter() - began:.2f} s  {size / 1e3:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1])
