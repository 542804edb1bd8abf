"""Retrain on a schedule and when hits have fallen, with a Prefect server that needs no set-up.

Prefect's runner asks the data folder's server which retrainings are due, and starts each as a process.
"""

from __future__ import annotations

import asyncio
import json
import logging
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import psutil

from tasks.champions.drift_watch import DRIFT, KIND, RUN
from tasks.servers.prefect_server import local_server
from tasks.session.folder_lock import locked_folder
from tasks.settings.errors import UsageError
from tasks.settings.run_settings import RunSettings

if TYPE_CHECKING:
    from prefect import Flow
    from prefect.deployments.runner import RunnerDeployment
    from prefect.runner import Runner

DAY: Final = 86_400.0
NAME: Final = "scheduled"
RUNS: Final = {KIND: RUN}  # drift events of memories of runs
QUERY_SECONDS: Final = 2.0  # between two queries to the server
CRON_FIELDS: Final = 5
END_SECONDS: Final = 5.0  # how long a retraining may take to end after Ctrl-C before it is killed

_LOG = logging.getLogger(__name__)


def serve(
    flow: Callable[[], Flow[..., Any]],
    entrypoint: str,
    parameters: Mapping[str, Any],
    data: Path,
    every: float | None,
    cron: str | None,
    name: str = NAME,
    drifting: Mapping[str, str] = RUNS,
) -> None:
    """Retrain on a schedule until Ctrl-C, one retraining at a time.

    Args:
        flow: imports and returns the flow that retrains; called once Prefect's environment is set.
        entrypoint: module and name from which the process of a retraining imports that flow.
        parameters: of the flow, as JSON values, but for the data folder.
        data: the data folder.
        every: seconds from one retraining to the next; a day if neither this nor ``cron`` is given.
        cron: when to retrain, as a cron expression.
        name: of the deployment; one of a name is served at a time.
        drifting: labels of the drift events that start a retraining, too, with their values.

    Raises:
        UsageError: both ``every`` and ``cron`` are given, or one of them is not a schedule.
        InUseError: another command uses the data folder.
    """
    schedule = _schedule(every, cron)
    with locked_folder(data) as folder:  # raises if it is in use; each retraining locks it again
        data_path = folder.path
    with local_server(data_path) as server:
        deployment = _deployment(
            flow(), entrypoint, schedule, {**parameters, "data": str(data_path)}, name, drifting
        )
        if server is not None:
            server.wait()
            _LOG.info(str(server))
        with locked_folder(data_path):  # nobody is at work, whatever Prefect believes
            _end_killed(name, str(data_path))
        when = f"by {cron!r}" if cron else f"every {every or DAY:g} seconds"
        _LOG.info("retrains %s, and whenever hits have fallen; Ctrl-C ends it", when)
        try:
            _run(deployment)
        finally:
            _end_children()


def log_if_scheduled(*lines: str) -> None:
    """Log what came of a retraining, if the schedule started it; a command says so itself."""
    from prefect.runtime import deployment

    if deployment.id is not None:
        for line in filter(None, lines):
            _LOG.info(line)


def retraining_parameters(
    settings: RunSettings, approve: bool, workers: int, scheduler: str | None = None
) -> dict[str, Any]:
    """Parameters of the flow that retrains the memories of a run, but for the data folder.

    Args:
        settings: of each retraining.
        approve: whether better challengers wait for approval.
        workers: worker processes of a retraining.
        scheduler: address of a Dask scheduler to use instead of such processes.
    """
    chosen = {"approve": approve, "workers": workers, "scheduler": scheduler}
    return {"settings": as_parameter(settings), **chosen}


def as_parameter(settings: RunSettings) -> dict[str, Any]:
    """Settings for Prefect: plain JSON of their fields, without the version that files have."""
    values: dict[str, Any] = json.loads(json.dumps(asdict(settings)))
    return values


def _schedule(every: float | None, cron: str | None) -> dict[str, Any]:
    """The schedule as arguments for Prefect, which is not imported before the server's settings exist."""
    if every is not None and cron is not None:
        raise UsageError("--every and --cron are both given; give one of them.")
    if every is not None and not 1.0 <= every < float("inf"):
        raise UsageError(f"Every {every:g} seconds: give 1 or more.")
    if cron is not None and len(cron.split()) != CRON_FIELDS:
        raise _no_cron(cron)
    return {"cron": cron} if cron is not None else {"interval": every or DAY}


