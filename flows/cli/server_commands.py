"""Commands that serve the dashboard, a memory, or Prefect and MLflow for several people and machines."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

from flows.cli.run_options import worker_count

LOOPBACK: Final = "127.0.0.1"


def serve_memory(
    memory: str,
    *,
    vehicle: str | None = None,
    host: str = LOOPBACK,
    port: int = 5001,
    workers: int = 1,
) -> None:
    """Serve the ranked and checked plans of a memory over HTTP, in MLflow's protocol.

    Args:
        memory: Folder of a memory, or of a run with one, or its name in $MOTION_MEMORY_DATA or ./data; or a
            model in MLflow: models:/name/1, models:/name@alias, …
        vehicle: car, differential-drive, car-1-trailer, car-2-trailers, or the .yaml file of another.
            Default: that of the memory.
        host: Address to listen on; one that other machines reach needs MOTION_MEMORY_AUTH=user:password.
        port: Port to listen on; 0 takes any free one.
        workers: Worker processes.
    """
    from tasks.registry.settled_vehicle import settled_vehicle
    from tasks.serving.serve_memory import serve_memory as task
    from tasks.settings.environment import memory_named

    address = memory_named(memory)
    task(address, settled_vehicle(vehicle, memory=address), host, port, worker_count(workers))


def servers(
    *,
    data: Path | None = None,
    host: str = LOOPBACK,
    prefect_port: int = 4200,
    mlflow_port: int = 5000,
) -> None:
    """Run shared servers of Prefect and MLflow until Ctrl-C.

    Args:
        data: Data folder whose records the servers show; default $MOTION_MEMORY_DATA or ./data.
        host: Address to listen on; one that other machines reach needs MOTION_MEMORY_AUTH=user:password.
        prefect_port: Port of Prefect's server.
        mlflow_port: Port of MLflow's server.
    """
    from tasks.serving.shared_servers import servers as task
    from tasks.settings.environment import default_data

    task(data or default_data(), host, prefect_port, mlflow_port)


def dashboard(*, data: Path | None = None, port: int = 8765, browser: bool = True) -> None:
    """Serve the dashboard on loopback until Ctrl-C: runs, problems, memories, live planning, comparisons.

    Args:
        data: Data folder; default $MOTION_MEMORY_DATA or ./data. Nothing in it is changed.
        port: Port to listen on; 0 takes any free one.
        browser: Open the dashboard in a browser, if the output is a terminal.
    """
    from tasks.serving.serve_dashboard import serve_dashboard
    from tasks.settings.environment import default_data

    serve_dashboard(data or default_data(), port, browser and sys.stdout.isatty())
