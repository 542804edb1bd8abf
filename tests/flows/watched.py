"""A command run to its end, and each port that it or a process of it listened on meanwhile."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import psutil

ROOT = Path(__file__).parents[2]
LOOK_SECONDS = 0.5  # for ports: looking takes processor time from what is looked at
READ_SECONDS = 0.05


class Port(NamedTuple):
    """Where somebody listened."""

    process: str  # command, server, child
    address: str


@dataclass
class Watched:
    """What was seen of a command."""

    code: int = 0
    output: str = ""
    ports: set[Port] = field(default_factory=set)


def watch(
    arguments: list[str],
    log: Path,
    environment: dict[str, str] | None = None,
    until: Callable[[str], bool] = lambda _: False,
    script: str = "from flows.cli.main import main; main()",
    ending: signal.Signals = signal.SIGTERM,
) -> Watched:
    """Run a command; send it a signal once its output is what ``until`` waits for."""
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT_")}
    watched = Watched()
    asked, looked = False, 0.0
    with log.open("wb") as sink:
        running = psutil.Popen(
            [sys.executable, "-c", script, *arguments],
            cwd=ROOT,
            env=inherited | (environment or {}),
            stdout=sink,
            stderr=subprocess.STDOUT,
        )
        try:
            while running.poll() is None:
                if time.monotonic() - looked > LOOK_SECONDS:
                    watched.ports |= ports_of(running)
                    looked = time.monotonic()
                if not asked and until(log.read_text(errors="replace")):
                    running.send_signal(ending)
                    asked = True
                time.sleep(READ_SECONDS)
        finally:  # a test that is given up leaves nobody behind
            if running.poll() is None:
                running.kill()
    watched.code, watched.output = running.wait(), log.read_text(errors="replace")
    return watched


def ports_of(command: psutil.Process) -> set[Port]:
    """Where a command or a process of it listens now."""
    found = set()
    try:
        processes = [command, *command.children(recursive=True)]
    except psutil.NoSuchProcess:
        return found
    for process in processes:
        try:
            line = " ".join(process.cmdline())
            connections = process.net_connections("inet")
        except psutil.Error:  # it has ended
            continue
        name = (
            "command" if process == command else "server" if "tasks.servers.prefect_app" in line else "child"
        )
        found |= {
            Port(name, connection.laddr.ip)
            for connection in connections
            if connection.status == psutil.CONN_LISTEN
            or (connection.type == socket.SOCK_DGRAM and connection.laddr and not connection.raddr)
        }
    return found
