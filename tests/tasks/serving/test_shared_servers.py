"""The command ``servers``: one for a data folder, which starts without a word of others' and ends cleanly."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest

from tasks.servers.prefect_app import DESCRIPTIONS

ROOT = Path(__file__).parents[3]


@dataclass
class Running:
    """A ``servers`` command that serves."""

    command: subprocess.Popen[str]
    data: Path
    output: str  # until it served

    @property
    def prefect(self) -> str:
        """The address of Prefect's server."""
        found = re.search(r"^Prefect +(\S+)", self.output, re.MULTILINE)
        assert found, self.output
        return found[1]


def started(data: Path) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "flows.cli.main", "servers", "--data", str(data)]
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PREFECT_", "MOTION_"))}
    return subprocess.Popen(
        [*command, "--prefect-port", "0", "--mlflow-port", "0"],
        cwd=ROOT,
        env=kept,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    data = tmp_path_factory.mktemp("servers") / "data"
    command = started(data)
    assert command.stdout
    output = ""
    for line in command.stdout:
        output += line
        if line.startswith("access"):
            break
    try:
        yield Running(command, data, output)
    finally:
        command.send_signal(signal.SIGTERM)
        command.communicate(timeout=120)


def test_they_start_without_warnings(running: Running) -> None:
    assert [line.split()[0] for line in running.output.splitlines()] == ["Prefect", "MLflow", "access"]


def test_a_second_command_on_the_folder_is_refused_and_changes_nothing(running: Running) -> None:
    password = (running.data / "servers.auth").read_text()
    with started(running.data) as second:
        try:
            told = second.communicate(timeout=120)[0]
        finally:
            second.kill()
    assert second.returncode == 1
    assert told.count("\n") == 1
    assert f"Servers run already for {running.data}" in told
    assert (running.data / "servers.auth").read_text() == password
    user, _, word = password.partition(":")
    assert httpx.post(f"{running.prefect}/api/flows/filter", json={}, auth=(user, word)).status_code == 200


def test_without_the_password_prefect_shows_its_page_and_describes_nothing(running: Running) -> None:
    for path in DESCRIPTIONS:
        for prefix in ("", "/api"):
            answer = httpx.get(f"{running.prefect}{prefix}{path}", follow_redirects=True)
            assert answer.status_code in (401, 404)
    for path in ("/", "/ui-settings", "/api/health"):
        assert httpx.get(f"{running.prefect}{path}", follow_redirects=True).status_code == 200


def test_ended_they_leave_no_password(running: Running) -> None:
    running.command.send_signal(signal.SIGTERM)
    assert running.command.wait(120) == 0
    assert not (running.data / "servers.auth").exists()
