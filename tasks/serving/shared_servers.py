"""The command ``servers``: Prefect and MLflow for several people or machines, on one data folder.

The servers use the same databases as a command's own servers; environment variables of Prefect and MLflow
choose others. Commands find the servers by PREFECT_API_URL and MLFLOW_TRACKING_URI. Whoever can change
Prefect's records decides what its clients run, so these servers always need a password.
"""

from __future__ import annotations

import functools
import logging
import multiprocessing
import os
import shlex
import signal
import socket
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Final

from starlette.exceptions import StarletteDeprecationWarning

from storage.errors import InUseError
from storage.places.data_folder import DataFolder, open_data_folder
from storage.places.files import locked
from tasks.servers.access import AUTH, access, auth, check_address, hosts, new_secret
from tasks.servers.guard import Guard
from tasks.servers.listening import STOP_SECONDS, address_of, bound, config_of, end_with_parent
from tasks.servers.prefect_app import prefect_app
from tasks.servers.prefect_server import START_SECONDS, is_healthy, set_environment
from tasks.settings.environment import environment
from tasks.settings.errors import RunError
from tasks.tracking.mlflow_database import ready_database

POLL_SECONDS: Final = 0.2  # between two checks that the processes are alive

_LOG = logging.getLogger(__name__)


def servers(data: Path, host: str, prefect_port: int, mlflow_port: int) -> None:
    """Serve until Ctrl-C or SIGTERM.

    Args:
        data: the data folder; it is created if it does not exist.
        host: the address to listen on.
        prefect_port: the port of Prefect's server; 0 takes any free one.
        mlflow_port: the port of MLflow's server.

    Raises:
        UsageError: the address is malformed or not protected.
        RunError: servers are already running for the folder, a port cannot be used, or a server ended.
    """
    check_address(host)
    folder = open_data_folder(data)
    with (
        only_servers(folder),
        bound(host, prefect_port) as prefect_socket,
        bound(host, mlflow_port) as mlflow_socket,
        password_set(
            folder
        ) as access_line,  # last: a command that fails before this leaves another command's file as it is
    ):
        set_environment(folder.path)
        apps: dict[str, tuple[Callable[[], Any], socket.socket]] = {
            "Prefect": (prefect_app, prefect_socket),
            "MLflow": (functools.partial(mlflow_app, folder), mlflow_socket),
        }
        healthy = (f"{address_of(prefect_socket)}/api", address_of(mlflow_socket))
        with _running(apps) as wait:
            wait(lambda: all(is_healthy(url) for url in healthy), START_SECONDS)
            _LOG.info("Prefect  %s  PREFECT_API_URL=%s", address_of(prefect_socket), healthy[0])
            _LOG.info("MLflow   %s  MLFLOW_TRACKING_URI=%s", address_of(mlflow_socket), healthy[1])
            _LOG.info("access   %s; Ctrl-C stops", access_line)
            wait(lambda: False, float("inf"))


@contextmanager
def only_servers(folder: DataFolder) -> Iterator[None]:
    """Lock a data folder against other ``servers`` commands. Raises RunError if one is running for it."""
    with ExitStack() as stack:
        try:
            stack.enter_context(locked(folder.path / "servers.lock", str(folder.path)))
        except InUseError:
            raise RunError(
                f"Servers are already running for {folder.path}; stop them first, or give another --data."
            ) from None
        yield


@contextmanager
def password_set(folder: DataFolder) -> Iterator[str]:
    """Make a password unless MOTION_MEMORY_AUTH is set; yields the line that tells clients how to get it."""
    if auth() is not None:
        yield access()
        return
    file = folder.path / "servers.auth"
    try:
        with environment(**{AUTH: new_secret(file)}):
            yield f'export {AUTH}="$(cat {shlex.quote(str(file))})"; export PREFECT_API_AUTH_STRING="${AUTH}"'
    finally:
        file.unlink(missing_ok=True)


def mlflow_app(data: DataFolder) -> Guard:
    """MLflow's server behind the guard; it serves artifacts, so clients need no access to their folder."""
    os.environ["MLFLOW_SERVER_DISABLE_SECURITY_MIDDLEWARE"] = "true"  # read on import; the guard does more
    from mlflow.server import constants

    store = os.environ.get("MLFLOW_BACKEND_STORE_URI")
    if not store:
        ready_database(data)
        store = f"sqlite:///{data.mlflow_database}"
    artifacts = os.environ.get("MLFLOW_ARTIFACTS_DESTINATION") or data.mlflow_artifacts.as_uri()
    root = "mlflow-artifacts:/"
    os.environ.pop("MLFLOW_TRACKING_URI", None)  # this process is the server, not a client
    os.environ |= {
        constants.BACKEND_STORE_URI_ENV_VAR: store,
        constants.ARTIFACT_ROOT_ENV_VAR: root,
        constants.SERVE_ARTIFACTS_ENV_VAR: "true",
        constants.ARTIFACTS_DESTINATION_ENV_VAR: artifacts,
        "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false",  # would start ten processes that nobody needs
    }
    with warnings.catch_warnings():  # about a part of Starlette that MLflow uses, not the user
        warnings.filterwarnings("ignore", category=StarletteDeprecationWarning)
        from mlflow.server.fastapi_app import app
    from mlflow.server.handlers import initialize_backend_stores

    initialize_backend_stores(store, store, root)
    return Guard(app, auth(), hosts())


@contextmanager
def _running(
    apps: dict[str, tuple[Callable[[], Any], socket.socket]],
) -> Iterator[Callable[[Callable[[], bool], float], None]]:
    """Run a process for each server; yield a function that waits for a condition or the end.

    The function takes a condition and a limit in seconds. It raises RunError if a process ends or the time
    runs out.
    """
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    context = multiprocessing.get_context("spawn")
    processes = {name: context.Process(target=_serve, args=args, name=name) for name, args in apps.items()}

    def wait(until: Callable[[], bool], seconds: float) -> None:
        deadline = time.monotonic() + seconds
        while not (stop.is_set() or until()):
            ended = [name for name, process in processes.items() if not process.is_alive()]
            if ended:
                raise RunError(f"{ended[0]}'s server ended; its output above says why.")
            if time.monotonic() > deadline:
                raise RunError(
                    f"The servers did not start within {seconds:.0f} s; their output above may say why."
                )
            stop.wait(POLL_SECONDS)

    for process in processes.values():
        process.start()
    try:
        yield wait
    finally:
        for process in processes.values():
            process.terminate()
        for process in processes.values():
            process.join(STOP_SECONDS + 1.0)
            process.kill()


def _serve(app: Callable[[], Any], listener: socket.socket) -> None:
    from uvicorn import Server

    end_with_parent()
    Server(config_of(app)).run(sockets=[listener])
