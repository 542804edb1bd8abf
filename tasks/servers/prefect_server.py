"""A command's own Prefect server, on loopback, with its files in the data folder.

The server is a child process (``tasks.servers.prefect_app``) that watches the commands registered with it.
When the last of them has ended, even by kill -9, it stops. A command that finds a server running shares it.
Each server has a new password, in a file that only the owner can read.
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

from tasks.servers.access import auth_environment, new_secret
from tasks.settings.environment import environment

START_SECONDS: Final = 90.0  # a cold start on a busy machine took 20
POLL_SECONDS: Final = 0.1
STOP_SECONDS: Final = 0.8  # then the child exits at once, which SQLite survives

CLIENT: Final = (
    "PREFECT_API_URL",
    "PREFECT_API_AUTH_STRING",
)  # variables that make a process a client of the server
URL, SECRET, LOG, USERS = "server.url", "server.auth", "server.log", "users"  # files of the server's folder

# Set before Prefect, MLflow, Dask or a BLAS is imported, unless the user has set them.
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
    "PREFECT_LOGGING_LEVEL": "CRITICAL",  # the command reports a failure once, in one line
    "PREFECT_LOGGING_TO_API_ENABLED": "false",  # states are enough; logs would cost one request for each task
    "PREFECT_CLIENT_MAX_RETRIES": "6",  # two minutes in all
    "PREFECT_CLIENT_RETRY_EXTRA_CODES": "500,504",  # the answers of a server that cannot reach its database
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
    """A server that runs or is starting."""

    url: str  # of the API, http://127.0.0.1:<port>/api
    folder: Path  # of its files: ``prefect`` in the data folder

    @property
    def ui_url(self) -> str:
        """The address to open in a browser, which then asks for the password."""
        return self.url.removesuffix("/api")

    @property
    def secret_file(self) -> Path:
        """The file with the password, which only its owner can read."""
        return self.folder / SECRET

    @property
    def secret(self) -> str:
        """The ``user:password`` that the server asks for."""
        return self.secret_file.read_text()

    @property
    def environment(self) -> dict[str, str]:
        """Variables that make Prefect, in this process and its children, a client of the server."""
        return dict(zip(CLIENT, (self.url, self.secret), strict=True))

    def __str__(self) -> str:
        """The line that tells the user the address and the file of the password."""
        return f"Prefect  {self.ui_url} (while this runs; the password is in {self.secret_file})"

    def wait(self, seconds: float = START_SECONDS) -> None:
        """Return when the server answers. Raises RuntimeError if it does not within ``seconds``."""
        deadline = time.monotonic() + seconds
        while not is_healthy(self.url):
            if time.monotonic() > deadline or _find(self.folder) is None:
                raise RuntimeError(
                    f"The local Prefect server did not start; see {self.folder / LOG}, "
                    "or set PREFECT_API_URL."
                )
            time.sleep(0.1)


def set_environment(data: Path) -> None:
    """Set quiet and private defaults for the libraries that a command uses, with their files in ``data``.

    A password (``tasks.servers.access``) is set for Prefect's and MLflow's servers and clients too.
    """
    home = data / "prefect"
    home.mkdir(0o700, parents=True, exist_ok=True)
    folders = {
        "PREFECT_HOME": str(home),
        "PREFECT_LOCAL_STORAGE_PATH": str(home / "results"),
        "PREFECT_API_DATABASE_CONNECTION_URL": f"sqlite+aiosqlite:///{home / 'prefect.db'}",
    }
    for name, value in (ENVIRONMENT | folders | auth_environment()).items():
        os.environ.setdefault(name, value)


@contextmanager
def local_server(data: Path) -> Iterator[LocalServer | None]:
    """Share or start the server of a data folder, and make this process its client.

    Yields the server, which needs some 5 s to start (``LocalServer.wait``), or None if PREFECT_API_URL names
    another one.
    """
    set_environment(data)
    if os.environ.get("PREFECT_API_URL"):
        yield None
        return
    folder = data / "prefect"
    server, user = _register(folder)
    try:
        with environment(**server.environment):
            yield server
    finally:
        _leave(folder, user)


def running_server(data: Path) -> LocalServer | None:
    """The running server of a data folder, or None."""
    return _find(data / "prefect")


def _register(folder: Path) -> tuple[LocalServer, IO[str]]:
    """Register as a user of the server, by the lock on a file; start the server if none runs."""
    (folder / USERS).mkdir(parents=True, exist_ok=True)
    with locked(folder):
        user = (folder / USERS / str(os.getpid())).open("w")
        fcntl.flock(user, fcntl.LOCK_EX)
        return _find(folder) or _start(folder), user


def _start(folder: Path) -> LocalServer:
    """Start the server in a child process, at a port opened here, so that no other program takes it."""
    secret = new_secret(folder / SECRET)
    with (
        socket.create_server(("127.0.0.1", 0)) as listener,
        (folder / URL).open("w") as state,
        (folder / LOG).open("wb") as sink,
    ):
        server = LocalServer(f"http://127.0.0.1:{listener.getsockname()[1]}/api", folder)
        fcntl.flock(state, fcntl.LOCK_EX)
        state.write(server.url)
        state.flush()
        child = subprocess.Popen(
            [sys.executable, "-P", "-m", "tasks.servers.prefect_app", str(folder), str(listener.fileno())],
            env=os.environ
            | {
                "PREFECT_SERVER_API_AUTH_STRING": secret,
                "PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path),  # as in this process
            },
            stdin=subprocess.DEVNULL,
            stdout=sink,
            stderr=sink,
            pass_fds=[listener.fileno(), state.fileno()],  # the child holds the lock until it ends
            start_new_session=True,  # Ctrl-C ends the command; the server then stops by itself
        )
    threading.Thread(target=child.wait, daemon=True).start()  # no zombie is left if it ends first
    return server


def _leave(folder: Path, user: IO[str]) -> None:
    """Stop being a user; the last user waits for the server to end."""
    with (folder / URL).open("a") as state:  # the child still holds it after it removed the name
        Path(user.name).unlink(missing_ok=True)
        user.close()
        deadline = time.monotonic() + STOP_SECONDS + 4 * POLL_SECONDS
        while not is_used(folder) and _is_locked(state) and time.monotonic() < deadline:
            time.sleep(0.05)


def _find(folder: Path) -> LocalServer | None:
    """The server of ``folder`` that runs or is starting, or None."""
    path = folder / URL
    return LocalServer(path.read_text(), folder) if _is_held(path) else None


def is_used(folder: Path) -> bool:
    """Whether a registered command is alive; files of dead ones are removed."""
    entries = list((folder / USERS).glob("*"))
    for entry in entries:
        if not _is_held(entry):
            entry.unlink(missing_ok=True)
    return any(entry.exists() for entry in entries)


def _is_held(path: Path) -> bool:
    """Whether a living process holds the lock on a file; the kernel releases the locks of dead ones."""
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
    """Whether the server at an address answers that it is healthy."""
    import urllib.request  # late: few importers of this module start a server

    try:
        direct = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        with direct.open(f"{url}/health", timeout=2.0) as answer:
            status: int = answer.status
            return status == 200
    except OSError:
        return False


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other processes from starting or ending the server of ``folder``."""
    with (folder / "server.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
