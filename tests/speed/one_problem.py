"""Whether `plan` takes as long to plan as the benchmark does, and how long the whole command takes.

``python -m tests.speed.one_problem`` has the benchmark solve new problems in all its ways, then asks the
command for a plan of each of them in two of these ways, a process each: planning times side by side, and the
seconds of the process from start to end with compiled kernels on the disk. The same problems, memory and
seed, so the same plans: what differs is what stands around the attempt. Problems have a seed of their own.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np
import pandas as pd
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import track
from rich.table import Table

from storage.archives.memories import save_memory
from storage.exchange.problems import write_problems
from storage.tables.attempts import read_attempts
from tasks.fan_out.chunk import Chunk
from tasks.inputs.problem_sources import source_of
from tasks.settings.presets import for_preset
from tasks.stages.benchmark import benchmark_chunk
from tests.speed.assists import memory_of

SEED = 83
COUNT = 20  # problems
CLASS = "curves"
PLANNER = "gust"
ASSISTS = {"open": 5, "none": 0}  # with their top k


def main() -> None:
    """Print the table in this terminal."""
    report(Console(width=170))


def report(console: Console) -> None:
    """Print one line for each assist."""
    table = Table(
        title=f"plan against benchmark, {COUNT} problems of {CLASS}, {PLANNER}; medians",
        box=SIMPLE_HEAD,
        title_justify="left",
    )
    for heading in ("assist", "benchmark ms", "plan ms", "ratio", "ratio, paired", "command s", "slowest s"):
        table.add_column(heading, justify="right")
    with TemporaryDirectory() as folder:
        benchmarked, problems = _benchmarked(Path(folder))
        for assist, top_k in ASSISTS.items():
            ways = (benchmarked["assist"] == assist) & (benchmarked["top_k"] == top_k)
            of_planner = benchmarked[ways & (benchmarked["planner"] == PLANNER)]
            theirs = of_planner[of_planner["recall"].ne("encoder")]["planning_seconds"].to_numpy()
            asked = [_planned(problem, assist, Path(folder)) for problem in track(problems, transient=True)]
            ours, whole = np.array(asked).T
            table.add_row(
                assist,
                f"{1000 * np.median(theirs):.3f}",
                f"{1000 * np.median(ours):.3f}",
                f"{np.median(ours) / np.median(theirs):.2f}",
                f"{np.median(ours / theirs):.2f}",
                f"{np.median(whole):.2f}",
                f"{whole.max():.2f}",
            )
    console.print(table)


def _benchmarked(folder: Path) -> tuple[pd.DataFrame, list[Path]]:
    """The benchmark's rows of the problems, and these as files."""
    settings = for_preset("smoke", classes=[CLASS], seed=SEED, test_problems=COUNT)
    chunk = Chunk(str(folder / "data"), settings, CLASS, 0, 0, COUNT, "")
    save_memory(chunk.run.memory(CLASS), memory_of(CLASS))
    save_memory(folder / "memory", memory_of(CLASS))
    benchmark_chunk(chunk)
    source = source_of(chunk.data, settings, CLASS)
    paths = [folder / f"{index}.json" for index in range(COUNT)]
    for index, path in enumerate(paths):
        write_problems(path, [source.problem("test", index)])
    return read_attempts(chunk.run.results), paths


def _planned(problem: Path, assist: str, folder: Path) -> tuple[float, float]:
    """Planning time of the command and the seconds that it takes in all."""
    out = folder / "plan.json"
    command = [
        sys.executable,
        "-m",
        "flows.cli.main",
        "plan",
        str(problem),
        "--planner",
        PLANNER,
        "--out",
        str(out),
    ]
    began = perf_counter()
    subprocess.run(
        [*command, "--assist", assist, "--memory", str(folder / "memory"), "--seed", str(SEED)],
        check=True,
        capture_output=True,
    )
    return float(json.loads(out.read_text())["planning_seconds"]), perf_counter() - began


if __name__ == "__main__":
    main()
