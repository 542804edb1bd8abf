"""How busy the workers of a fan-out were, and how much memory they held."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple

import psutil


class Work(NamedTuple):
    """What a worker spent on one chunk."""

    worker: str  # host and process
    began: float  # seconds on a clock of that machine that nobody sets
    ended: float
    memory_bytes: int  # that the worker held then


class Load(NamedTuple):
    """What the workers of a fan-out spent on its chunks, and on waiting between them."""

    what: str
    chunks: int  # done now, not before
    workers: int  # that did some of them
    busy_seconds: float  # in chunks, over all workers
    span_seconds: float  # from each worker's first chunk to the end of its last, over all workers
    first_bytes: int  # held by a worker after its first chunk, at most
    last_bytes: int  # after its last, at most

    @property
    def orchestration(self) -> float:
        """Share of the workers' time, from first to last chunk, that they spent in no chunk."""
        return 1.0 - self.busy_seconds / self.span_seconds if self.span_seconds else 0.0


def work_since(began: float) -> Work:
    """The work on a chunk that this process began at a time of ``time.monotonic`` and ends now."""
    worker = f"{platform.node()}-{os.getpid()}"
    return Work(worker, began, time.monotonic(), psutil.Process().memory_info().rss)


def load_of(what: str, works: Sequence[Work]) -> Load:
    """The load of a fan-out called ``what``, summed over its chunks."""
    by_worker: dict[str, list[Work]] = {}
    for work in sorted(works, key=lambda work: work.began):
        by_worker.setdefault(work.worker, []).append(work)
    return Load(
        what,
        len(works),
        len(by_worker),
        sum(work.ended - work.began for work in works),
        sum(own[-1].ended - own[0].began for own in by_worker.values()),
        max((own[0].memory_bytes for own in by_worker.values()), default=0),
        max((own[-1].memory_bytes for own in by_worker.values()), default=0),
    )


def total_load(loads: Sequence[Load]) -> Load | None:
    """The load of several fan-outs, one after another; None if there are none."""
    if not loads:
        return None
    return Load(
        ", ".join(load.what for load in loads),
        sum(load.chunks for load in loads),
        max(load.workers for load in loads),
        sum(load.busy_seconds for load in loads),
        sum(load.span_seconds for load in loads),
        loads[0].first_bytes,
        max(load.last_bytes for load in loads),
    )


_recorded: ContextVar[list[Load] | None] = ContextVar("loads", default=None)


@contextmanager
def recorded_loads() -> Iterator[list[Load]]:
    """Yield a list to which every fan-out inside adds its load."""
    loads: list[Load] = []
    token = _recorded.set(loads)
    try:
        yield loads
    finally:
        _recorded.reset(token)


def record_load(what: str, works: Sequence[Work]) -> None:
    """Add a fan-out called ``what``, if it did any work, to the list of ``recorded_loads`` around it."""
    loads = _recorded.get()
    if loads is not None and works:
        loads.append(load_of(what, works))
