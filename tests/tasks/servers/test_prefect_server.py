"""The local server: shared while somebody uses it, gone when nobody does, kill -9 or not."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from tasks.servers.prefect_server import LocalServer, _is_held, local_server, set_environment

HOLD = """
import sys, time
from pathlib import Path
from tasks.servers.prefect_server import local_server
with local_server(Path(sys.argv[1])) as server:
    print(server.url, flush=True)
    time.sleep(120)
"""


def test_a_server_is_found_again_and_outlives_no_user(tmp_path: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT_")}
    environment["PYTHONPATH"] = str(Path(__file__).parents[3])
    asked = [sys.executable, "-c", HOLD, str(tmp_path)]
    state = tmp_path / "prefect" / "server.url"
    users = [subprocess.Popen(asked, env=environment, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    try:
        first, second = (user.stdout.readline().strip() for user in users if user.stdout)
        assert first == second  # one server for both
        assert first.startswith("http://127.0.0.1:")
        server = LocalServer(first, tmp_path / "prefect" / "server.log")
        server.wait()
        users[0].send_signal(signal.SIGKILL)
        time.sleep(0.5)
        assert _is_held(state)
        server.wait(5.0)  # still answers the one that is left
    finally:
        for user in users:
            user.kill()
            user.communicate()
    deadline = time.monotonic() + 10.0
    while (state.exists() or _lives_in(tmp_path)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not state.exists()
    assert not _lives_in(tmp_path)


def _lives_in(folder: Path) -> bool:
    """Whether a process that was started for the folder is there."""
    listed = subprocess.run(["ps", "-eo", "args"], capture_output=True, text=True, check=True).stdout
    return any(f"local_server.py {folder}" in line for line in listed.splitlines())


def test_a_server_of_the_users_own_is_left_alone(tmp_path: Path, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.setattr(os, "environ", {**os.environ, "PREFECT_API_URL": "http://prefect.example/api"})
    with local_server(tmp_path) as server:
        assert server is None
    assert os.environ["PREFECT_API_URL"] == "http://prefect.example/api"
    assert not (tmp_path / "prefect" / "server.url").exists()


def test_what_the_user_has_set_stays(tmp_path: Path, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.setattr(os, "environ", {"PREFECT_HOME": "/mine", "DO_NOT_TRACK": "false"})
    set_environment(tmp_path)
    assert (os.environ["PREFECT_HOME"], os.environ["DO_NOT_TRACK"]) == ("/mine", "false")
    assert os.environ["PREFECT_RESULTS_DEFAULT_SERIALIZER"] == "json"
    assert str(tmp_path) in os.environ["PREFECT_API_DATABASE_CONNECTION_URL"]
