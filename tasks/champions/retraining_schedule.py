"""Retraining on a schedule, and when hits have fallen, with a server that nobody had to set up.

Prefect's own runner asks the data folder's server for what is due and starts each retraining as a process.
"""

from __future__ import annotations

import asyncio
import json
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import psutil

from tasks.champions.drift_watch import DRIFT
from tasks.servers.prefect_server import local_server
from tasks.session.hold import hold
from tasks.settings.errors import UsageError
from tasks.settings.run_settings import RunSettings

if TYPE_CHECKING:
    from prefect import Flow
    from prefect.deployments.runner import RunnerDeployment

DAY: Final = 86_400.0
NAME: Final = "scheduled"
LOOK_SECONDS: Final = 2.0  # between two questions for what is due
CRON_FIELDS: Final = 5
END_SECONDS: Final = 5.0  # for a retraining to end after Ctrl-C, before it is killed


def serve(
    flow: Callable[[], Flow[..., Any]],
    settings: RunSettings,
    data: Path,
    every: float | None,
    cron: str | None,
    approve: bool,
    workers: int,
    scheduler: str | None = None,
) -> None:
    """Retrain on a schedule until Ctrl-C, one retraining at a time.

    Args:
        flow: imports the flow that retrains; called once Prefect's environment is set.
        settings: what a run is asked to do.
        data: the data folder.
        every: seconds between two retrainings; by default a day, if there is no ``cron`` either.
        cron: when to retrain, as a cron expression.
        approve: whether a challenger that is better waits for approval.
        workers: worker processes of a retraining.
        scheduler: address of a Dask scheduler to use instead.

    Raises:
        UsageError: both ``every`` and ``cron`` are given, or one of them is no schedule.

    """
    schedule = _schedule(every, cron)
    with hold(data) as folder:  # is it ours, and free?
        place = folder.path
    parameters = {
        "settings": json.loads(settings.to_json()),
        "data": str(place),
        "approve": approve,
        "workers": workers,
        "scheduler": scheduler,
    }
    with local_server(place) as server:
        deployment = _deployment(flow(), schedule, parameters)
        if server is not None:
            server.wait()
            print(server, file=sys.stderr)
        when = f"by {cron!r}" if cron else f"every {every or DAY:g} seconds"
        print(f"retrains {when}, and when hits have fallen; Ctrl-C ends it", flush=True)
        try:
            _run(deployment)
        finally:
            _end_children()


def tell_failure(_flow: Any, flow_run: Any, state: Any) -> None:
    """Print why a retraining that was started by Prefect failed; of one by command the command tells."""
    if flow_run.deployment_id is not None:
        reason = " ".join(str(state.message).split())
        print(f"motion-memory: {reason.partition('exception: ')[2] or reason}", file=sys.stderr, flush=True)


def _schedule(every: float | None, cron: str | None) -> dict[str, Any]:
    """What Prefect is to be asked for; it is not imported yet, as its settings come with the server."""
    if every is not None and cron is not None:
        raise UsageError("--every and --cron are given; give one of them.")
    if every is not None and not 1.0 <= every < float("inf"):
        raise UsageError(f"Every {every:g} seconds: give 1 or more.")
    if cron is not None and len(cron.split()) != CRON_FIELDS:
        raise _no_cron(cron)
    return {"cron": cron} if cron is not None else {"interval": every or DAY}


def _no_cron(text: str) -> UsageError:
    return UsageError(f'{text!r} is no cron expression; give one like "0 3 * * *".')


def _deployment(
    flow: Flow[..., Any], schedule: dict[str, Any], parameters: dict[str, Any]
) -> RunnerDeployment:
    """The retraining as Prefect knows it; a drift event starts one, too."""
    from prefect.deployments.runner import RunnerDeployment
    from prefect.events import DeploymentEventTrigger
    from prefect.types.entrypoint import EntrypointType

    try:
        return RunnerDeployment.from_flow(
            flow,
            NAME,
            **schedule,
            parameters=parameters,
            tags=["motion-memory", "retraining"],
            triggers=[DeploymentEventTrigger(name="retrain when hits have fallen", expect={DRIFT})],
            entrypoint_type=EntrypointType.MODULE_PATH,
        )
    except ValueError as error:  # Prefect's way to say so
        if "cron" not in schedule:
            raise
        raise _no_cron(schedule["cron"]) from error


def _run(deployment: RunnerDeployment) -> None:
    from prefect.runner import Runner

    runner = Runner("motion-memory", query_seconds=LOOK_SECONDS, limit=1)
    runner.add_deployment(deployment)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # asyncio's own way to end in order
    asyncio.run(runner.start())


def _end_children() -> None:
    """Nothing that was started here outlives this; the server ends by itself."""
    left = [child for child in psutil.Process().children(recursive=True) if not _is_server(child)]
    for child in left:
        with suppress(psutil.NoSuchProcess):
            child.terminate()
    for child in psutil.wait_procs(left, END_SECONDS)[1]:
        with suppress(psutil.NoSuchProcess):
            child.kill()


def _is_server(child: psutil.Process) -> bool:
    try:
        return "tasks.servers.prefect_app" in child.cmdline()
    except psutil.Error:
        return False
