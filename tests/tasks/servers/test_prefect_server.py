"""The local server: shared while somebody uses it, closed to everybody else, gone when nobody uses it."""

from __future__ import annotations

import errno
import os
import socket
import stat
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, suppress
from pathlib import Path

import httpx
import psutil
import pytest
from selenium.webdriver import Keys
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

from tasks.servers import prefect_app
from tasks.servers.connections import allow_files
from tasks.servers.prefect_server import (
    LOG,
    RESTARTS,
    SECRET,
    is_healthy,
    local_server,
    running_server,
    set_environment,
)
from tasks.servers.users import is_held, locked
from tests.dashboards.web.browser import CHROMIUM, DRIVER, browser
from tests.prepared.prefect_database import with_prefect_database
from tests.tasks.servers import attacks

HOLD = """
import os, resource, sys, time
from pathlib import Path
from tasks.servers.prefect_server import local_server
os.umask(0)
resource.setrlimit(resource.RLIMIT_NOFILE, (1024, 1024))
with local_server(Path(sys.argv[1])) as server:
    print(server.url, flush=True)
    time.sleep(600)
"""
PATIENCE = 120.0  # seconds, of a busy machine
SILENT = 1_100  # connections, more than the server may have files
SLOTS = 100  # of Prefect's server on SQLite
ROOT = Path(__file__).parents[3]
ENVIRONMENT = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT_")} | {
    "PYTHONPATH": str(ROOT)
}


class Patient(httpx.HTTPTransport):
    """Asks again, as Prefect's client does, while the database of a server that just started is locked."""

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        for _ in range(50):
            answer = super().handle_request(request)
            if answer.status_code != 503:
                break
            time.sleep(0.2)
        return answer


class Shared:
    """A server in use by two commands, which may have no more files than some systems allow."""

    def __init__(self, data: Path) -> None:
        command = [sys.executable, "-c", HOLD, str(data)]
        self.data = data
        self.users = [
            subprocess.Popen(command, env=ENVIRONMENT, stdout=subprocess.PIPE, text=True) for _ in range(2)
        ]
        self.urls = [user.stdout.readline().strip() for user in self.users if user.stdout]
        found = running_server(data)
        assert found is not None
        self.server = found
        self.server.wait()

    @property
    def state(self) -> Path:
        """The file that each user holds, and that names the server."""
        return self.data / "prefect" / "server.url"

    def client(self) -> httpx.Client:
        """One that knows the password, as the commands do."""
        user, _, password = self.server.secret.partition(":")
        return httpx.Client(base_url=f"{self.server.url}/", auth=(user, password), transport=Patient())


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shared]:
    shared = Shared(with_prefect_database(tmp_path_factory.mktemp("data")))
    try:
        yield shared
    finally:
        for user in shared.users:
            user.kill()
            user.communicate()


@pytest.fixture(scope="module")
def deployment(shared: Shared) -> str:
    """Path of a deployment, such as `serve` has: what it is made of is run."""
    with shared.client() as client:
        flow = client.post("flows/", json={"name": "retrain"}).json()["id"]
        asked = {"name": "scheduled", "flow_id": flow}
        return f"deployments/{client.post('deployments/', json=asked).json()['id']}"


def test_commands_on_one_data_folder_share_a_server(shared: Shared) -> None:
    assert shared.urls == [shared.server.url] * 2
    assert shared.server.url.startswith("http://127.0.0.1:")


def test_only_the_owner_can_read_the_password_whatever_the_umask(shared: Shared) -> None:
    assert stat.S_IMODE(shared.server.secret_file.stat().st_mode) == 0o600
    secret = shared.server.secret.partition(":")[2]
    assert len(secret) >= 32
    assert not [line for line in _command_lines().values() if secret in line]
    files = [path for path in shared.data.rglob("*") if path.is_file() and path != shared.server.secret_file]
    assert not [path for path in files if secret.encode() in path.read_bytes()]


