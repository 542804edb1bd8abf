"""A memory served to many clients while a worker is killed each minute: nothing wrong, errors only in flight.

``python -m tests.speed.kills [--minutes 10] [--clients 50] [--workers 2] [--every 60]`` has the command serve
on loopback. Every answer is compared, byte by byte, with what the same memory answers in this process. An
error is excused if a worker was dying between the beginning of its request and the error.
"""

from __future__ import annotations

import argparse
import random
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, sleep

import httpx
import numpy as np
import psutil
from rich.console import Console
from rich.table import Table

from planners.world.classes.problem_classes import problem_class
from storage.exchange.problems import fields_of
from tests.speed.serving import served
from tests.tasks.served import JSON, request, write_memory

SEED = 87
PROBLEMS = 60
SHOWN = 10  # of the errors that nothing excuses


@dataclass
class Trial:
    """What came of the requests."""

    times: list[float] = field(default_factory=list)  # seconds of each request that was answered
    wrong: int = 0  # answers that are not the expected ones
    errors: list[tuple[float, float, str]] = field(default_factory=list)  # began, ended, what
    kills: list[tuple[float, float]] = field(default_factory=list)  # from the signal until it was gone
    healed: list[float] = field(
        default_factory=list
    )  # seconds from a kill until all workers were there again

    def unexcused(self) -> list[tuple[float, float, str]]:
        """Errors of requests that were not in flight when a worker died."""
        return [
            error
            for error in self.errors
            if not any(error[0] <= gone and killed <= error[1] for killed, gone in self.kills)
        ]


def main() -> None:
    """Print the table; exit code 1 for a wrong answer, or an error that nothing excuses."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--clients", type=int, default=50)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--every", type=float, default=60.0, help="seconds from kill to kill")
    asked = parser.parse_args()
    with TemporaryDirectory() as scratch:
        memory = write_memory(Path(scratch) / "memory")
        expected = _expected(memory)
        with served(memory, asked.workers) as (address, process):
            trial = _trial(address, process, expected, asked)
    _report(trial, asked)
    sys.exit(1 if trial.wrong or trial.unexcused() else 0)


def _expected(memory: Path) -> dict[bytes, bytes]:
    """Requests, and what they are to be answered."""
    from tasks.serving.scoring import Scoring
    from tasks.tracking.memory_model import MemoryModel, pyfunc_of

    model = MemoryModel()
    model.open(memory, "car")
    scoring = Scoring(pyfunc_of(model))
    source = problem_class("random", "easy")
    problems = [fields_of(source.draw(SEED, index)) for index in range(PROBLEMS)]
    bodies = [request(problem, top_k=1 + index % 7) for index, problem in enumerate(problems)]
    return {body: scoring.answer(body) for body in bodies}


def _trial(
    address: str, process: psutil.Popen, expected: dict[bytes, bytes], asked: argparse.Namespace
) -> Trial:
    trial = Trial()
    last = perf_counter() + 60.0 * asked.minutes
    killer = threading.Thread(target=_kill, args=(trial, process, asked, last))
    killer.start()
    with ThreadPoolExecutor(asked.clients) as threads:
        for each in [threads.submit(_ask, trial, address, expected, last, n) for n in range(asked.clients)]:
            each.result()
    killer.join()
    return trial


def _ask(trial: Trial, address: str, expected: dict[bytes, bytes], last: float, number: int) -> None:
    rng = random.Random(number)
    bodies = list(expected)
    with httpx.Client(base_url=address, timeout=120) as client:
        while (began := perf_counter()) < last:
            body = rng.choice(bodies)
            try:
                answer = client.post("/invocations", content=body, headers=JSON)
            except httpx.HTTPError as error:
                trial.errors.append((began, perf_counter(), repr(error)))
                continue
            if answer.status_code != 200:
                trial.errors.append((began, perf_counter(), f"{answer.status_code} {answer.text[:200]}"))
                continue
            trial.times.append(perf_counter() - began)
            trial.wrong += answer.content != expected[body]


def _kill(trial: Trial, process: psutil.Popen, asked: argparse.Namespace, last: float) -> None:
    """Kill a worker now and then, and note when it was gone and when another one was started."""
    rng = random.Random(SEED)
    while perf_counter() + asked.every < last:
        sleep(asked.every)
        victim = rng.choice(_workers(process))
        killed = perf_counter()
        victim.kill()
        psutil.wait_procs([victim], timeout=60)
        trial.kills.append((killed, perf_counter()))
        while len(_workers(process)) < asked.workers and perf_counter() < last:
            sleep(0.1)
        trial.healed.append(perf_counter() - killed)


def _workers(process: psutil.Popen) -> list[psutil.Process]:
    return [
        each
        for each in process.children()
        if each.is_running()
        and each.status() != psutil.STATUS_ZOMBIE
        and "spawn_main" in " ".join(each.cmdline())
    ]


def _report(trial: Trial, asked: argparse.Namespace) -> None:
    console = Console(width=130)
    table = Table(title=f"{asked.clients} clients, {asked.workers} workers, {asked.minutes:g} minutes")
    unexcused = trial.unexcused()
    p50, p99, slowest = np.quantile(trial.times, [0.5, 0.99, 1.0])
    for name, value in (
        ("answers", f"{len(trial.times):,}"),
        ("wrong answers", f"{trial.wrong:,}"),
        ("workers killed", f"{len(trial.kills)}"),
        ("errors of requests in flight", f"{len(trial.errors) - len(unexcused)}"),
        ("other errors", f"{len(unexcused)}"),
        ("median, 99 %, slowest", f"{1000 * p50:.0f} ms, {1000 * p99:.0f} ms, {1000 * slowest:.0f} ms"),
        ("until a successor was started", ", ".join(f"{each:.1f} s" for each in trial.healed)),
    ):
        table.add_row(name, value)
    console.print(table)
    for began, ended, told in unexcused[:SHOWN]:
        near = min((abs(began - killed) for killed, _ in trial.kills), default=0.0)
        console.print(f"after {ended - began:.2f} s, {near:.2f} s from a kill: {told}")


if __name__ == "__main__":
    main()