def _no_cron(text: str) -> UsageError:
    return UsageError(f'{text!r} is not a cron expression; give one like "0 3 * * *".')


def _deployment(
    flow: Flow[..., Any],
    entrypoint: str,
    schedule: dict[str, Any],
    parameters: dict[str, Any],
    name: str,
    drifting: Mapping[str, str],
) -> RunnerDeployment:
    """A deployment that retrains on the schedule, and whenever a drift event with some labels arrives.

    A retraining that is due while one is at work is cancelled.
    """
    from prefect.client.schemas.objects import ConcurrencyLimitConfig, ConcurrencyLimitStrategy
    from prefect.deployments.runner import RunnerDeployment
    from prefect.events import DeploymentEventTrigger, ResourceSpecification
    from prefect.types.entrypoint import EntrypointType

    trigger = DeploymentEventTrigger(
        name="retrain when hits have fallen", expect={DRIFT}, match=ResourceSpecification({**drifting})
    )
    try:
        deployment = RunnerDeployment.from_flow(
            flow,
            name,
            **schedule,
            parameters=parameters,
            tags=["motion-memory", "retraining"],
            triggers=[trigger],
            concurrency_limit=ConcurrencyLimitConfig(
                limit=1, collision_strategy=ConcurrencyLimitStrategy.CANCEL_NEW
            ),
            entrypoint_type=EntrypointType.MODULE_PATH,
        )
    except ValueError as error:  # how Prefect refuses a cron expression
        if "cron" not in schedule:
            raise
        raise _no_cron(schedule["cron"]) from error
    deployment.entrypoint = entrypoint
    return deployment


def _end_killed(name: str, data: str) -> None:
    """End the runs of a deployment that were killed, or Prefect would let none begin until it misses them.

    Args:
        name: of the deployment.
        data: the data folder of these runs, which the caller has locked.
    """
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.filters import DeploymentFilter, FlowRunFilter
    from prefect.states import Crashed

    states = ["PENDING", "RUNNING", "CANCELLING"]
    at_work = FlowRunFilter.model_validate({"state": {"type": {"any_": states}}})
    of_name = DeploymentFilter.model_validate({"name": {"any_": [name]}})
    with get_client(sync_client=True) as client:
        for each in client.read_flow_runs(flow_run_filter=at_work, deployment_filter=of_name):
            if each.parameters.get("data") == data:
                client.set_flow_run_state(
                    each.id, Crashed(message="It was killed with its serve; the next one goes on.")
                )


def _run(deployment: RunnerDeployment) -> None:
    from prefect.runner import Runner

    runner = Runner("motion-memory", query_seconds=QUERY_SECONDS, limit=1)
    runner.add_deployment(deployment)
    with _ctrl_c_kept_from_children(), suppress(asyncio.CancelledError):
        asyncio.run(_until_ctrl_c(runner))
    raise KeyboardInterrupt


async def _until_ctrl_c(runner: Runner) -> None:
    working = asyncio.ensure_future(runner.start())
    asyncio.get_running_loop().add_signal_handler(signal.SIGINT, working.cancel)
    await working


@contextmanager
def _ctrl_c_kept_from_children() -> Iterator[None]:
    """Let Ctrl-C reach this process alone: a retraining that is starting would print where it was.

    Children inherit the signals that this thread has blocked; another thread gets them instead.
    """
    done = threading.Event()
    threading.Thread(target=done.wait, daemon=True).start()
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        done.set()


def _end_children() -> None:
    """Stop all processes that were started here, except the server, which stops by itself."""
    children = [child for child in psutil.Process().children(recursive=True) if not _is_server(child)]
    for child in children:
        with suppress(psutil.NoSuchProcess):
            child.terminate()
    for child in psutil.wait_procs(children, END_SECONDS)[1]:
        with suppress(psutil.NoSuchProcess):
            child.kill()


def _is_server(child: psutil.Process) -> bool:
    try:
        return "tasks.servers.prefect_app" in child.cmdline()
    except psutil.Error:
        return False
