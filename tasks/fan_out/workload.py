"""How busy the workers of a fan-out were, and how much memory they held."""

from __future__ import annotations

import logging
import os
import platform
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple

import psutil

_LOG = logging.getLogger(__name__)


class Work(NamedTuple):
    """The time and memory that a worker took for one chunk."""

    worker: str  # host and process id
    began: float  # seconds of ``time.monotonic`` on that machine
    ended: float  # the same
    memory_bytes: int  # held by the worker at the end


class Load(NamedTuple):
    """How long the workers of a fan-out were busy with chunks, and how much memory they held."""

    what: str  # name of the fan-out
    chunks: int  # number of chunks that were done now
    workers: int  # number of workers that did them
    busy_seconds: float  # within chunks, summed over workers
    span_seconds: float  # from each worker's first chunk to the end of its last, summed over workers
    first_bytes: int  # the most memory that a worker held after its first chunk
    last_bytes: int  # the most memory that a worker held after its last chunk

    @property
    def orchestration(self) -> float:
        """The share of ``span_seconds`` that the workers spent between chunks."""
        return 1.0 - self.busy_seconds / self.span_seconds if self.span_seconds else 0.0


def work_since(began: float) -> Work:
    """The work on a chunk that ends now and began at ``began``, by this process's ``time.monotonic``."""
    worker = f"{platform.node()}-{os.getpid()}"
    return Work(worker, began, time.monotonic(), psutil.Process().memory_info().rss)


def load_of(what: str, works: Sequence[Work]) -> Load:
    """The load of the fan-out named ``what``, from the work on its chunks."""
    by_worker: dict[str, list[Work]] = {}
    for work in sorted(works, key=lambda work: work.began):
        by_worker.setdefault(work.worker, []).append(work)
    return Load(
        what,
        len(works),
        len(by_worker),
        sum(work.ended - work.began for work in works),
        sum(chunks[-1].ended - chunks[0].began for chunks in by_worker.values()),
        max((chunks[0].memory_bytes for chunks in by_worker.values()), default=0),
        max((chunks[-1].memory_bytes for chunks in by_worker.values()), default=0),
    )


def total_load(loads: Sequence[Load]) -> Load | None:
    """The load of several fan-outs that ran one after another; None if the sequence is empty."""
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


def record_load(what: str, works: Sequence[Work | None]) -> None:
    """Log how many chunks a fan-out did and how many it reused, and record its load.

    Args:
        what: the name of the fan-out.
        works: the work on each chunk; None if it was done before. Work is added to the enclosing
            ``recorded_loads``.
    """
    done = [work for work in works if work is not None]
    load, loads = load_of(what, done), _recorded.get()
    if done and loads is not None:
        loads.append(load)
    by = f", by {load.workers} workers in {load.busy_seconds:,.1f} s of work" if done else ""
    left = len(works) - len(done)
    reused = f"; {left:,} reused, because nothing they depend on has changed" if left else ""
    _LOG.info("%s: %s of %s chunks done%s%s", what, f"{len(done):,}", f"{len(works):,}", by, reused)
