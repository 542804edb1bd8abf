"""The fan-out: chunks to Dask workers that survive a killed one, with a live progress bar."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import Any, Final

import dask
import distributed
import yaml
from dask.system import CPU_COUNT
from prefect_dask.task_runners import DaskTaskRunner

from storage.places.scratch import scratch_folder
from tasks.fan_out.certificate import own_certificate
from tasks.fan_out.chunk import Chunk, Piece
from tasks.fan_out.piece_task import piece_task
from tasks.fan_out.progress import progress
from tasks.fan_out.progress_artifact import progress_artifact
from tasks.fan_out.stage import AnyPiece, Done, Job, Result, Stage
from tasks.fan_out.workload import record_load
from tasks.settings.environment import default_scheduler
from tasks.settings.errors import RunError, UsageError
from tasks.settings.redaction import redacted
from tasks.settings.run_settings import RunSettings

SETTINGS: Final = Path(__file__).with_name("dask.yaml")
CONNECT_SECONDS: Final = 5
RECONNECT_SECONDS: Final = 120  # for which a scheduler may be away
LOSSES_ALLOWED: Final = 5  # of a scheduler within a stage
CLOSE_SECONDS: Final = 0.3
POLL_SECONDS: Final = 0.05
AHEAD: Final = 200  # chunks that wait for a worker: enough that none waits, few enough for any memory
LOST: Final = ("cancelled", "lost")  # of a chunk whose scheduler is gone
LOOK_SECONDS: Final = 1.0  # between two looks at what is partly done, which reads files

Client: Any = distributed.Client  # Dask has no types
LocalCluster: Any = distributed.LocalCluster
Security: Any = distributed.Security

_shared: ContextVar[Any] = ContextVar("scheduler", default=None)


class ChunkError(RunError):
    """A chunk could not be done."""


@contextmanager
def cluster(workers: int | None = None, scheduler: str | None = None) -> Iterator[Any]:
    """Yield what a ``Client`` connects to: the cluster around this call, the given scheduler, or a new one.

    Every flow inside shares it. A new cluster is local, and only this process and its workers can use it:
    they alone have its certificate.

    Args:
        workers: processes of one thread in a new cluster; by default one a core.
        scheduler: address of a scheduler; by default $MOTION_MEMORY_SCHEDULER.

    Raises:
        RuntimeError: no scheduler answers at the address, or it does not accept this client's certificate.
        UsageError: the address and Dask's settings disagree on encryption.

    """
    around = _shared.get()
    if around is not None:
        yield around
        return
    given = scheduler or default_scheduler()
    with _connected(given) if given else _local(workers or int(CPU_COUNT)) as shared:
        token = _shared.set(shared)
        try:
            yield shared
        finally:
            _shared.reset(token)


def task_runner() -> Any:
    """The task runner of a flow: it looks for the shared cluster when the first task is submitted."""
    shared: Any = cluster  # entered by the runner, which is all that it wants of a cluster
    return DaskTaskRunner(cluster_class=shared, client_kwargs={"timeout": RECONNECT_SECONDS})


@contextmanager
def _connected(address: str) -> Iterator[str]:
    _check_encryption(address)
    try:
        with Client(address, timeout=CONNECT_SECONDS, set_as_default=False):
            yield address
    except (OSError, ValueError) as error:
        raise RuntimeError(
            redacted(
                f"No Dask scheduler answers at {address}; start one with `dask scheduler`, or give this "
                "machine the certificate that it asks for (docs/runbook.md)."
            )
        ) from error


def _check_encryption(address: str) -> None:
    security = Security()  # what Dask's settings say
    encrypted = address.startswith("tls://")
    if encrypted and not security.tls_client_cert:
        raise UsageError(
            redacted(f"{address} needs a certificate: name it in Dask's settings (docs/runbook.md).")
        )
    if security.require_encryption and not encrypted:
        raise UsageError(
            redacted(f"Dask's settings require encryption, but {address} does not begin with tls://.")
        )


@contextmanager
def _local(workers: int) -> Iterator[Any]:
    with scratch_folder() as scratch, dask.config.set({**_settings(), "temporary-directory": str(scratch)}):
        local = LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            host="127.0.0.1",
            security=own_certificate(),
            dashboard_address="127.0.0.1:0",
            scheduler_kwargs={"dashboard": False},
            silence_logs="CRITICAL",
        )
        try:
            yield local
        finally:
            _kill(local)  # what was wanted of them is written; leaving politely takes seconds
            _close(local)


def _settings() -> dict[str, Any]:
    """The settings of ``dask.yaml``, by their dotted names."""

    def named(prefix: str, values: dict[str, Any]) -> Iterator[tuple[str, Any]]:
        for name, value in values.items():
            if isinstance(value, dict):
                yield from named(f"{prefix}{name}.", value)
            else:
                yield f"{prefix}{name}", value

    return dict(named("", yaml.safe_load(SETTINGS.read_text(encoding="utf-8"))))


def _kill(local: Any) -> None:
    for nanny in local.workers.values():
        nanny.close_gracefully()  # that is: do not start it again
        with suppress(AttributeError, ProcessLookupError):  # between two workers there is no process
            nanny.process.process.kill()


def _close(local: Any) -> None:
    with suppress(TimeoutError):  # what is left then dies with this process
        local.close(timeout=CLOSE_SECONDS)


def run_stage(stage: Stage[Result], data: str, settings: RunSettings) -> dict[Chunk, Result]:
    """Do the chunks of a stage on the flow's workers; those of which nothing has changed are not done again.

    How many chunks a stage has may follow from the results of the first ones: it is asked again until no
    chunk is left.

    Returns:
        the result of every chunk, in the order of the chunks.

    Raises:
        ChunkError: a chunk failed.
        RunError: the scheduler went away.

    """
    results: dict[Chunk, Result] = {}
    while left := [chunk for chunk in stage.chunks(data, settings) if chunk not in results]:
        results |= zip(left, fan_out(stage, left), strict=True)
    return results


def fan_out(job: Job[AnyPiece, Result], pieces: Sequence[AnyPiece]) -> list[Result]:
    """Do pieces of work on the flow's workers, but for those that are done already.

    A scheduler that goes away and comes back is given anew what it had not finished.

    Returns:
        the results, in the order of the pieces.

    Raises:
        ChunkError: a piece failed; the others are not waited for.
        RunError: the scheduler went away.

    """
    task, sizes = piece_task(job), [job.units(piece) for piece in pieces]
    done: dict[int, Done[Result]] = {}
    with (
        progress(job.title, sum(sizes)) as bar,
        progress_artifact(job.title, sum(sizes), bar) as show,
    ):
        waiting = deque(range(len(pieces)))
        pending: dict[int, Any] = {}
        units_done = units_begun = losses = 0
        looked = time.monotonic()
        while len(done) < len(pieces):
            for i in [waiting.popleft() for _ in range(min(len(waiting), AHEAD - len(pending)))]:
                kept = job.kept(pieces[i])
                if kept is None:
                    pending[i] = task.submit(pieces[i])
                else:
                    done[i] = kept
                    units_done += sizes[i]
            ended = [i for i, future in pending.items() if future.wrapped_future.done()]
            lost = [i for i in ended if pending[i].wrapped_future.status in LOST]
            if lost:
                losses += 1
                _wait_for_scheduler(pending[lost[0]].wrapped_future.client, losses)
            for i in ended:
                future = pending.pop(i)
                if i in lost:
                    waiting.append(i)
                else:
                    done[i] = _result(future, pieces[i], job.title)
                    units_done += sizes[i]
            if time.monotonic() - looked >= LOOK_SECONDS:
                units_begun = units_done + sum(job.units_done(pieces[i]) for i in pending)
                looked = time.monotonic()
            show(max(units_done, min(units_begun, sum(sizes))))
            time.sleep(POLL_SECONDS)
    record_load(job.title, [each.work for each in done.values() if each.work is not None])
    return [done[i].result for i in range(len(pieces))]


def _wait_for_scheduler(client: Any, losses: int) -> None:
    """Wait until the client has the scheduler again; RunError if it gave up, or lost it too often."""
    while client.status == "connecting":
        time.sleep(POLL_SECONDS)
    if client.status != "running" or losses > LOSSES_ALLOWED:
        raise RunError(
            f"The Dask scheduler went away {losses} times, or for more than {RECONNECT_SECONDS} s; finished "
            "chunks are kept: when it is back, the same command goes on."
        )


def _result(future: Any, chunk: Piece, title: str) -> Any:
    where = f"{title}: chunk {chunk.index} of {chunk.class_name}"
    dask_future = future.wrapped_future
    if dask_future.status != "finished":
        cause = dask_future.exception()
        if isinstance(cause, distributed.KilledWorker):
            killed = cause.allowed_failures + 1
            raise ChunkError(
                f"{where} ended {killed} worker processes; was there too little memory?"
            ) from cause
        raise ChunkError(redacted(f"{where} was lost: {cause}")) from cause
    try:
        return future.result()
    except Exception as error:
        reason = str(error).partition("\n")[0]
        raise ChunkError(redacted(f"{where} failed: {reason or type(error).__name__}")) from error
