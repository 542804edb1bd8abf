"""Serve an ASGI application from worker processes on one port, which opens when the first is ready."""

from __future__ import annotations

import os
import socket
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from tasks.settings.errors import RunError, UsageError

if TYPE_CHECKING:
    from uvicorn import Config

READY_SECONDS: Final = (
    300.0  # for a worker to load its model, and to compile the kernels if they are not cached
)
STOP_SECONDS: Final = 5  # for requests that are still being answered at the end
PARENT_SECONDS: Final = 0.2  # between two looks whether the parent is alive
HEALTH_SECONDS: Final = 60  # a worker that does not answer for this long is replaced


def bound(host: str, port: int) -> socket.socket:
    """A socket bound to an address; connections are refused until a server listens on it.

    Args:
        host: the name or address of this machine.
        port: the port; 0 takes a free one.

    Raises:
        UsageError: there is no such port.
        RunError: the address is in use, or is not an address of this machine.
    """
    if not 0 <= port <= 65_535:
        raise UsageError(f"Port {port}: give one from 1 to 65535, or 0 for a free one.")
    listener = None
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        listener = socket.socket(family, kind, protocol)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
    except OSError as error:
        if listener is not None:
            listener.close()
        raise RunError(
            f"Port {port} on {host} cannot be used ({error.strerror}); give another one."
        ) from None
    return listener


def address_of(listener: socket.socket) -> str:
    """The address of a bound socket, like ``http://127.0.0.1:5001``."""
    host, port = listener.getsockname()[:2]
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


def end_with_parent() -> None:
    """End this process when the one that started it ends, even by kill -9."""
    parent = os.getppid()

    def wait_and_exit() -> None:
        while os.getppid() == parent:  # the system gives an orphan another parent at once
            time.sleep(PARENT_SECONDS)
        os._exit(1)

    threading.Thread(target=wait_and_exit, daemon=True).start()


def config_of(
    app: Callable[[], Any], workers: int = 1, log_level: str = "warning", stop_seconds: int = STOP_SECONDS
) -> Config:
    """The configuration of Uvicorn for an application, with our bounds on connections (``TimedProtocol``).

    This also lets the process open as many files as its connections need.

    Args:
        app: makes the ASGI application; with several workers it must be importable.
        workers: the number of worker processes.
        log_level: the least important messages of Uvicorn that are printed.
        stop_seconds: how long requests that are being answered at the end may take.
    """
    from uvicorn import Config

    from tasks.servers.connections import IDLE_SECONDS, TimedProtocol, TimedSocket, allow_files, backlog

    allow_files()
    return Config(
        app,
        factory=True,
        workers=workers,
        log_level=log_level,
        access_log=False,
        server_header=False,
        http=TimedProtocol,
        ws=TimedSocket,
        backlog=backlog(),
        timeout_keep_alive=int(IDLE_SECONDS),
        timeout_graceful_shutdown=stop_seconds,
        timeout_worker_healthcheck=HEALTH_SECONDS,
    )


def serve_with(
    app: Callable[[], Any], listener: socket.socket, workers: int, on_ready: Callable[[], None]
) -> None:
    """Serve an application from worker processes until Ctrl-C; a worker that dies is replaced.

    Args:
        app: an importable function that makes the ASGI application; each worker calls it.
        listener: the bound socket.
        workers: the number of worker processes.
        on_ready: called once, when all workers are ready.

    Raises:
        RunError: a worker died before it was ready, or took too long.
    """
    from uvicorn.supervisors import Multiprocess

    class Workers(Multiprocess):
        """Uvicorn's supervisor; it also notes whether all workers got ready."""

        failed = False

        def init_processes(self) -> None:
            super().init_processes()
            if self._are_ready():
                on_ready()
            else:
                self.failed = not self.signal_queue
                self.should_exit.set()

        def _are_ready(self) -> bool:
            deadline = time.monotonic() + READY_SECONDS
            waiting = list(self.processes)
            while waiting and not self.signal_queue and time.monotonic() < deadline:
                if not all(worker.process.is_alive() for worker in waiting):
                    return False
                waiting = [worker for worker in waiting if not worker.is_ready(timeout=0.2)]
                time.sleep(0.05)
            return not waiting

    supervisor = Workers(config_of(app, workers), [listener])
    supervisor.run()
    if supervisor.failed:
        raise RunError("The server did not start; the lines above, from its workers, say why.")
