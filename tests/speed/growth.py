"""What a memory gains and costs as it grows: recall, file, loading, by number of plans and strategy.

``python -m tests.speed.growth [--folder FOLDER] [--difficulty D] [PLANS]...`` takes memories of class random
of that many plans, by default 100, 1,000 and 10,000, and prints

- for every strategy the share of new problems in which the first, and one of the first five plans that it
  recalls is free, beside the share in which any stored plan is (oracle); and the processor time from
  problem to checked plans, median and 99 %;
- the encoder's ranking alone: scoring all plans, inverted lists, and the libraries usearch and faiss where
  they are installed;
- size of the archive, time to load it with its files read before (warm) and not (cold), memory of a process.

100,000 plans take some minutes to collect. More than that are synthetic (``many_plans.py``), and need the
100,000. What is made is kept in the folder, build/speed by default. Problems have a seed of their own.
"""

from __future__ import annotations

import argparse
import gc
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from time import thread_time

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import track
from rich.table import Table
from threadpoolctl import threadpool_limits

from planners.memory.memory import Memory
from planners.memory.plans.free import free_plans
from planners.memory.recall import STRATEGIES, default_recall, recall
from planners.world.arrays import Flags
from planners.world.classes.problem_classes import problem_class
from planners.world.geometry.collision import scene_of
from planners.world.problem import Problem
from planners.world.randomness import generator
from planners.world.view import View
from planners.world.workspace import Workspace
from storage.archives.memories import load_memory, save_memory
from tests.speed.assists import KEPT, MEASURING
from tests.speed.many_plans import collected_memory, collected_plans, place_of, synthetic_memory
from tests.speed.rankers import CANDIDATES, rankers

NAME = "random"
SIZES = (100, 1_000, 10_000)
MOST_COLLECTED = 100_000
COUNT = 300  # problems
K = 5


def memory_of_size(size: int, difficulty: str, folder: Path) -> Memory:
    """The memory of the first ``size`` collected plans, or of that many synthetic ones."""
    source = problem_class(NAME, difficulty)
    collected = min(size, MOST_COLLECTED)
    most = max(collected, SIZES[-1])  # smaller memories have the first plans of the same collection
    plans = collected_plans(source, most, folder)
    memory = collected_memory(source, plans[:collected], folder)  # views of the arrays
    if size == collected:
        return memory
    place = place_of(source, size, folder)
    if not place.exists():
        save_memory(place, synthetic_memory(memory, size))
    return load_memory(place)


def table(title: str, *columns: str) -> Table:
    """An empty table."""
    result = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    for i, name in enumerate(columns):
        result.add_column(name, justify="left" if i < 2 else "right", no_wrap=True)
    return result


def quantiles(seconds: Sequence[float]) -> tuple[str, str]:
    """Median and 99 % in microseconds."""
    median, high = 1e6 * np.quantile(seconds, (0.5, 0.99))
    return f"{median:,.0f}", f"{high:,.0f}"


def add_recalls(rows: Table, memory: Memory, problems: list[Problem], free: Flags) -> None:
    """A row a strategy, those of one problem next to each other."""
    seconds: dict[str, list[float]] = {name: [] for name in STRATEGIES}
    hits = {(name, k): 0 for name in STRATEGIES for k in (1, K)}
    workspace = Workspace()
    for name in STRATEGIES:  # compiled or loaded now
        recall(memory, View(problems[0]), name, K, generator(MEASURING))
    gc.collect()
    gc.disable()
    for number, problem in enumerate(track(problems, description="recall", transient=True)):
        for name in STRATEGIES[number % len(STRATEGIES) :] + STRATEGIES[: number % len(STRATEGIES)]:
            rng = generator(MEASURING, problem.id)
            began = thread_time()
            recall(memory, View(problem, workspace), name, K, rng)
            seconds[name].append(thread_time() - began)
            for k in (1, K):
                found = recall(memory, View(problem), name, k, generator(MEASURING, problem.id))
                hits[name, k] += any(free[number, i] for i in found.plans[:k])
    gc.enable()
    default = default_recall(memory)
    for name in STRATEGIES:
        shares = [f"{100 * hits[name, k] / len(problems):.1f}" for k in (1, K)]
        shown = f"{name} (default)" if name == default else name
        oracle = f"{100 * free.any(1).mean():.1f}"
        rows.add_row(f"{len(memory.plans):,}", shown, *shares, oracle, *quantiles(seconds[name]))
    rows.add_section()