def test_who_does_not_know_the_password_is_told_nothing(shared: Shared, deployment: str) -> None:
    address = f"{shared.server.url}/{deployment}"
    for auth in (None, ("motion-memory", "wrong")):
        assert httpx.get(address, auth=auth).status_code == 401
        assert httpx.patch(address, json=attacks.STEPS, auth=auth).status_code == 401
    assert httpx.get(f"{shared.server.url}/health").status_code == 200


@pytest.mark.parametrize("foreign", [{"Origin": attacks.EVIL}, {"Origin": "null"}, {"Host": "evil.example"}])
def test_another_site_is_refused_even_with_the_password(
    shared: Shared, deployment: str, foreign: dict[str, str]
) -> None:
    with shared.client() as client:
        for answer in (
            client.patch(deployment, json=attacks.STEPS, headers=foreign),
            client.post(f"{deployment}/create_flow_run", json={}, headers=foreign),
            client.delete(deployment, headers=foreign),
            client.get(deployment, headers=foreign),
            client.options(deployment, headers=foreign | {"Access-Control-Request-Method": "PATCH"}),
            client.get(shared.server.ui_url, headers=foreign),
        ):
            assert answer.status_code in (400, 403)
            assert "access-control-allow-origin" not in answer.headers
        assert not client.get(deployment).json()["pull_steps"]
        asked = {"flow_runs": {"deployment_id": {"any_": [deployment.partition("/")[2]]}}}
        assert client.post("flow_runs/filter", json=asked).json() == []
    assert attacks.websocket_status(f"{shared.server.url}/events/in", foreign) == 403
    assert attacks.websocket_status(f"{shared.server.url}/events/in", {}) == 101


@pytest.mark.skipif(not (CHROMIUM and DRIVER), reason="needs chromium and chromium-driver")
def test_in_a_browser_a_page_elsewhere_reaches_nothing_and_the_servers_own_asks_for_the_password(
    shared: Shared, deployment: str
) -> None:
    port = shared.server.ui_url.rpartition(":")[2]
    with browser() as driver, attacks.evil_page() as page:
        driver.get(page)
        told = driver.execute_async_script(attacks.ATTACK, f"{shared.server.url}/{deployment}", attacks.STEPS)
        assert told == {"read": "refused", "changed": "refused", "sent": "refused", "socket": "closed"}
        driver.get(f"{attacks.EVIL}:{port}/")  # a name that now means this machine
        told = driver.execute_async_script(attacks.ATTACK, f"/api/{deployment}", attacks.STEPS)
        assert told == {"read": 400, "changed": 400, "sent": 400, "socket": "closed"}
        with shared.client() as client:
            assert not client.get(deployment).json()["pull_steps"]
        driver.get(shared.server.ui_url)
        waiting = WebDriverWait(driver, PATIENCE)
        box = waiting.until(lambda driver: driver.find_element(By.CSS_SELECTOR, "input[type=password]"))
        told = driver.execute_async_script(attacks.ATTACK, f"/api/{deployment}", attacks.STEPS)
        assert told == {"read": 401, "changed": 401, "sent": 401, "socket": "open"}  # where the token is next
        box.send_keys(shared.server.secret, Keys.ENTER)
        waiting.until(lambda driver: "login" not in driver.current_url)
        driver.get(f"{shared.server.ui_url}/deployments")
        waiting.until(lambda driver: "scheduled" in driver.find_element(By.TAG_NAME, "body").text)
        assert driver.execute_async_script(attacks.ELSEWHERE, page) == "refused"


def test_a_killed_server_is_there_again_for_who_asks_meanwhile(shared: Shared, deployment: str) -> None:
    (killed,) = _servers_of(shared.data)
    killed.kill()
    killed.wait()
    with shared.client() as client:  # at the same address, with the same password and records
        assert client.get(deployment, timeout=PATIENCE).json()["name"] == "scheduled"
    assert running_server(shared.data) == shared.server
    assert _servers_of(shared.data) != [killed]


def test_a_server_stays_for_the_command_that_is_left_which_starts_it_again(shared: Shared) -> None:
    (server,) = _servers_of(shared.data)
    (starter,) = [user for user in shared.users if user.pid == server.ppid()]
    starter.kill()
    time.sleep(0.5)
    assert is_held(shared.state)
    shared.server.wait(PATIENCE)  # still answers
    server.kill()
    shared.server.wait(PATIENCE)  # answers again


