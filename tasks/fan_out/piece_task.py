"""A piece of work as a Prefect task, which is retried if the cause of its failure may be temporary."""

from __future__ import annotations

import functools
from typing import Any, Final

from prefect import task
from prefect.cache_policies import NO_CACHE
from prefect.client.schemas.objects import State
from prefect.tasks import Task, exponential_backoff

from storage.errors import StorageError, UnreachableError
from tasks.fan_out.stage import AnyPiece, Done, Job, Result

RETRIES: Final = 3  # of a piece that failed because of a disk, a network or object storage
FIRST_WAIT_SECONDS: Final = 2.0  # each later wait is twice as long


def piece_task(job: Job[AnyPiece, Result]) -> Task[[AnyPiece], Done[Result]]:
    """The Prefect task that does a piece of a job and keeps its result.

    If storage does not answer, the task is retried with growing waits. Other failures would only be repeated,
    so they are final.
    """
    name = job.do.__name__.replace("_", "-")

    @functools.wraps(job.do)
    def run(piece: AnyPiece) -> Done[Result]:
        return job.run(piece)

    del run.__wrapped__  # or Prefect knows its argument by the name that it has in what is wrapped
    return task(
        name=name,
        task_run_name=f"{name} {{piece.class_name}} {{piece.index}}",
        cache_policy=NO_CACHE,
        persist_result=False,  # Prefect would keep it on the worker's own disk
        retries=RETRIES,
        retry_delay_seconds=exponential_backoff(FIRST_WAIT_SECONDS),
        retry_jitter_factor=0.5,
        retry_condition_fn=_may_pass,
    )(run)


def _may_pass(_task: object, _run: object, state: State[Any]) -> bool:
    """Whether the cause of a failure may be temporary."""
    error = state.data
    passing = (UnreachableError, OSError)
    is_wrapped = isinstance(error, StorageError) and isinstance(error.__cause__, passing)
    return isinstance(error, passing) or is_wrapped
