"""What the flow of a command needs around it: the locked data folder, a server, workers, a tracker."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

from storage.places.data_folder import DataFolder
from storage.places.mirror import is_there, local_place, shown
from storage.places.run_folder import RunFolder
from tasks.servers.prefect_server import LocalServer, local_server, set_environment
from tasks.session.folder_lock import locked_folder
from tasks.settings.environment import default_scheduler
from tasks.settings.errors import UsageError
from tasks.settings.redaction import redacted
from tasks.settings.run_settings import RunSettings
from tasks.tracking.mlflow_runs import tracker
from tasks.tracking.tracking_address import tracking_uri

UNTRACKED: Final = ("collect", "hallucinate", "benchmark")  # flows that log nothing in MLflow

_LOG = logging.getLogger(__name__)


@contextmanager
def command_session(
    name: str, settings: RunSettings, data: Path, workers: int, scheduler: str | None
) -> Iterator[str]:
    """Provide everything that the flow of a command needs; at the end, log where its results are.

    Prefect reads its environment when it is imported, so import the flow only inside this context.

    Args:
        name: name of the flow.
        settings: settings of the run.
        data: the data folder.
        workers: number of worker processes to start.
        scheduler: address of a Dask scheduler to use instead of such processes.

    Yields:
        the data folder, as flows take it: a path, or ``s3://bucket/folder``.

    Raises:
        InUseError: another command uses the data folder.
        RuntimeError: the MLflow server that MLFLOW_TRACKING_URI names cannot be used.
        UsageError: workers of the scheduler could not reach the Prefect server, or the data folder is in
            object storage and no MLflow server is named.
    """
    scheduler = scheduler or default_scheduler()
    _check_reachable(scheduler)
    tracking_uri(DataFolder(local_place(data)))  # raises UsageError early
    with locked_folder(data) as folder:
        if name not in UNTRACKED:
            set_environment(folder.path)  # before MLflow is imported
            tracker(folder.place).check_server()  # before anything else is started
        with (
            local_server(folder.path) as server,
            _workers_for(name, workers, scheduler, server, settings.vehicle),
        ):
            yield folder.place
    _log_locations(folder, folder.run(settings.run_name) if name != "retrain" else None)  # it makes others


@contextmanager
def _workers_for(
    name: str,
    workers: int,
    scheduler: str | None,
    server: LocalServer | None,
    vehicle: str,
) -> Iterator[None]:
    """Start workers and compile the kernels while the server starts; then wait for it."""
    from tasks.fan_out.fan_out import cluster  # Prefect and Dask, after the environment is set
    from tasks.session.warm_up import warm_up

    with ExitStack() as stack:
        shared = stack.enter_context(cluster(workers, scheduler))
        local = scheduler is None and name != "report"
        stack.enter_context(warm_up(shared, vehicle) if local else nullcontext())
        if server is not None:
            _LOG.info(str(server))
            server.wait()
        yield


def _log_locations(folder: DataFolder, run: RunFolder | None) -> None:
    places = {"data": shown(run.path if run and is_there(run.settings) else folder.path)}
    _LOG.info(places | ({"figures": shown(run.figures)} if run and is_there(run.figures) else {}))
    uri = redacted(tracking_uri(folder))
    _LOG.info("MLflow   %s", uri if uri.startswith("http") else f"mlflow ui --backend-store-uri {uri}")
    server = redacted(os.environ.get("PREFECT_API_URL", "")).removesuffix("/api")
    _LOG.info("Prefect  %s", server or f"motion-memory servers --data {folder.path}")


def _check_reachable(scheduler: str | None) -> None:
    """Raise UsageError if workers on other machines would get the address of a server on loopback."""
    host = urlsplit(scheduler or "").hostname or "localhost"
    if not os.environ.get("PREFECT_API_URL") and not (
        host == "localhost" or host.startswith(("127.", "::1"))
    ):
        raise UsageError(
            f"Workers of {scheduler} cannot reach a Prefect server on loopback: set PREFECT_API_URL to one "
            "that they can reach (docs/runbook.md)."
        )
