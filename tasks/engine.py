"""The fan-out: chunks to Dask workers that survive a killed one, with a live progress bar."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from itertools import islice
from typing import Any, Final

import dask
import distributed
from dask.system import CPU_COUNT
from prefect.tasks import Task
from prefect_dask.task_runners import DaskTaskRunner

from tasks.caching import AnyPiece, Piece
from tasks.progress import progress
from tasks.progress_artifact import progress_artifact
from tasks.settings import RunError
from tasks.work import WORK, note

LIBRARIES: Final = ("OMP", "MKL", "OPENBLAS")  # each worker is one thread
KILLS_ALLOWED: Final = 2  # a chunk that kills a third worker is the culprit and fails the stage
CONNECT_SECONDS: Final = 5
CLOSE_SECONDS: Final = 0.3
POLL_SECONDS: Final = 0.05
AHEAD: Final = 200  # chunks that wait for a worker: enough that none waits, few enough for any memory
LOOK_SECONDS: Final = 1.0  # between two looks at what is partly done, which reads files

Client: Any = distributed.Client  # Dask has no types
LocalCluster: Any = distributed.LocalCluster

_shared: ContextVar[str | None] = ContextVar("scheduler", default=None)


class ChunkError(RunError):
    """A chunk could not be done."""


@contextmanager
def cluster(workers: int | None = None, scheduler: str | None = None) -> Iterator[str]:
    """Address of the scheduler that every flow inside shares: the one around it, the given one, or a new one.

    A new one is local: ``workers`` processes (default: one a core) of one thread, reachable on loopback only.
    RuntimeError with one line when nobody answers at ``scheduler``.
    """
    around = _shared.get()
    if around is not None:
        yield around
        return
    with _connected(scheduler) if scheduler else _local(workers or int(CPU_COUNT)) as address:
        token = _shared.set(address)
        try:
            yield address
        finally:
            _shared.reset(token)


def task_runner() -> Any:
    """What a flow gives its tasks to: the shared cluster, found when the first task is submitted."""
    shared: Any = cluster  # entered by the runner, which is all that it wants of a cluster
    return DaskTaskRunner(cluster_class=shared)


@contextmanager
def _connected(address: str) -> Iterator[str]:
    try:
        with Client(address, timeout=CONNECT_SECONDS, set_as_default=False):
            yield address
    except (OSError, ValueError) as error:
        raise RuntimeError(
            f"No Dask scheduler answers at {address}; start one with `dask scheduler`."
        ) from error


@contextmanager
def _local(workers: int) -> Iterator[str]:
    settings = {
        "distributed.scheduler.allowed-failures": KILLS_ALLOWED,
        "distributed.scheduler.worker-saturation": 1.0,  # a chunk waits for whoever is free, not in a queue
        # a worker that may spill has a folder `storage` on its path, which would hide our package
        "distributed.worker.memory.target": False,
        "distributed.worker.memory.spill": False,
        "distributed.worker.memory.terminate": False,  # a machine's memory is its owner's business
        # Dask has its workers give freed memory back at once (MALLOC_TRIM_THRESHOLD_): training then takes
        # two and a half times as long, most of it in page faults
        "distributed.nanny.pre-spawn-environ": {f"{library}_NUM_THREADS": 1 for library in LIBRARIES},
    }
    with tempfile.TemporaryDirectory(prefix="motion-memory-") as scratch, dask.config.set(settings):
        local = LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
            local_directory=scratch,
            silence_logs="CRITICAL",
        )
        try:
            yield local.scheduler_address
        finally:
            _kill(local)  # what was wanted of them is written; leaving politely takes seconds
            _close(local)


def _kill(local: Any) -> None:
    for nanny in local.workers.values():
        nanny.close_gracefully()  # that is: do not start it again
        with suppress(AttributeError, ProcessLookupError):  # between two workers there is no process
            nanny.process.process.kill()


def _close(local: Any) -> None:
    with suppress(TimeoutError):  # what is left then dies with this process
        local.close(timeout=CLOSE_SECONDS)


def fan_out(
    task: Task[[AnyPiece], dict[str, Any]],
    chunks: Sequence[AnyPiece],
    description: str,
    is_done: Callable[[AnyPiece], bool],
    units: Callable[[AnyPiece], int] = lambda chunk: chunk.last - chunk.first,
    partly_done: Callable[[], int] = lambda: 0,
) -> list[dict[str, Any]]:
    """Do chunks on the flow's workers; results in the order of the chunks.

    A chunk whose shard is not ``is_done`` is done again, whatever the cache says. ``units`` are what the bar
    counts; ``partly_done`` tells those of chunks still at work. ChunkError at the first failure.
    """
    began = time.time()
    results: dict[int, dict[str, Any]] = {}
    sizes = [units(chunk) for chunk in chunks]
    with (
        progress(description, sum(sizes)) as bar,
        progress_artifact(description, sum(sizes), bar) as show,
    ):
        waiting = iter(enumerate(chunks))
        pending: dict[int, Any] = {}
        done = begun = 0
        looked = time.monotonic()
        while len(results) < len(chunks):
            for i, chunk in islice(waiting, AHEAD - len(pending)):
                pending[i] = task.with_options(refresh_cache=not is_done(chunk)).submit(chunk)
            for i in [i for i, future in pending.items() if future.wrapped_future.done()]:
                results[i] = _result(pending.pop(i), chunks[i], description)
                done += sizes[i]
            if time.monotonic() - looked >= LOOK_SECONDS:
                begun, looked = partly_done(), time.monotonic()
            show(max(done, min(begun, sum(sizes))))
            time.sleep(POLL_SECONDS)
    ordered = [results[i] for i in range(len(chunks))]
    note(description, ordered, began)
    return [{name: value for name, value in result.items() if name != WORK} for result in ordered]


def _result(future: Any, chunk: Piece, description: str) -> dict[str, Any]:
    where = f"{description}: chunk {chunk.index} of {chunk.class_name}"
    dask_future = future.wrapped_future
    if dask_future.status != "finished":
        cause = dask_future.exception()
        if isinstance(cause, distributed.KilledWorker):
            raise ChunkError(
                f"{where} ended {KILLS_ALLOWED + 1} worker processes; was there too little memory?"
            ) from cause
        raise ChunkError(f"{where} was lost: {cause}") from cause
    try:
        result: dict[str, Any] = future.result()
    except Exception as error:
        reason = str(error).partition("\n")[0]
        raise ChunkError(f"{where} failed: {reason or type(error).__name__}") from error
    return result
