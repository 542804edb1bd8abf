"""Very many problems through `solve`: problems a second, memory, and a kill in the middle.

``python -m tests.speed.many_problems [--problems 100000] [--workers 2] [--memory FOLDER] [--folder F]`` draws
problems of a seed of their own into a file (kept in the folder, build/many), has `solve` solve them, kills
the command with -9 when half of the parts are done, and gives the same command again. It watches the resident
memory of the command and of its processes once a second, and which finished part is written twice. All is
checked at the end: every problem has one row, in the order of the file.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import psutil
from rich.console import Console
from rich.progress import track

from planners.world.classes.problem_classes import problem_class
from storage.archives.memories import save_memory
from storage.exchange.problem_files import raw_problems
from storage.exchange.problems import fields_of
from storage.places.files import remove_folder, whole_file
from storage.tables.attempts import attempt_columns
from tests.speed.assists import memory_of

SEED = 84
CLASS = "curves"
MEGABYTE = 1 << 20


@dataclass
class Watched:
    """What was seen of one command."""

    seconds: float = 0.0
    code: int | None = None
    shares: list[float] = field(default_factory=list)  # of the problems that it had to solve, when looked
    own: list[int] = field(default_factory=list)  # megabytes of the command's process
    largest: list[int] = field(default_factory=list)  # and of its largest other process


def main() -> None:
    """Print what was measured."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--problems", type=int, default=100_000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--memory", type=Path)
    parser.add_argument("--folder", type=Path, default=Path("build") / "many")
    asked = parser.parse_args()
    problems = _problems(asked.folder, asked.problems)
    memory = asked.memory or asked.folder / "memory"
    if asked.memory is None:
        save_memory(memory, memory_of(CLASS))
    out = asked.folder / "rows.parquet"
    out.unlink(missing_ok=True)
    remove_folder(out.with_name(f"{out.name}.parts"))
    command = [sys.executable, "-m", "flows.cli.main", "solve", str(problems), "--planner", "gust"]
    command += ["--assist", "open", "--memory", str(memory), "--unpolished", "--out", str(out)]
    command += ["--workers", str(asked.workers)]
    finished: dict[Path, int] = {}
    twice: set[Path] = set()
    first = _watch(command, out, finished, twice, kill_at=0.5, count=asked.problems)
    before = len(finished)
    second = _watch(command, out, finished, twice, kill_at=2.0, count=asked.problems)
    console = Console(width=170)
    for name, watched in (("killed", first), ("resumed", second)):
        console.print(f"{name}: exit code {watched.code} after {watched.seconds:.1f} s", highlight=False)
        for share in (0.1, 0.3, 0.5, 0.7, 0.9, 1.0):
            seen = [i for i, each in enumerate(watched.shares) if each <= share]
            if seen:
                own, largest = watched.own[seen[-1]], watched.largest[seen[-1]]
                sizes = f"command {own} MB, largest other process {largest} MB"
                console.print(f"  at {share:.0%} of the parts: {sizes}", highlight=False)
    console.print(f"parts finished before the kill: {before}; written again: {len(twice)}", highlight=False)
    rows = attempt_columns(out, ["problem_id"])["problem_id"]
    same = all(each == fields["id"] for each, (_, fields) in zip(rows, raw_problems(problems), strict=True))
    console.print(f"{len(rows):,} rows, one a problem and in their order: {same}", highlight=False)


def _problems(folder: Path, count: int) -> Path:
    """The problems as a file, drawn where it is not there yet."""
    path = folder / f"problems-{count}.jsonl"
    if not path.exists():
        source = problem_class(CLASS)
        with whole_file(path) as temporary, temporary.open("w", encoding="utf-8") as file:
            for index in track(range(count), description="draw problems"):
                file.write(json.dumps(fields_of(source.draw(SEED, index))) + "\n")
    return path


def _watch(
    command: list[str], out: Path, finished: dict[Path, int], twice: set[Path], kill_at: float, count: int
) -> Watched:
    """Run a command, and kill it when a share of all problems is done; note what it finishes."""
    watched = Watched()
    began = time.monotonic()
    running = psutil.Popen(command)
    parts = out.with_name(f"{out.name}.parts")
    total = -(-count // 500)
    while running.poll() is None:
        for path in parts.glob("[0-9]*.parquet"):
            try:
                when = path.stat().st_mtime_ns
            except FileNotFoundError:  # all is joined, and the parts go
                continue
            if finished.setdefault(path, when) != when:
                twice.add(path)
        try:
            sizes = [process.memory_info().rss for process in running.children(recursive=True)]
            watched.own.append(running.memory_info().rss // MEGABYTE)
            watched.largest.append(max(sizes, default=0) // MEGABYTE)
            watched.shares.append(len(finished) / total)
        except psutil.Error:
            continue
        if len(finished) / total >= kill_at:
            running.kill()
        time.sleep(1.0)
    watched.code, watched.seconds = running.wait(), time.monotonic() - began
    return watched


if __name__ == "__main__":
    main()
