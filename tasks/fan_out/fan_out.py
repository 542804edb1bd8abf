"""The fan-out: give chunks to Dask workers, resubmit them if a worker is lost, and show progress."""

from __future__ import annotations

import logging
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
RECONNECT_SECONDS: Final = 120  # how long a scheduler may be away
LOSSES_ALLOWED: Final = 5  # how often a scheduler may be lost within a stage
CLOSE_SECONDS: Final = 0.3
POLL_SECONDS: Final = 0.05
AHEAD: Final = 200  # chunks submitted at a time: enough for all workers, few enough for any memory
LOST: Final = ("cancelled", "lost")  # states of a chunk whose scheduler is gone
GONE: Final = object()  # stands for the state of such a chunk
LOOK_SECONDS: Final = 1.0  # between two checks of partly done chunks, which read files

Client: Any = distributed.Client  # Dask has no types
LocalCluster: Any = distributed.LocalCluster
Security: Any = distributed.Security

_shared: ContextVar[Any] = ContextVar("scheduler", default=None)


class ChunkError(RunError):
    """A chunk could not be done."""


@contextmanager
def cluster(workers: int | None = None, scheduler: str | None = None) -> Iterator[Any]:
    """Yield a cluster that all flows inside this context share.

    It is the cluster of an outer context if there is one, else that of the given scheduler, else a new local
    one. Only this process and its workers have the certificate of a new cluster, so nobody else can use it.

    Args:
        workers: number of worker processes of a new cluster, each with one thread; by default one per core.
        scheduler: address of a Dask scheduler; by default $MOTION_MEMORY_SCHEDULER.

    Yields:
        what a Dask ``Client`` connects to.

    Raises:
        RuntimeError: no scheduler answers at the address, or it does not accept this client's certificate.
        UsageError: the address and Dask's settings disagree on encryption.
    """
    outer = _shared.get()
    if outer is not None:
        yield outer
        return
    address = scheduler or default_scheduler()
    with _connected(address) if address else _local(workers or int(CPU_COUNT)) as shared:
        token = _shared.set(shared)
        try:
            yield shared
        finally:
            _shared.reset(token)


def task_runner() -> Any:
    """The task runner of a flow; it uses the shared cluster from the first submitted task on."""
    shared: Any = cluster  # the runner only enters it as a context
    return DaskTaskRunner(cluster_class=shared, client_kwargs={"timeout": RECONNECT_SECONDS})


@contextmanager
def _connected(address: str) -> Iterator[str]:
    _check_encryption(address)
    try:
        client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError) as error:
        raise RuntimeError(
            redacted(
                f"No Dask scheduler answers at {address}; start one with `dask scheduler`, or give this "
                "machine the certificate that it asks for (docs/runbook.md)."
            )
        ) from error
    with client:
        yield address


def _check_encryption(address: str) -> None:
    security = Security()  # from Dask's settings
    encrypted = address.startswith("tls://")
    if encrypted and not security.tls_client_cert:
        raise UsageError(
            redacted(f"{address} needs a certificate: name one in Dask's settings (docs/runbook.md).")
        )
    if security.require_encryption and not encrypted:
        raise UsageError(
            redacted(f"Dask's settings require encryption, but {address} does not begin with tls://.")
        )


@contextmanager
def _local(workers: int) -> Iterator[Any]:
    # or Prefect would show everything that Dask logs
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    with scratch_folder() as scratch, dask.config.set({**_settings(), "temporary-directory": str(scratch)}):
        try:
            local = LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                host="127.0.0.1",
                security=own_certificate(),
                dashboard_address="127.0.0.1:0",
                scheduler_kwargs={"dashboard": False},
                silence_logs="CRITICAL",
            )
        except RuntimeError as error:  # Dask restarts a worker only if it was running
            raise RunError(
                "A worker process ended while it was starting. Finished chunks are kept; repeat the "
                "command to continue."
            ) from error
        try:
            yield local
        finally:
            _kill(local)  # all results are written; stopping workers cleanly takes seconds
            _close(local)


def _settings() -> dict[str, Any]:
    """The settings in ``dask.yaml``, by their dotted names."""

    def flattened(prefix: str, values: dict[str, Any]) -> Iterator[tuple[str, Any]]:
        for name, value in values.items():
            if isinstance(value, dict):
                yield from flattened(f"{prefix}{name}.", value)
            else:
                yield f"{prefix}{name}", value

    return dict(flattened("", yaml.safe_load(SETTINGS.read_text(encoding="utf-8"))))


