"""The command that serves a memory: ready before it is reached, gone when told, unmoved by nonsense."""

from __future__ import annotations

import os
import random
import re
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import httpx
import psutil
import pytest

from flows.cli.main import call
from tests.tasks.served import JSON, good_request, malformed, write_memory

ROOT = Path(__file__).parents[3]
SECRET = "robot:s3cret-of-the-fleet"
NONSENSE = 10_000
SILENT = 300  # connections, on any number of which requests were answered 503 once
PATIENCE = 60.0  # seconds, of a busy machine
GROWTH = 24 << 20  # bytes that allocators may add after the first thousand requests


@pytest.fixture(scope="module")
def memory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_memory(tmp_path_factory.mktemp("served") / "memory")


@contextmanager
def serving(memory: Path, *options: str, **environment: str) -> Iterator[tuple[psutil.Popen, str]]:
    """The command, once it says that it serves, and its address."""
    command = [sys.executable, "-m", "flows.cli.main", "serve-memory", str(memory), "--port", "0", *options]
    running = psutil.Popen(
        command,
        cwd=ROOT,
        env=os.environ | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        told = ""
        for line in running.stdout:
            told += line
            if line.startswith("access"):
                break
        found = re.search(r"serving  (http://\S+)/invocations", told)
        assert found, told
        yield running, found[1]
    finally:
        if running.poll() is None:
            for process in [*running.children(recursive=True), running]:
                process.kill()
        running.wait()
        running.stdout.close()


def test_it_answers_replaces_a_dead_worker_and_killed_it_leaves_nobody(memory: Path) -> None:
    with serving(memory) as (running, address), httpx.Client(base_url=address, timeout=PATIENCE) as client:
        answer = client.post("/invocations", content=good_request(), headers=JSON)
        assert answer.status_code == 200
        assert len(answer.json()["predictions"]) == 5
        assert client.get("/ping").status_code == 200
        assert _raw(address, b"\x00\xff nonsense\r\n\r\n").startswith(b"HTTP/1.1 400")
        with ExitStack() as silent:
            for _ in range(SILENT):
                silent.enter_context(_connected(address))
            among = client.post("/invocations", content=good_request(), headers=JSON)
            assert among.content == answer.content
            new = httpx.post(f"{address}/invocations", content=good_request(), headers=JSON, timeout=PATIENCE)
            assert new.is_success
        (worker,) = [each for each in running.children() if "spawn_main" in " ".join(each.cmdline())]
        worker.kill()
        again = httpx.post(
            f"{address}/invocations", content=good_request(), headers=JSON, timeout=2 * PATIENCE
        )
        assert again.content == answer.content
        left = running.children(recursive=True)
        running.kill()
        psutil.wait_procs(left, timeout=PATIENCE)
        assert [each for each in left if each.is_running()] == []


def test_what_cannot_be_served_is_one_line(
    memory: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for options, told in (
        ([str(memory), "--port", "99999"], "Port 99999: give one from 1 to 65535"),
        ([str(tmp_path)], "holds no memory"),
        ([str(memory), "--vehicle", "car-1-trailer"], "made for vehicle car"),
    ):
        assert call(["serve-memory", *options]) in (1, 2)
        said = capsys.readouterr().err
        assert told in said
        assert said.count("\n") == 1


def test_a_port_that_is_taken_is_one_line(memory: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        assert call(["serve-memory", str(memory), "--port", port]) == 1
    said = capsys.readouterr().err
    assert f"Port {port} on 127.0.0.1 cannot be used" in said
    assert said.count("\n") == 1


@pytest.mark.slow
def test_ten_thousand_malformed_requests_neither_break_it_nor_fill_its_memory(memory: Path) -> None:
    rng = random.Random(11)
    sizes = []
    with serving(memory) as (running, address), httpx.Client(base_url=address, timeout=PATIENCE) as client:
        (worker,) = [each for each in running.children() if "spawn_main" in " ".join(each.cmdline())]
        for number in range(NONSENSE):
            if number % 1_000 == 0 and number:
                sizes.append(worker.memory_info().rss)
            body, headers = malformed(rng)
            answer = client.post("/invocations", content=body, headers=headers)
            assert answer.status_code < 500, answer.text
            assert "Traceback" not in answer.text
        sizes.append(worker.memory_info().rss)
        assert client.post("/invocations", content=good_request(), headers=JSON).status_code == 200
        assert worker.is_running()
    assert sizes[-1] - sizes[0] < GROWTH, [size >> 20 for size in sizes]


def _connected(address: str) -> socket.socket:
    host, _, port = address.removeprefix("http://").partition(":")
    return socket.create_connection((host, int(port)), timeout=PATIENCE)


def _raw(address: str, message: bytes) -> bytes:
    with _connected(address) as connection:
        connection.sendall(message)
        return connection.recv(1000)
