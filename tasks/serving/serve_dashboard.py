"""The command ``dashboard``: serve the pages of one data folder on loopback until Ctrl-C."""

from __future__ import annotations

import logging
import math
import os
import socket
import threading
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from dashboards.web.memory_versions import MemoryVersion, Versions
from dashboards.web.notices import NoticeError
from storage.places.data_folder import MARK, DataFolder, open_data_folder
from tasks.registry.champion_registry import Registry, Version
from tasks.servers.access import auth, hosts
from tasks.servers.listening import config_of
from tasks.settings.errors import RunError, UsageError

if TYPE_CHECKING:
    from tasks.servers.guard import Guard

LOOPBACK = "127.0.0.1"
IMPATIENT = {"MLFLOW_HTTP_REQUEST_TIMEOUT": "2", "MLFLOW_HTTP_REQUEST_MAX_RETRIES": "0"}  # a page waits

_LOG = logging.getLogger(__name__)


def serve_dashboard(data: Path, port: int, open_browser: bool) -> None:
    """Serve the pages of a data folder until Ctrl-C.

    Args:
        data: the data folder.
        port: a port from 1 to 65535, or 0 for any free one.
        open_browser: whether to open the dashboard in a browser.

    Raises:
        UsageError: the port cannot be used, or the folder is not a data folder.
    """
    folder = _existing_folder(data)
    if not 0 <= port <= 65535:
        raise UsageError(f"Port is {port}: give 1 to 65535, or 0 for any free port.")
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((LOOPBACK, port))
        listener.listen()  # from now on a browser waits
    except OSError as error:
        raise UsageError(
            f"Port {port} cannot be used ({error.strerror}): give another --port, or 0."
        ) from None
    import uvicorn  # late: together with the application it takes a second to import

    address = f"http://{LOOPBACK}:{listener.getsockname()[1]}/"
    for name, value in IMPATIENT.items():
        os.environ.setdefault(name, value)
    versions = partial(_versions, Registry(folder))
    threading.Thread(target=_read_ahead, args=(versions,), name="registry", daemon=True).start()
    config = config_of(partial(guarded_dashboard, folder, versions))
    _LOG.info("data      %s", folder.path)
    _LOG.info("dashboard %s (until Ctrl-C)", address)
    if open_browser:
        import webbrowser

        webbrowser.open(address)
    uvicorn.Server(config).run(sockets=[listener])


def guarded_dashboard(data: DataFolder, versions: Versions) -> Guard:
    """The dashboard of a data folder behind the guard; ``versions`` reads the registry."""
    from dashboards.web.app import dashboard_app  # late, like Uvicorn
    from tasks.servers.guard import Guard

    return Guard(dashboard_app(data, versions), auth(), hosts())


def _versions(registry: Registry) -> Sequence[MemoryVersion]:
    """Each version of each memory, oldest first. Raises NoticeError if the registry does not answer."""
    try:
        memory_versions = []
        for name in registry.names():
            champion = registry.aliased(name)
            memory_versions += [_memory_version(version, champion) for version in registry.versions(name)]
        return memory_versions
    except RunError as error:
        raise NoticeError(str(error)) from None


def _memory_version(version: Version, champion: Version | None) -> MemoryVersion:
    def figure(name: str) -> float:
        try:
            return float(version.tag(name))
        except ValueError:
            return math.nan

    return MemoryVersion(
        memory=version.name,
        number=version.number,
        retraining=version.retraining,
        run=version.tag("run"),
        verdict=version.tag("verdict"),
        against=version.tag("against"),
        sooner_s=figure("sooner_s"),
        low_s=figure("low_s"),
        high_s=figure("high_s"),
        why=version.tag("why"),
        is_champion=champion is not None and champion.number == version.number,
    )


def _read_ahead(versions: Versions) -> None:
    """Import MLflow, which takes seconds, before a page needs it."""
    with suppress(NoticeError):
        versions()


def _existing_folder(data: Path) -> DataFolder:
    """The data folder at a path; it is not created if it does not exist."""
    folder = data.expanduser().absolute()
    if not folder.is_dir():
        raise UsageError(f"{folder} does not exist; give --data the folder that holds your runs.")
    if not (folder / MARK).is_file() and any(folder.iterdir()):
        raise UsageError(f"{folder} has no {MARK}, so it is not a data folder; give one that `run` made.")
    return open_data_folder(folder) if (folder / MARK).is_file() else DataFolder(folder)
