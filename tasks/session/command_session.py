"""One command: its folder, its server, its workers, its tracker, and the flow that runs among them."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from urllib.parse import urlsplit

from storage.places.data_folder import DataFolder
from storage.places.mirror import is_there, local_place, shown
from tasks.servers.prefect_server import LocalServer, local_server
from tasks.session.hold import hold
from tasks.settings.environment import default_scheduler
from tasks.settings.errors import UsageError
from tasks.settings.redaction import redacted
from tasks.settings.run_settings import RunSettings
from tasks.tracking.mlflow_runs import tracking_uri


@contextmanager
def command_session(
    name: str, settings: RunSettings, data: Path, workers: int, scheduler: str | None
) -> Iterator[str]:
    """Everything that the flow of a command needs; at the end say where its results lie.

    Prefect reads its environment when it is imported, so the flow may only be imported inside.

    Args:
        name: name of the flow.
        settings: what the run is asked to do.
        data: the data folder.
        workers: worker processes of a cluster that is started.
        scheduler: address of a Dask scheduler to use instead.

    Yields:
        the data folder, as flows take it.

    """
    scheduler = scheduler or default_scheduler()
    _check_reachable(scheduler)
    tracking_uri(DataFolder(local_place(data)))  # which refuses a place that cannot be tracked
    with (
        hold(data) as folder,
        local_server(folder.path) as server,
        _workers_for(name, folder, workers, scheduler, server, settings.vehicle),
    ):
        yield folder.place
    _tell(folder, settings)


@contextmanager
def _workers_for(
    name: str,
    folder: DataFolder,
    workers: int,
    scheduler: str | None,
    server: LocalServer | None,
    vehicle: str,
) -> Iterator[None]:
    """Start workers and tracker, compile meanwhile, and wait for the server; all of it at the same time."""
    from tasks.fan_out.fan_out import cluster  # Prefect and Dask, after the environment is set
    from tasks.session.warm_up import warm_up
    from tasks.tracking.logbook import tracker

    with ExitStack() as stack:
        if name not in ("collect", "hallucinate", "benchmark"):
            tracker(folder.place)
        shared = stack.enter_context(cluster(workers, scheduler))
        local = scheduler is None and name != "report"
        stack.enter_context(warm_up(shared, vehicle) if local else nullcontext())
        if server is not None:
            print(server, file=sys.stderr)
            server.wait()
        yield


def _tell(folder: DataFolder, settings: RunSettings) -> None:
    run = folder.run(settings.run_name)
    print(f"data     {shown(run.path if is_there(run.settings) else folder.path)}")
    if is_there(run.figures):
        print(f"figures  {shown(run.figures)}")
    uri = redacted(tracking_uri(folder))
    print(f"MLflow   {uri}" if uri.startswith("http") else f"MLflow   mlflow ui --backend-store-uri {uri}")
    if os.environ.get("PREFECT_API_URL"):
        print(f"Prefect  {redacted(os.environ['PREFECT_API_URL']).removesuffix('/api')}")
    else:
        print(f"Prefect  motion-memory servers --data {folder.path}")


def _check_reachable(scheduler: str | None) -> None:
    """UsageError where workers elsewhere would look for a Prefect server on their own machine."""
    host = urlsplit(scheduler or "").hostname or "localhost"
    if not os.environ.get("PREFECT_API_URL") and not (
        host == "localhost" or host.startswith(("127.", "::1"))
    ):
        raise UsageError(
            f"Workers of {scheduler} cannot reach a Prefect server on loopback: set PREFECT_API_URL to one "
            "that they can (docs/runbook.md)."
        )
