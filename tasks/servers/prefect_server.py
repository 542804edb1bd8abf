"""A command's own Prefect server, on loopback, with its files in the data folder.

The server is a child process (``tasks.servers.prefect_app``) that watches the commands registered with it.
It stops when the last of them has ended, even by kill -9. A command that finds a server running shares it. If
the server dies, a command restarts it at the same address with the same password, and continues. Each new
server has a new password, in a file that only the owner can read.
"""

from __future__ import annotations

import fcntl
import logging
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
from tasks.servers.users import is_held, is_locked, is_used, locked, register
from tasks.settings.environment import environment

START_SECONDS: Final = 90.0  # a cold start on a busy machine took 20
POLL_SECONDS: Final = 0.1
STOP_SECONDS: Final = 0.8  # to stop cleanly; then the child exits at once, which SQLite survives

RESTARTS: Final = 2  # in a row, without an answer in between
PORT_SECONDS: Final = 5.0  # how long another process may hold the port of a dead server
HOST: Final = "127.0.0.1"
# Variables that make a process a client of the server.
CLIENT: Final = ("PREFECT_API_URL", "PREFECT_API_AUTH_STRING")
URL, SECRET, LOG = "server.url", "server.auth", "server.log"  # files of the server's folder

_LOG = logging.getLogger(__name__)

# Set before Prefect, MLflow, Dask or a BLAS is imported, unless the user has set them.
ENVIRONMENT: Final = {
    "DO_NOT_TRACK": "true",
    "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
    "MLFLOW_DISABLE_TELEMETRY": "true",
    "MLFLOW_ALLOW_PICKLE_DESERIALIZATION": "false",
    "PREFECT_RESULTS_DEFAULT_SERIALIZER": "json",
    "PREFECT_SERVER_EPHEMERAL_STARTUP_TIMEOUT_SECONDS": "90",
    "PREFECT_SERVER_UI_API_URL": "/api",
    # in memory, a server that is started anew would forget who is at work, and let nobody else begin
    "PREFECT_SERVER_CONCURRENCY_LEASE_STORAGE": "prefect.server.concurrency.lease_storage.filesystem",
    "PREFECT_SERVER_SERVICES_TASK_RUN_RECORDER_BATCH_SIZE": "200",
    "PREFECT_SERVER_SERVICES_TASK_RUN_RECORDER_READ_BATCH_SIZE": "50",
    "PREFECT_SERVER_SERVICES_TASK_RUN_RECORDER_FLUSH_INTERVAL": "1",
    "PREFECT_SERVER_SERVICES_EVENT_PERSISTER_BATCH_SIZE": "200",
    "PREFECT_LOGGING_LEVEL": "CRITICAL",  # the command itself reports a failure, in one line
    "PREFECT_INTERNAL_LOGGING_LEVEL": "CRITICAL",  # an event that a dead server missed is not a failure
    "PREFECT_LOGGING_EXTRA_LOGGERS": "tasks,storage",  # only what is logged here goes into a run's log
    "PREFECT_LOGGING_TO_API_WHEN_MISSING_FLOW": "ignore",  # before and after a flow
    "PREFECT_CLIENT_MAX_RETRIES": "6",  # two minutes in all
    "PREFECT_CLIENT_RETRY_EXTRA_CODES": "500,504",  # the answers of a server that cannot reach its database
    "MLFLOW_LOGGING_LEVEL": "ERROR",
    "MLFLOW_SUPPRESS_PRINTING_URL_TO_STDOUT": "true",
    "DASK_LOGGING__DISTRIBUTED": "critical",
    "NO_PROXY": "127.0.0.1,localhost",
    "PYTHONWARNINGS": "ignore:resource_tracker:UserWarning",  # it cleans up after killed processes
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
}


@dataclass(frozen=True)
class LocalServer:
    """A server that runs or is starting."""

    url: str  # address of the API, http://127.0.0.1:<port>/api
    folder: Path  # the folder of its files, ``prefect`` in the data folder

    @property
    def port(self) -> int:
        """The port of the server, for its API and its pages."""
        return int(self.ui_url.rpartition(":")[2])

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
            if time.monotonic() > deadline:
                raise RuntimeError(
                    f"The local Prefect server did not start; see {self.folder / LOG}, "
                    "or set PREFECT_API_URL."
                )
            time.sleep(0.1)


