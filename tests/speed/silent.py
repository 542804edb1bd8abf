"""A memory served among silent connections: how long a problem takes without them and with them.

``python -m tests.speed.silent [--silent 1000] [--workers 2] [--seconds 15] [--rounds 4]`` has the command
serve on loopback and asks it from this process, by turns without and with silent connections, since machines
have moods. Another process opens these, a third of which begin a request that never ends, and opens each
again as soon as it is closed.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import selectors
import socket
import sys
from contextlib import suppress
from multiprocessing.sharedctypes import Synchronized
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, sleep

import httpx
import numpy as np
from rich.console import Console
from rich.table import Table

from planners.world.classes.problem_classes import problem_class
from storage.exchange.problems import fields_of
from tests.speed.serving import served
from tests.tasks.served import JSON, request, write_memory

SEED = 86
PROBLEMS = 100
SETTLING = 2.0  # seconds until all are open, or closed
BEGUN = b"POST /invocations HTTP/1.1\r\nHost: 127.0.0.1\r\n"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--silent", type=int, default=1_000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=15.0, help="of a measurement")
    parser.add_argument("--rounds", type=int, default=4, help="of a measurement without and one with")
    asked = parser.parse_args()
    times: dict[str, list[float]] = {"without": [], "with": []}
    refused = dict.fromkeys(times, 0)
    closed = multiprocessing.Value("i", 0)
    with TemporaryDirectory() as scratch:
        memory = write_memory(Path(scratch) / "memory")
        with served(memory, asked.workers) as (address, _):
            for _ in range(asked.rounds):
                refused["without"] += measure(address, asked.seconds, times["without"])
                holder = multiprocessing.Process(target=hold, args=(address, asked.silent, closed))
                holder.start()
                sleep(SETTLING)
                refused["with"] += measure(address, asked.seconds, times["with"])
                holder.kill()
                holder.join()
                sleep(SETTLING)
    table = Table(title=f"{asked.silent:,} silent connections, {asked.workers} workers", title_justify="left")
    for heading in ("", "requests", "refused", "median ms", "90 % ms", "99 % ms", "slowest ms"):
        table.add_column(heading, justify="right" if heading else "left")
    for name, found in times.items():
        quantiles = np.quantile(found, [0.5, 0.9, 0.99, 1.0])
        shown = [f"{1000 * each:.2f}" for each in quantiles]
        table.add_row(name, f"{len(found):,}", f"{refused[name]:,}", *shown)
    console = Console(width=120)
    console.print(table)
    console.print(f"{closed.value:,} silent connections were closed and opened again")


def hold(address: str, count: int, closed: Synchronized[int]) -> None:
    """Hold so many connections open; each that is closed is opened again, and counted."""
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    host, _, port = address.removeprefix("http://").partition(":")
    selector = selectors.DefaultSelector()

    def connect(number: int) -> None:
        with suppress(OSError):
            connection = socket.create_connection((host, int(port)))
            connection.sendall(BEGUN if number % 3 == 0 else b"")
            connection.setblocking(False)
            selector.register(connection, selectors.EVENT_READ, number)

    for number in range(count):
        connect(number)
    while True:
        for key, _ in selector.select():
            assert isinstance(key.fileobj, socket.socket)
            with suppress(BlockingIOError, ConnectionError):
                if key.fileobj.recv(1_000):
                    continue
            selector.unregister(key.fileobj)
            key.fileobj.close()
            closed.value += 1
            connect(key.data)


def measure(address: str, seconds: float, times: list[float]) -> int:
    """Add the times of one client's requests, one after another; how many were refused."""
    source = problem_class("random", "easy")
    bodies = [request(fields_of(source.draw(SEED, index))) for index in range(PROBLEMS)]
    refused = 0
    last = perf_counter() + seconds
    while perf_counter() < last:
        with httpx.Client(base_url=address, timeout=30) as client:  # a new connection now and then
            for body in bodies:
                began = perf_counter()
                try:
                    answer = client.post("/invocations", content=body, headers=JSON)
                    refused += answer.status_code != 200
                except httpx.HTTPError as error:
                    refused += 1
                    print(repr(error), file=sys.stderr)
                times.append(perf_counter() - began)
    return refused


if __name__ == "__main__":
    main()
