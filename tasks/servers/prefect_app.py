"""Prefect's server behind the guard.

``python -m tasks.servers.prefect_app FOLDER SOCKET`` runs the server of a data folder at a port that a
command has opened (``SOCKET`` is the number of its file descriptor). It ends when no command uses the server
any more.
"""

from __future__ import annotations

import os
import socket
import sys
import threading
import time
from pathlib import Path

from tasks.servers.access import hosts
from tasks.servers.guard import Guard
from tasks.servers.prefect_server import POLL_SECONDS, SECRET, STOP_SECONDS, URL
from tasks.servers.users import is_used, locked


def prefect_app() -> Guard:
    """Prefect's server behind the guard; it checks the password in PREFECT_SERVER_API_AUTH_STRING itself."""
    from prefect.server.api.server import create_app

    return Guard(create_app(), names=hosts())


def _serve(folder: Path, listener: socket.socket) -> None:
    """Serve until no command uses the server."""
    from uvicorn import Config, Server

    server = Server(Config(prefect_app, factory=True, log_level="error", timeout_graceful_shutdown=1))

    def stop_when_unused() -> None:
        while True:
            time.sleep(POLL_SECONDS)
            with locked(folder):
                if not is_used(folder):
                    for name in (URL, SECRET):  # the next command starts another server
                        (folder / name).unlink(missing_ok=True)
                    break
        server.should_exit = True
        time.sleep(STOP_SECONDS)
        os._exit(0)

    threading.Thread(target=stop_when_unused, daemon=True).start()
    server.run(sockets=[listener])
    os._exit(0)  # at once: Python takes seconds to exit, and the thread no longer runs then


if __name__ == "__main__":
    _serve(Path(sys.argv[1]), socket.socket(fileno=int(sys.argv[2])))