def set_environment(data: Path) -> None:
    """Set environment variables that keep the libraries quiet and private, and their files in a data folder.

    Variables that are already set stay as they are. If servers need a password (``tasks.servers.access``), it
    is set for Prefect's and MLflow's servers and clients.
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
    """Share or start the server of a data folder, and make this process its client while the context lasts.

    Yields the server, or None if PREFECT_API_URL names another one. A new server takes about 5 s to start;
    ``LocalServer.wait`` waits for it.
    """
    set_environment(data)
    if os.environ.get("PREFECT_API_URL"):
        yield None
        return
    folder = data / "prefect"
    with locked(folder):
        server, listener = _join(folder)
        user = register(folder)
    done = threading.Event()
    threading.Thread(target=_keep, args=(server, listener, done), daemon=True).start()
    try:
        with environment(**server.environment):
            yield server
    finally:
        done.set()
        _leave(folder, user)


def running_server(data: Path) -> LocalServer | None:
    """The server of a data folder, if one runs or is starting; else None."""
    folder = data / "prefect"
    return LocalServer((folder / URL).read_text(), folder) if is_held(folder / URL) else None


def _join(folder: Path) -> tuple[LocalServer, socket.socket | None]:
    """The server that other commands use and None, or a new server and its open port.

    If the server of other commands has died, they start it again, so no new one is needed here.
    """
    if is_held(folder / URL) or is_used(folder):
        return LocalServer((folder / URL).read_text(), folder), None
    new_secret(folder / SECRET)
    (folder / LOG).unlink(missing_ok=True)
    listener = socket.create_server((HOST, 0))  # opened here, so that no other program takes the port
    server = LocalServer(f"http://{HOST}:{listener.getsockname()[1]}/api", folder)
    _start(server, listener)
    return server, listener


def _start(server: LocalServer, listener: socket.socket) -> None:
    """Start the server in a child process, on a port that is already open."""
    folder = server.folder
    with (folder / URL).open("w") as state, (folder / LOG).open("ab") as sink:
        state.write(server.url)
        state.flush()
        fcntl.flock(state, fcntl.LOCK_EX)
        child = subprocess.Popen(
            [sys.executable, "-P", "-m", "tasks.servers.prefect_app", str(folder), str(listener.fileno())],
            env=os.environ
            | {
                "PREFECT_SERVER_API_AUTH_STRING": server.secret,
                "PREFECT_SERVER_REGISTER_BLOCKS_ON_START": "false",  # unused; 1 s each start
                # the same modules as here
                "PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path),
            },
            stdin=subprocess.DEVNULL,
            stdout=sink,
            stderr=sink,
            pass_fds=[listener.fileno(), state.fileno()],  # the child holds the lock until it ends
            start_new_session=True,  # Ctrl-C ends the command; the server then stops by itself
        )
    threading.Thread(target=child.wait, daemon=True).start()  # keeps a dead child from becoming a zombie


def _keep(server: LocalServer, listener: socket.socket | None, done: threading.Event) -> None:
    """Restart the server whenever it dies, until this command no longer uses it.

    While a command keeps the port open, clients that connect wait for the next server.
    """
    deaths = 0  # since the server last answered
    refusals = 0  # of the port, one after another
    while not done.wait(POLL_SECONDS):
        if is_held(server.folder / URL):
            refusals = 0
            deaths = 0 if deaths and is_healthy(server.url) else deaths
            continue
        with locked(server.folder):
            if is_held(server.folder / URL) or done.is_set():  # another command was faster
                continue
            try:
                listener = listener or socket.create_server((HOST, server.port))
            except OSError as error:  # usually another command has the port and starts the server itself
                refusals += 1
                if refusals * POLL_SECONDS > PORT_SECONDS:
                    _give_up(server, f"died, and cannot be started again: {error.strerror}")
                continue
            deaths += 1
            if deaths > RESTARTS:
                _give_up(server, "died several times in a row")
            _LOG.warning("The local Prefect server died; starting it again.")
            _start(server, listener)
    if listener is not None:
        listener.close()


def _give_up(server: LocalServer, reason: str) -> None:
    """End this process; otherwise it would wait minutes for the server."""
    _LOG.error(
        "motion-memory: The local Prefect server %s; see %s. Finished work is kept; repeat the command to "
        "go on from here.",
        reason,
        server.folder / LOG,
    )
    os._exit(1)


def _leave(folder: Path, user: IO[str]) -> None:
    """Register this command as no longer using the server; the last one waits for the server to end."""
    with (folder / URL).open("a") as state:  # the child holds its lock even after it has removed the file
        Path(user.name).unlink(missing_ok=True)
        user.close()
        deadline = time.monotonic() + STOP_SECONDS + 4 * POLL_SECONDS
        while not is_used(folder) and is_locked(state) and time.monotonic() < deadline:
            time.sleep(0.05)


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