def _kill(local: Any) -> None:
    for nanny in local.workers.values():
        nanny.close_gracefully()  # keeps it from being restarted
        # while a worker is being replaced there is no process
        with suppress(AttributeError, ProcessLookupError):
            nanny.process.process.kill()


def _close(local: Any) -> None:
    with suppress(TimeoutError):  # the rest ends with this process
        local.close(timeout=CLOSE_SECONDS)


def run_stage(stage: Stage[Result], data: str, settings: RunSettings) -> dict[Chunk, Result]:
    """Do the chunks of a stage on the flow's workers, except those that are done already.

    The number of chunks may depend on the results of the first ones, so the stage is asked for its chunks
    again until none is left.

    Args:
        stage: the stage.
        data: the data folder.
        settings: the settings of the run.

    Returns:
        the result of each chunk, in the order of the chunks.

    Raises:
        ChunkError: a chunk failed.
        RunError: the scheduler went away for too long or too often.
    """
    results: dict[Chunk, Result] = {}
    while left := [chunk for chunk in stage.chunks(data, settings) if chunk not in results]:
        results |= zip(left, fan_out(stage, left), strict=True)
    return results


def fan_out(job: Job[AnyPiece, Result], pieces: Sequence[AnyPiece]) -> list[Result]:
    """Do the pieces of a job on the flow's workers, except those that are done already.

    If the scheduler goes away and comes back, unfinished pieces are submitted again.

    Args:
        job: says how to do a piece, and whether it is done.
        pieces: the pieces.

    Returns:
        the results, in the order of the pieces.

    Raises:
        ChunkError: a piece failed; the others are not awaited.
        RunError: the scheduler went away for too long or too often.
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
        last_look = time.monotonic()
        while len(done) < len(pieces):
            for i in [waiting.popleft() for _ in range(min(len(waiting), AHEAD - len(pending)))]:
                done_before = job.kept(pieces[i])
                if done_before is None:
                    pending[i] = task.submit(pieces[i])
                else:
                    done[i] = done_before
                    units_done += sizes[i]
            ended = {
                i: future.wrapped_future for i, future in pending.items() if future.wrapped_future.done()
            }
            states = {i: _state(future) for i, future in ended.items()}
            lost = [i for i, state in states.items() if state is GONE]
            if lost:
                losses += 1
                _wait_for_scheduler(ended[lost[0]].client, losses)
            for i, state in states.items():
                del pending[i]
                if state is GONE:
                    waiting.append(i)
                else:
                    done[i] = _result(ended[i], state, pieces[i], job.title)
                    units_done += sizes[i]
            if time.monotonic() - last_look >= LOOK_SECONDS:
                units_begun = units_done + sum(job.units_done(pieces[i]) for i in pending)
                last_look = time.monotonic()
            show(max(units_done, min(units_begun, sum(sizes))))
            time.sleep(POLL_SECONDS)
    record_load(job.title, [piece.work for piece in done.values()])
    return [done[i].result for i in range(len(pieces))]


def _state(future: Any) -> Any:
    """Prefect's state of a chunk that has ended.

    ``GONE`` if its result was lost, with the scheduler or on its way from the worker; None if Dask gave up on
    the chunk.
    """
    if future.status == "finished":
        try:
            # the result holds the error of a failed chunk; only a lost connection raises here
            return future.result()
        except OSError:
            return GONE
    return GONE if future.status in LOST else None


def _wait_for_scheduler(client: Any, losses: int) -> None:
    """Wait until the client is connected again. Raises RunError if it gave up or was cut off too often."""
    while client.status == "connecting":
        time.sleep(POLL_SECONDS)
    if client.status != "running" or losses > LOSSES_ALLOWED:
        raise RunError(
            f"The Dask scheduler went away {losses} times, or for more than {RECONNECT_SECONDS} s; finished "
            "chunks are kept: repeat the command when it is back."
        )


def _result(future: Any, state: Any, chunk: Piece, title: str) -> Any:
    where = f"{title}: chunk {chunk.index} of {chunk.class_name}"
    if state is None:
        cause = future.exception()
        if isinstance(cause, distributed.KilledWorker):
            killed = cause.allowed_failures + 1
            raise ChunkError(
                f"{where} ended {killed} worker processes; was there too little memory?"
            ) from cause
        raise ChunkError(redacted(f"{where} was lost: {cause}")) from cause
    try:
        return state.result(_sync=True)
    except Exception as error:
        reason = str(error).partition("\n")[0]
        raise ChunkError(redacted(f"{where} failed: {reason or type(error).__name__}")) from error
