"""Connections that owe a request: how long a server waits for it, and how many of them it bears.

Uvicorn waits for ever for the headers of a first request, and can only bound all connections together: then
some silent ones have everybody else answered 503. Here whoever does not send whole headers in time is closed.
Where connections are too many, some make room, first those that never asked, then those that asked before,
then those that are still sending or reading; always those that have been at it longest. A connection whose
request is being answered never makes room.
"""

from __future__ import annotations

import math
import resource
from asyncio import TimerHandle, Transport
from typing import Any, Final

from uvicorn.protocols.http.h11_impl import H11Protocol

MOST: Final = 2_000  # connections of a process, some 30 MB; whoever is closed comes again, which costs more
SHARE: Final = 10  # one of so many makes room at once: to look for it costs as much as to accept
HEADER_SECONDS: Final = 10.0  # for the headers of a first request
IDLE_SECONDS: Final = 30.0  # from an answer to the headers of the next request


def files_allowed() -> int:
    """How many files and connections this process may have open."""
    return resource.getrlimit(resource.RLIMIT_NOFILE)[0]


def allow_files() -> None:
    """Let this process and those that it starts have enough files open for ``MOST`` connections."""
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(files_allowed(), min(2 * MOST, most)), most))


class TimedProtocol(H11Protocol):
    """A connection that is closed if it owes a request for too long, or longest of too many."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._timer: TimerHandle | None = None  # runs while it owes the headers of a request
        self._unread = math.inf  # bytes of the answer before, when it was last looked at
        self._since = self.loop.time()

    def connection_made(self, transport: Transport) -> None:  # type: ignore[override]  # as Uvicorn's own
        """Wait for a request; if connections are too many now, have some make room."""
        super().connection_made(transport)
        self._watch()
        if len(self.connections) > min(MOST, files_allowed() // 2):
            self._make_room()

    def connection_lost(self, exc: Exception | None) -> None:
        """Wait no longer."""
        self._forget()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Go on waiting unless this completes the headers of a request."""
        super().data_received(data)
        self._watch()

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        super().on_response_complete()
        self._watch()

    def _watch(self) -> None:
        cycle: Any = self.cycle  # which Uvicorn's type does not say to be None at first
        answered = cycle is None or cycle.response_complete
        if not answered or self.transport.get_protocol() is not self:  # which a WebSocket has of its own
            self._forget()
        elif self._timer is None:
            self._wait(HEADER_SECONDS if cycle is None else IDLE_SECONDS)

    def _wait(self, seconds: float) -> None:
        self._since = self.loop.time()
        self._timer = self.loop.call_later(seconds, self._expire)

    def _forget(self) -> None:
        if self._timer is not None:
            self._since = self.loop.time()
            self._unread = math.inf
            self._timer.cancel()
            self._timer = None

    def _expire(self) -> None:
        """Close it, unless the answer before is still being read."""
        before, self._unread = self._unread, self.transport.get_write_buffer_size()
        if 0 < self._unread < before:
            self._wait(IDLE_SECONDS)
        else:
            self.transport.abort()

    def _rank(self) -> int | None:
        """How soon it makes room, the lower the sooner; None: never."""
        cycle: Any = self.cycle
        if cycle is None:
            return 0
        if cycle.response_complete:
            return 1 if self.transport.get_write_buffer_size() == 0 else 2
        return 2 if cycle.more_body else None

    def _make_room(self) -> None:
        others = [each for each in self.connections if isinstance(each, TimedProtocol) and each is not self]
        ranked = [(rank, each._since, each) for each in others if (rank := each._rank()) is not None]
        ranked.sort(key=lambda entry: entry[:2])
        for each in [each for _, _, each in ranked[: MOST // SHARE]] or [self]:
            self.connections.discard(each)
            each.transport.abort()
