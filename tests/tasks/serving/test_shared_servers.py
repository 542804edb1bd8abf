"""The command ``servers``: one for a data folder, quiet, closed to who has no password, and ended cleanly."""

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
import psutil
import pytest

from tasks.servers.prefect_app import DESCRIPTIONS
from tests.flows.closed import assert_closed, assert_nowhere_in
from tests.flows.planted import PLANTED
from tests.flows.watched import Watched, ports_of
from tests.prepared.prefect_database import with_prefect_database
from tests.tasks.servers.attacks import EVIL

ROOT = Path(__file__).parents[3]
ENVIRONMENT = {name: value for name, value in PLANTED.items() if name != "MOTION_MEMORY_AUTH"}
ENVIRONMENT |= {"MOTION_MEMORY_HOSTS": "hub"}


@dataclass
class Running:
    """A ``servers`` command that serves."""

    command: subprocess.Popen[str]
    data: Path
    output: str  # until it served

    def address(self, server: str) -> str:
        """The address of a server, "Prefect" or "MLflow"."""
        found = re.search(rf"^{server} +(\S+)", self.output, re.MULTILINE)
        assert found, self.output
        return found[1]

    @property
    def prefect(self) -> str:
        """The address of Prefect's server."""
        return self.address("Prefect")

    @property
    def password(self) -> str:
        """The ``user:password`` that the command has made."""
        return (self.data / "servers.auth").read_text()


def started(data: Path) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "flows.cli.main", "servers", "--data", str(data)]
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PREFECT_", "MOTION_"))}
    return subprocess.Popen(
        [*command, "--prefect-port", "0", "--mlflow-port", "0"],
        cwd=ROOT,
        env=kept | ENVIRONMENT,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    data = with_prefect_database(tmp_path_factory.mktemp("servers") / "data")
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
    password = running.password
    with started(running.data) as second:
        try:
            told = second.communicate(timeout=120)[0]
        finally:
            second.kill()
    assert second.returncode == 1
    assert told.count("\n") == 1
    assert f"Servers are already running for {running.data}" in told
    assert running.password == password
    user, _, word = password.partition(":")
    assert httpx.post(f"{running.prefect}/api/flows/filter", json={}, auth=(user, word)).status_code == 200


def test_without_the_password_prefect_shows_its_page_and_describes_nothing(running: Running) -> None:
    for path in DESCRIPTIONS:
        for prefix in ("", "/api"):
            answer = httpx.get(f"{running.prefect}{prefix}{path}", follow_redirects=True)
            assert answer.status_code in (401, 404)
    for path in ("/", "/ui-settings", "/api/health"):
        assert httpx.get(f"{running.prefect}{path}", follow_redirects=True).status_code == 200


def test_both_ask_for_the_password_and_refuse_other_pages_and_hosts(running: Running) -> None:
    user, _, word = running.password.partition(":")
    search, mlflow = "api/2.0/mlflow/experiments/search", running.address("MLflow")
    asked = {f"{running.prefect}/api/flows/filter": {}, f"{mlflow}/{search}": {"max_results": 5}}
    for url, body in asked.items():
        for auth, answer in ((None, 401), ((user, "wrong"), 401), ((user, word), 200)):
            assert httpx.post(url, auth=auth, json=body).status_code == answer
        known = httpx.post(url, auth=(user, word), json=body, headers={"Host": "hub", "Origin": "http://hub"})
        foreign = httpx.post(url, auth=(user, word), json=body, headers={"Origin": EVIL})
        stranger = httpx.post(url, auth=(user, word), json=body, headers={"Host": "evil.example"})
        assert [each.status_code for each in (known, foreign, stranger)] == [200, 403, 400]
    assert httpx.get(f"{mlflow}/health").status_code == 200


def test_they_listen_where_the_documentation_says(running: Running) -> None:
    ports = ports_of(psutil.Process(running.command.pid))
    assert {port.process for port in ports} >= {"child"}
    assert_closed("servers", Watched(output=running.output, ports=ports))


def test_ended_they_leave_no_password(running: Running) -> None:
    word = running.password.partition(":")[2]
    running.command.send_signal(signal.SIGTERM)
    assert running.command.wait(120) == 0
    assert not (running.data / "servers.auth").exists()
    assert_nowhere_in(running.data)
    assert_nowhere_in(running.data, word)
