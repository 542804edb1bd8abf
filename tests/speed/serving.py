"""A memory served over HTTP, client included: plans a second in batches, one problem at a time, and nonsense.

``python -m tests.speed.serving [--memory FOLDER] [--workers 2] [--nonsense N]`` has the command serve on
loopback and asks it from this process, over connections that stay open; answers are read, and the
plans in them counted. Then the same memory by the call for a robot's process. New problems of the
memory's class, from a seed of their own. One memory, 100 plans, is made in a minute where none is given.
"""

from __future__ import annotations

import argparse
import gc
import json
import random
import re
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import httpx
import numpy as np
import psutil
from rich.console import Console
from rich.progress import track
from rich.table import Table

from motion_memory import load
from planners.world.classes.problem_classes import problem_class
from storage.archives.memories import save_memory
from storage.exchange.problems import fields_of
from tests.speed.assists import memory_of
from tests.tasks.served import JSON, malformed, request

SEED = 85
CLASS = "random"
TOP_K = 5
BATCH = 40  # problems a request
SECONDS = 20.0  # of batches
ALONE = 2_000  # requests, one at a time
ROBOT = 2_000  # problems


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--memory", type=Path)
    parser.add_argument("--class", dest="class_name", default=CLASS)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--nonsense", type=int, default=10_000)
    asked = parser.parse_args()
    with TemporaryDirectory() as scratch:
        memory = asked.memory or Path(scratch) / "memory"
        if asked.memory is None:
            save_memory(memory, memory_of(asked.class_name))
        _report(Console(width=130), memory, asked.class_name, asked.workers, asked.nonsense)


def _report(console: Console, memory: Path, class_name: str, workers: int, nonsense: int) -> None:
    source = problem_class(class_name)
    problems = [fields_of(source.draw(SEED, index)) for index in range(ALONE)]
    table = Table(title=f"{memory}, {workers} workers", title_justify="left")
    for heading in ("what", "problems/s", "plans/s", "median ms", "90 % ms", "99 % ms", "slowest ms"):
        table.add_column(heading, justify="left" if heading == "what" else "right")
    with served(memory, workers) as (address, process):
        times, plans = _batches(address, problems, workers)
        problems_a_second = len(times) * BATCH / SECONDS
        table.add_row(
            f"HTTP, {BATCH} a request", f"{problems_a_second:,.0f}", f"{plans / SECONDS:,.0f}", *_shown(times)
        )
        times, plans = _alone(address, problems)
        table.add_row(
            "HTTP, one at a time",
            f"{len(times) / sum(times):,.0f}",
            f"{plans / sum(times):,.0f}",
            *_shown(times),
        )
        sizes, statuses = _nonsense(address, process, nonsense)
    for judged in (False, True):
        times = _robot(memory, problems[:ROBOT], judged)
        told = "robot's call, plans judged" if judged else "robot's call"
        table.add_row(told, f"{len(times) / sum(times):,.0f}", "–", *_shown(times))
    console.print(table)
    console.print(f"{nonsense:,} malformed requests: statuses {statuses}; megabytes of the workers {sizes}")


@contextmanager
def served(memory: Path, workers: int) -> Iterator[tuple[str, psutil.Popen]]:
    command = [sys.executable, "-m", "flows.cli.main", "serve-memory", str(memory), "--port", "0"]
    running = psutil.Popen([*command, "--workers", str(workers)], stdout=subprocess.PIPE, text=True)
    try:
        for line in running.stdout:
            found = re.search(r"serving  (http://\S+)/invocations", line)
            if found:
                yield found[1], running
                break
    finally:
        running.terminate()
        running.wait()


def _batches(address: str, problems: list[dict[str, object]], workers: int) -> tuple[list[float], int]:
    """Seconds of each request and how many plans came, from one connection a worker and one more."""
    bodies = [request(*problems[i : i + BATCH], top_k=TOP_K) for i in range(0, len(problems), BATCH)]
    last = perf_counter() + SECONDS

    def ask(first: int) -> tuple[list[float], int]:
        times, plans = [], 0
        with httpx.Client(base_url=address, timeout=60) as client:
            for number in count(first):
                began = perf_counter()
                if began >= last:
                    return times, plans
                answer = client.post("/invocations", content=bodies[number % len(bodies)], headers=JSON)
                answer.raise_for_status()
                times.append(perf_counter() - began)
                plans += answer.content.count(b'"rank":')
        raise AssertionError

    with ThreadPoolExecutor(workers + 1) as threads:
        found = list(threads.map(ask, range(0, 7 * (workers + 1), 7)))
    return [each for times, _ in found for each in times], sum(plans for _, plans in found)


def _alone(address: str, problems: list[dict[str, object]]) -> tuple[list[float], int]:
    times, plans = [], 0
    bodies = [request(problem, top_k=TOP_K) for problem in problems]
    with httpx.Client(base_url=address) as client:
        client.post("/invocations", content=bodies[0], headers=JSON)
        gc.collect()
        gc.disable()
        for body in track(bodies, description="one at a time", transient=True):
            began = perf_counter()
            answer = client.post("/invocations", content=body, headers=JSON)
            times.append(perf_counter() - began)
            plans += answer.content.count(b'"rank":')
        gc.enable()
    return times, plans


def _nonsense(address: str, process: psutil.Popen, requests: int) -> tuple[list[int], dict[int, int]]:
    """Megabytes of all workers after each tenth of the requests, and how often each status came."""
    rng = random.Random(SEED)
    sizes, statuses = [], dict[int, int]()
    with httpx.Client(base_url=address, timeout=60) as client:
        for number in track(range(requests), description="nonsense", transient=True):
            body, headers = malformed(rng)
            status = client.post("/invocations", content=body, headers=headers).status_code
            statuses[status] = statuses.get(status, 0) + 1
            if (number + 1) % max(1, requests // 10) == 0:
                sizes.append(sum(each.memory_info().rss for each in process.children()) >> 20)
    return sizes, dict(sorted(statuses.items()))


def _robot(memory: Path, problems: list[dict[str, object]], judged: bool) -> list[float]:
    planner = load(memory, judged=judged, polished=False)
    texts = [json.dumps(problem) for problem in problems]
    gc.collect()
    gc.disable()
    times = []
    for text in track(texts, description="robot", transient=True):
        began = perf_counter()
        planner.plan(text)
        times.append(perf_counter() - began)
    gc.enable()
    return times


def _shown(seconds: list[float]) -> list[str]:
    quantiles = np.quantile(seconds, [0.5, 0.9, 0.99, 1.0])
    return [f"{1000 * each:.2f}" for each in quantiles]


if __name__ == "__main__":
    main()
