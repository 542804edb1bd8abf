"""What the workers of a fan-out did: how much of their time went into chunks, how much memory they hold."""

from __future__ import annotations

import functools
import os
import platform
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, Final, NamedTuple

import psutil

WORK: Final = "work"  # of a chunk's result


class Work(NamedTuple):
    """One chunk, as the worker saw it."""

    worker: str  # host and process
    began: float  # seconds on a clock of that machine that nobody sets
    ended: float
    memory_bytes: int  # that the worker held then


class Load(NamedTuple):
    """What chunks a fan-out did, and what it cost to have them done."""

    what: str
    chunks: int  # done now, not before
    workers: int  # that did some of them
    busy_seconds: float  # in chunks, over all workers
    span_seconds: float  # from each worker's first chunk to the end of its last, over all workers
    first_bytes: int  # held by a worker after its first chunk, at most
    last_bytes: int  # after its last, at most

    @property
    def orchestration(self) -> float:
        """Share of a worker's time between its first and last chunk that went into none."""
        return 1.0 - self.busy_seconds / self.span_seconds if self.span_seconds else 0.0


def measured(function: Callable[[Any], dict[str, Any]]) -> Callable[[Any], dict[str, Any]]:
    """Wrap a chunk's function so that its result says when and where it was done."""

    @functools.wraps(function)
    def wrapped(chunk: Any) -> dict[str, Any]:
        began = time.monotonic()
        result = function(chunk)
        worker = f"{platform.node()}-{os.getpid()}"
        work = Work(worker, began, time.monotonic(), psutil.Process().memory_info().rss)
        return result | {WORK: work._asdict()}

    return wrapped


def load_of(what: str, works: Sequence[Work]) -> Load:
    """What a fan-out's chunks come to."""
    of_worker: dict[str, list[Work]] = {}
    for work in sorted(works, key=lambda work: work.began):
        of_worker.setdefault(work.worker, []).append(work)
    return Load(
        what,
        len(works),
        len(of_worker),
        sum(work.ended - work.began for work in works),
        sum(mine[-1].ended - mine[0].began for mine in of_worker.values()),
        max((mine[0].memory_bytes for mine in of_worker.values()), default=0),
        max((mine[-1].memory_bytes for mine in of_worker.values()), default=0),
    )


def whole(parts: Sequence[Load]) -> Load | None:
    """Several fan-outs, one after another, as one; None where there is none."""
    if not parts:
        return None
    return Load(
        ", ".join(part.what for part in parts),
        sum(part.chunks for part in parts),
        max(part.workers for part in parts),
        sum(part.busy_seconds for part in parts),
        sum(part.span_seconds for part in parts),
        parts[0].first_bytes,
        max(part.last_bytes for part in parts),
    )


_noted: ContextVar[list[Load] | None] = ContextVar("loads", default=None)


@contextmanager
def loads() -> Iterator[list[Load]]:
    """The list that fills with every fan-out inside."""
    found: list[Load] = []
    token = _noted.set(found)
    try:
        yield found
    finally:
        _noted.reset(token)


def note(what: str, results: Sequence[dict[str, Any]]) -> None:
    """Add a fan-out to the list around it, if any: what the chunks that were done now told."""
    around = _noted.get()
    works = [Work(**result[WORK]) for result in results if WORK in result]
    if around is not None and works:
        around.append(load_of(what, works))
