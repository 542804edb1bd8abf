"""A command's own Prefect server: on loopback, inside the data folder, gone when nobody uses it.

The server is a child process that watches the commands which registered with it. It outlives none of them:
when the last one has ended, even by kill -9, it stops itself. A command that finds it alive shares it.
Run as a script (``python local_server.py FOLDER PORT``) this file is that child.
"""

from __future__ import annotations

import fcntl
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Final

START_SECONDS: Final = 90.0  # a cold start on a busy machine took 20
POLL_SECONDS: Final = 0.1
STOP_SECONDS: Final = 0.8  # then the child ends itself the hard way; SQLite stands that

# Set before Prefect, MLflow, Dask or a BLAS is imported, and only where the user has not decided otherwise.
ENVIRONMENT: Final = {
    "DO_NOT_TRACK": "true",
    "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
    "MLFLOW_DISABLE_TELEMETRY": "true",
    "MLFLOW_ALLOW_PICKLE_DESERIALIZATION": "false",
    "PREFECT_RESULTS_DEFAULT_SERIALIZER": "json",
    "PREFECT_SERVER_EPHEMERAL_STARTUP_TIMEOUT_SECONDS": "90",
    "PREFECT_SERVER_UI_API_URL": "/api",
    "PREFECT_SERVER_SERVICES_TASK_RUN_RECORDER_BATCH_SIZE": "200",
    "PREFECT_SERVER_SERVICES_TASK_RUN_RECORDER_READ_BATCH_SIZE": "50",
    "PREFECT_SERVER_SERVICES_TASK_RUN_RECORDER_FLUSH_INTERVAL": "1",
    "PREFECT_SERVER_SERVICES_EVENT_PERSISTER_BATCH_SIZE": "200",
    "PREFECT_LOGGING_LEVEL": "CRITICAL",  # a failure is told once, in one line, by the command
    "PREFECT_LOGGING_TO_API_ENABLED": "false",  # states say it all; logs would cost a request a task
    "PREFECT_CLIENT_MAX_RETRIES": "6",  # two minutes in all
    "PREFECT_CLIENT_RETRY_EXTRA_CODES": "500,504",  # what a server says whose database is away
    "MLFLOW_LOGGING_LEVEL": "ERROR",
    "DASK_LOGGING__DISTRIBUTED": "critical",
    "NO_PROXY": "127.0.0.1,localhost",
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
}


@dataclass(frozen=True)
class LocalServer:
    """A server that is up, or coming up."""

    url: str  # of the API, http://127.0.0.1:<port>/api
    log: Path

    @property
    def ui_url(self) -> str:
        """Address to open in a browser."""
        return self.url.removesuffix("/api")

    def wait(self, seconds: float = START_SECONDS) -> None:
        """Return when the server answers; RuntimeError with one line when it does not."""
        deadline = time.monotonic() + seconds
        while not is_healthy(self.url):
            if time.monotonic() > deadline or _find(self.log.parent) is None:
                raise RuntimeError(
                    f"The local Prefect server did not start; see {self.log}, or set PREFECT_API_URL."
                )
            time.sleep(0.1)


def set_environment(data: Path) -> None:
    """Quiet, private and embedded defaults for every library a command uses, all inside ``data``.

    And the password of all servers, where one is set: ours ask for it, and clients send it.
    """
    from tasks.servers.access import auth_environment  # late: as a script this file has nothing but itself

    home = data / "prefect"
    home.mkdir(parents=True, exist_ok=True)
    folders = {
        "PREFECT_HOME": str(home),
        "PREFECT_LOCAL_STORAGE_PATH": str(home / "results"),
        "PREFECT_API_DATABASE_CONNECTION_URL": f"sqlite+aiosqlite:///{home / 'prefect.db'}",
    }
    for name, value in (ENVIRONMENT | folders | auth_environment()).items():
        os.environ.setdefault(name, value)


