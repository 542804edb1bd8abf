"""Prefect's server behind the guard.

``python -m tasks.servers.prefect_app FOLDER SOCKET`` runs the server of a data folder on a port that a
command has opened (``SOCKET`` is the number of its file descriptor). It ends when no command uses the server
any longer.
"""

from __future__ import annotations

import os
import socket
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Final

from tasks.servers.access import hosts
from tasks.servers.guard import Guard
from tasks.servers.listening import config_of
from tasks.servers.prefect_server import POLL_SECONDS, SECRET, STOP_SECONDS, URL
from tasks.servers.sockets import Sockets
from tasks.servers.users import is_used, locked

# Pages of FastAPI that describe the server to everyone; Prefect's own page does not need them.
DESCRIPTIONS: Final = ("/docs", "/docs/oauth2-redirect", "/openapi.json", "/redoc")


def prefect_app() -> Guard:
    """Prefect's server behind the guard; requests need the password in PREFECT_SERVER_API_AUTH_STRING.

    Prefect itself checks the password of requests, but only once it has begun to work for them; that of
    websockets is checked before.
    """
    from prefect.server.api.server import create_app
    from prefect.settings import get_current_settings

    secret = get_current_settings().server.api.auth_string
    app = create_app()
    proven = app if secret is None else Sockets(app, secret.get_secret_value())
    return Guard(proven, names=hosts(), closed=DESCRIPTIONS)


def wait_until_unused(folder: Path) -> None:
    """Return when no command uses the server of ``folder``, after removing its address and its password."""
    while True:
        time.sleep(POLL_SECONDS)
        with suppress(OSError), locked(folder):  # no more files can be opened now, but soon
            if not is_used(folder):
                for name in (URL, SECRET):  # the next command starts another server
                    (folder / name).unlink(missing_ok=True)
                return


def _serve(folder: Path, listener: socket.socket) -> None:
    """Serve until no command uses the server."""
    from uvicorn import Server

    server = Server(config_of(prefect_app, log_level="error", stop_seconds=1))

    def stop_when_unused() -> None:
        wait_until_unused(folder)
        server.should_exit = True
        time.sleep(STOP_SECONDS)
        os._exit(0)

    threading.Thread(target=stop_when_unused, daemon=True).start()
    server.run(sockets=[listener])
    os._exit(0)  # at once: Python takes seconds to exit, and the thread no longer runs then


if __name__ == "__main__":
    _serve(Path(sys.argv[1]), socket.socket(fileno=int(sys.argv[2])))
