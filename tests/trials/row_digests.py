"""Digests of all rows of small runs: do two versions of the program make the same rows, times aside?

``python -m tests.trials.row_digests FOLDER --make`` makes a smoke run of each vehicle with each objective,
one data folder each below FOLDER, and prints a line of digests for each. Without ``--make`` it reads the
data folders that are there. Two versions agree if they print the same lines.
"""

from __future__ import annotations

import argparse
import hashlib
import subprocess
import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Final, get_args

import pyarrow.parquet as pq

from planners.world.vehicles.vehicle import VEHICLES
from storage.places.data_folder import DataFolder
from storage.places.run_folder import RunFolder
from tasks.settings.run_settings import Objective

MADE_BY: Final = ("host", "commit")  # columns that tell who made a row
ARRAYS: Final = (".npy", ".safetensors")  # of memories; encoders also hold the seconds of their training
DIGITS: Final = 8


def make_runs(folder: Path, workers: int) -> None:
    """Make a smoke run of every vehicle with every objective, each in a data folder of its own."""
    for objective, vehicle in product(get_args(Objective), VEHICLES):
        command = [sys.executable, "-m", "flows.cli.main", "run", "--preset", "smoke"]
        command += ["--workers", str(workers), "--objective", objective, "--vehicle", vehicle]
        command += ["--data", str(folder / f"{objective}-{vehicle}")]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def digests(run: RunFolder) -> dict[str, str]:
    """A digest of each kind of rows and arrays in a run, by the name of its folder."""
    kinds: dict[str, hashlib._Hash] = {}
    for path, content in _contents(run):
        name = path.relative_to(run.path)
        digest = kinds.setdefault(name.parts[0], hashlib.sha256())
        digest.update(str(name).encode() + hashlib.sha256(content).digest())
    return {kind: digest.hexdigest()[:DIGITS] for kind, digest in sorted(kinds.items())}


def _contents(run: RunFolder) -> Iterator[tuple[Path, bytes]]:
    """Files in order, each with what must not change in it."""
    for path in sorted(run.path.rglob("*.parquet")):
        table = pq.read_table(path, partitioning=None)
        timed = [name for name in table.column_names if name.endswith("seconds")]
        rows = table.drop_columns([*timed, *(name for name in MADE_BY if name in table.column_names)])
        yield path, repr(rows.to_pydict()).encode()
    for path in sorted((run.path / "memories").rglob("*")):
        if path.suffix in ARRAYS:
            yield path, path.read_bytes()


def main() -> None:
    """Make runs if that is asked for, then print the digests of all data folders."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--make", action="store_true")
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    if options.make:
        make_runs(options.folder, options.workers)
    for data in sorted(path for path in options.folder.iterdir() if path.is_dir()):
        for run in DataFolder(data.absolute()).runs():
            print(f"{data.name}/{run.path.name}:", *(f"{k} {v}" for k, v in digests(run).items()))


if __name__ == "__main__":
    main()