@contextmanager
def local_server(data: Path) -> Iterator[LocalServer | None]:
    """Share or start the server of ``data [folder]``; None when PREFECT_API_URL names another one.

    Returns at once, and the server needs some 5 s more: see ``LocalServer.wait``. Sets PREFECT_API_URL.
    """
    set_environment(data)
    if os.environ.get("PREFECT_API_URL"):
        yield None
        return
    folder = data / "prefect"
    server, user = _register(folder)
    os.environ["PREFECT_API_URL"] = server.url
    try:
        yield server
    finally:
        del os.environ["PREFECT_API_URL"]
        _leave(folder, user)


def running_server(data: Path) -> str | None:
    """Address of the API of the server that lives in a data folder, if one does."""
    return _find(data / "prefect")


def _register(folder: Path) -> tuple[LocalServer, IO[str]]:
    """Become a user of the server, one who holds a file locked; start the server where there is none."""
    (folder / "users").mkdir(parents=True, exist_ok=True)
    log = folder / "server.log"
    with _locked(folder):
        user = (folder / "users" / str(os.getpid())).open("w")
        fcntl.flock(user, fcntl.LOCK_EX)
        url = _find(folder)
        if url is None:
            port = _free_port()
            url = f"http://127.0.0.1:{port}/api"
            with (folder / "server.url").open("w") as state, log.open("wb") as sink:
                fcntl.flock(state, fcntl.LOCK_EX)
                state.write(url)
                state.flush()
                child = subprocess.Popen(
                    [sys.executable, "-P", __file__, str(folder), str(port)],
                    stdin=subprocess.DEVNULL,
                    stdout=sink,
                    stderr=sink,
                    pass_fds=[state.fileno()],  # the child holds the lock for as long as it lives
                    start_new_session=True,  # Ctrl-C is for the command; the server follows by itself
                )
            threading.Thread(target=child.wait, daemon=True).start()  # no zombie, should it end first
    return LocalServer(url, log), user


def _leave(folder: Path, user: IO[str]) -> None:
    """Be no user any more and, if this was the last, see the server go."""
    with (folder / "server.url").open("a") as state:  # the child still holds it after it removed the name
        Path(user.name).unlink(missing_ok=True)
        user.close()
        deadline = time.monotonic() + STOP_SECONDS + 4 * POLL_SECONDS
        while not _is_used(folder) and _is_locked(state) and time.monotonic() < deadline:
            time.sleep(0.05)


def _find(folder: Path) -> str | None:
    """Address of the server that lives in ``folder``, healthy or still starting."""
    path = folder / "server.url"
    return path.read_text() if _is_held(path) else None


def _is_used(folder: Path) -> bool:
    """Whether a command that registered is still alive; what dead ones left is removed."""
    entries = list((folder / "users").glob("*"))
    for entry in entries:
        if not _is_held(entry):
            entry.unlink(missing_ok=True)
    return any(entry.exists() for entry in entries)


def _is_held(path: Path) -> bool:
    """Whether a living process holds the lock on a file; the kernel takes locks from dead ones."""
    try:
        with path.open() as file:
            return _is_locked(file)
    except FileNotFoundError:
        return False


def _is_locked(file: IO[str]) -> bool:
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    fcntl.flock(file, fcntl.LOCK_UN)
    return False


def is_healthy(url: str) -> bool:
    """Whether the server at an address answers that it is."""
    import urllib.request  # late: few who import this start a server

    try:
        direct = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        with direct.open(f"{url}/health", timeout=2.0) as answer:
            status: int = answer.status
            return status == 200
    except OSError:
        return False


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    with (folder / "server.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _serve(folder: Path, port: int) -> None:
    """Be the server until nobody uses it."""
    import uvicorn

    server = uvicorn.Server(
        uvicorn.Config(
            "prefect.server.api.server:create_app",
            factory=True,
            host="127.0.0.1",
            port=port,
            log_level="error",
            timeout_graceful_shutdown=1,
        )
    )

    def watch() -> None:
        while True:
            time.sleep(POLL_SECONDS)
            with _locked(folder):
                if not _is_used(folder):
                    (folder / "server.url").unlink(missing_ok=True)  # whoever comes now starts another
                    break
        server.should_exit = True
        time.sleep(STOP_SECONDS)
        os._exit(0)

    threading.Thread(target=watch, daemon=True).start()
    server.run()


if __name__ == "__main__":
    _serve(Path(sys.argv[1]), int(sys.argv[2]))