def test_neither_silent_connections_nor_few_files_keep_a_server_from_answering_and_ending_with_its_users(
    shared: Shared,
) -> None:
    allow_files()
    log = shared.data / "prefect" / LOG
    before = log.stat().st_size
    with ExitStack() as stack:
        for _ in range(SILENT):
            address = ("127.0.0.1", shared.server.port)
            stack.enter_context(socket.create_connection(address, timeout=PATIENCE))
        assert is_healthy(shared.server.url)
        for _ in range(SLOTS + 20):  # Prefect works for so many requests and websockets at once
            stack.enter_context(attacks.open_websocket(f"{shared.server.url}/events/in", {}))
        with shared.client() as client:
            assert client.get("version").status_code == 200
        for user in shared.users:  # last: it ends what the others ask
            user.kill()
        deadline = time.monotonic() + PATIENCE
        while (shared.state.exists() or _servers_of(shared.data)) and time.monotonic() < deadline:
            time.sleep(0.05)
    assert not shared.state.exists()
    assert not shared.server.secret_file.exists()
    assert not _servers_of(shared.data)
    assert running_server(shared.data) is None
    assert log.stat().st_size - before < 10_000


def test_a_server_that_does_not_stay_ends_its_command_in_one_line(tmp_path: Path) -> None:
    user = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)], env=ENVIRONMENT, stderr=subprocess.PIPE, text=True
    )
    began = time.monotonic()
    while user.poll() is None and time.monotonic() < began + PATIENCE:
        for server in _servers_of(tmp_path):
            with suppress(psutil.NoSuchProcess):
                server.kill()
    told = user.communicate()[1].splitlines()
    assert user.returncode == 1
    assert len(told) == 1 + RESTARTS
    assert str(tmp_path / "prefect" / "server.log") in told[-1]
    assert "Traceback" not in str(told)


def test_a_server_ends_even_if_it_cannot_open_files_for_a_while(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tries = iter([OSError(errno.EMFILE, "Too many open files"), locked(tmp_path)])

    def opened(_: Path) -> AbstractContextManager[None]:
        found = next(tries)
        if isinstance(found, OSError):
            raise found
        return found

    monkeypatch.setattr(prefect_app, "locked", opened)
    (tmp_path / SECRET).write_text("robot:old")
    prefect_app.wait_until_unused(tmp_path)
    assert not (tmp_path / SECRET).exists()


def _command_lines() -> dict[psutil.Process, str]:
    found = psutil.process_iter(["cmdline"])
    return {process: " ".join(process.info["cmdline"] or []) for process in found}


def _servers_of(folder: Path) -> list[psutil.Process]:
    """The children that were started for the folder, and live."""
    lines = _command_lines().items()
    return [process for process, line in lines if "prefect_app" in line and str(folder) in line]


def test_a_server_of_the_users_own_is_left_alone(tmp_path: Path, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    own = {"PREFECT_API_URL": "http://prefect.example/api", "PREFECT_API_AUTH_STRING": "robot:mine"}
    monkeypatch.setattr(os, "environ", {**os.environ, **own})
    with local_server(tmp_path) as server:
        assert server is None
        assert {name: os.environ[name] for name in own} == own
    assert {name: os.environ[name] for name in own} == own
    assert not (tmp_path / "prefect" / "server.url").exists()


def test_what_the_user_has_set_stays(tmp_path: Path, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.setattr(os, "environ", {"PREFECT_HOME": "/mine", "DO_NOT_TRACK": "false"})
    set_environment(tmp_path)
    assert (os.environ["PREFECT_HOME"], os.environ["DO_NOT_TRACK"]) == ("/mine", "false")
    assert os.environ["PREFECT_RESULTS_DEFAULT_SERIALIZER"] == "json"
    assert str(tmp_path) in os.environ["PREFECT_API_DATABASE_CONNECTION_URL"]
    assert (tmp_path / "prefect").stat().st_mode & 0o777 == 0o700  # its database and results are in there
