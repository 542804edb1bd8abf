"""Worker processes of one ASGI application behind one port: bound first, opened when the first is ready."""

from __future__ import annotations

import multiprocessing
import os
import socket
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from tasks.settings.errors import RunError, UsageError

if TYPE_CHECKING:
    from uvicorn import Config

READY_SECONDS: Final = 300.0  # to load, and to compile where nothing was compiled before
STOP_SECONDS: Final = 5  # for requests that are being answered
HEALTH_SECONDS: Final = 60  # a worker that does not stir for so long is replaced


def bound(host: str, port: int) -> socket.socket:
    """A socket bound to an address; nobody is let in before somebody listens.

    UsageError: no such port. RunError: the address is in use, or not this machine's.
    """
    if not 0 <= port <= 65_535:
        raise UsageError(f"Port {port}: give one up to 65535, or 0 for a free one.")
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        place = socket.socket(family, kind, protocol)
        place.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        place.bind(address)
    except OSError as error:
        raise RunError(
            f"Port {port} of {host} cannot be used ({error.strerror}); give another one."
        ) from None
    return place


def address_of(place: socket.socket) -> str:
    """Where a bound socket is reached: ``http://127.0.0.1:5001``."""
    host, port = place.getsockname()[:2]
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


def end_with_parent() -> None:
    """Have this process end when the one that started it does, even by kill -9."""
    parent = multiprocessing.parent_process()

    def follow() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=follow, daemon=True).start()


def config_of(app: Callable[[], Any], workers: int = 1) -> Config:
    """How Uvicorn is to serve what ``app`` makes; connections that owe a request are not waited for.

    Also lets this process open as many files as its connections need.
    """
    from uvicorn import Config

    from tasks.servers.connections import IDLE_SECONDS, TimedProtocol, allow_files

    allow_files()
    return Config(
        app,
        factory=True,
        workers=workers,
        log_level="warning",
        access_log=False,
        server_header=False,
        http=TimedProtocol,
        timeout_keep_alive=int(IDLE_SECONDS),
        timeout_graceful_shutdown=STOP_SECONDS,
        timeout_worker_healthcheck=HEALTH_SECONDS,
    )


def serve_with(
    app: Callable[[], Any], place: socket.socket, workers: int, on_ready: Callable[[], None]
) -> None:
    """Have workers make ``app`` (importable) and serve it until Ctrl-C; one that dies is replaced.

    RunError: one could not get ready.
    """
    from uvicorn.supervisors import Multiprocess

    class Workers(Multiprocess):
        """Uvicorn's supervisor, which says when all are ready, or that one will not be."""

        failed = False

        def init_processes(self) -> None:
            super().init_processes()
            if self._are_ready():
                on_ready()
            else:
                self.failed = not self.signal_queue
                self.should_exit.set()

        def _are_ready(self) -> bool:
            last = time.monotonic() + READY_SECONDS
            waiting = list(self.processes)
            while waiting and not self.signal_queue and time.monotonic() < last:
                if not all(each.process.is_alive() for each in waiting):
                    return False
                waiting = [each for each in waiting if not each.is_ready(timeout=0.2)]
                time.sleep(0.05)
            return not waiting

    supervisor = Workers(config_of(app, workers), [place])
    supervisor.run()
    if supervisor.failed:
        raise RunError("The server did not get ready; what its workers printed says why.")