def add_rankings(rows: Table, memory: Memory, problems: list[Problem], free: Flags) -> None:
    """A row a way to rank by the encoder alone."""
    made = rankers(memory)
    embeddings = [np.asarray(memory.forward(View(problem).bits)).copy() for problem in problems]
    exact = [set(made["all scored"][0](embedding).tolist()) for embedding in embeddings]
    for name, (rank, build) in made.items():
        rank(embeddings[0])
        seconds, found = [], []
        for embedding in embeddings:
            began = thread_time()
            best = rank(embedding)
            seconds.append(thread_time() - began)
            found.append(best)
        hits = [np.mean([free[i, best[:k]].any() for i, best in enumerate(found)]) for k in (1, K)]
        same = np.mean([len(exact[i] & set(best.tolist())) / len(exact[i]) for i, best in enumerate(found)])
        shares = [f"{100 * share:.1f}" for share in (*hits, same)]
        rows.add_row(f"{len(memory.plans):,}", name, *shares, *quantiles(seconds), f"{build:.1f}")
    rows.add_section()


LOADING = """
import sys, time, pathlib
from storage.archives.memories import load_memory
place = pathlib.Path(sys.argv[1])
def status(name):
    lines = open("/proc/self/status").read().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(name))
before = status("RssAnon")
began = time.perf_counter()
memory = load_memory(place)
seconds = time.perf_counter() - began
print(seconds, (status("RssAnon") - before) / 1024, status("RssFile") / 1024)
"""


def add_loading(rows: Table, place: Path, size: int) -> None:
    """A row: what the archive weighs, how long it loads, what a process then holds."""
    files = [file for file in place.iterdir() if file.is_file()]
    loads = []
    for cold in (False, True, False):  # the first one may compile
        if cold:
            for file in files:
                with file.open("rb") as opened:
                    os.posix_fadvise(opened.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
        done = subprocess.run(
            [sys.executable, "-c", LOADING, str(place)], capture_output=True, text=True, check=True
        )
        loads.append([float(each) for each in done.stdout.split()])
    weight = sum(file.stat().st_size for file in files) / 1e6
    (cold_s, *_), (warm_s, own, mapped) = loads[1:]
    rows.add_row(
        f"{size:,}", "", f"{weight:,.0f}", f"{cold_s:.2f}", f"{warm_s:.2f}", f"{own:,.0f}", f"{mapped:,.0f}"
    )


def report(
    console: Console, sizes: Sequence[int] = SIZES, difficulty: str = "standard", folder: Path = KEPT
) -> None:
    """Print the three tables."""
    threadpool_limits(1)  # a matrix product is to be timed on one thread
    problems = [problem_class(NAME, difficulty).draw(MEASURING, index) for index in range(COUNT)]
    title = f"{NAME}, {difficulty}, {COUNT} problems"
    recalls = table(
        f"Recall of {K} checked plans: {title}",
        "plans", "strategy", "hit@1 %", "hit@5 %", "oracle %", "median µs", "99 % µs",
    )  # fmt: skip
    rankings = table(
        f"The encoder's first {CANDIDATES}, unchecked: {title}",
        "plans", "found by", "hit@1 %", "hit@5 %", "same as all %", "median µs", "99 % µs", "made in s",
    )  # fmt: skip
    loading = table("Archives", "plans", "", "MB", "cold s", "warm s", "own MB", "mapped MB")
    for size in sizes:
        memory = memory_of_size(size, difficulty, folder)
        scenes = (scene_of(problem) for problem in track(problems, description="oracle", transient=True))
        free = np.stack([free_plans(memory.sweeps, scene) for scene in scenes])
        add_recalls(recalls, memory, problems, free)
        if SIZES[-1] <= size <= MOST_COLLECTED:  # the graph of a million takes many minutes
            add_rankings(rankings, memory, problems, free)
        add_loading(loading, place_of(problem_class(NAME, difficulty), size, folder), size)
    for each in (recalls, rankings, loading):
        console.print(each)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("sizes", nargs="*", type=int, default=SIZES)
    parser.add_argument("--difficulty", default="standard")
    parser.add_argument("--folder", type=Path, default=KEPT)
    given = parser.parse_args()
    report(Console(width=130), given.sizes, given.difficulty, given.folder)
