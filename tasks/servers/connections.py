"""Bounds on connections: how long a server waits for a request, and how many connections it keeps.

Uvicorn waits for ever for the headers of a first request. It can only bound the number of all connections,
and then a few silent ones make it answer everybody else with 503. Here a connection that does not send whole
headers in time is closed. If there are too many connections, some are closed to make room: first those that
never sent a request, then those between two requests, then those that are still sending or reading; within
each group those that have been in that state longest. A connection whose request is being answered is never
closed.
"""

from __future__ import annotations

import math
import resource
from asyncio import TimerHandle, Transport
from typing import Any, Final

from uvicorn.protocols.http.h11_impl import H11Protocol

MOST: Final = 2_000  # connections of a process, some 30 MB; with fewer, clients that are closed come again
SHARE: Final = 10  # a tenth is closed at once, since choosing one costs as much as accepting one
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
    """A connection that is closed if its request is overdue, or to make room for others."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._timer: TimerHandle | None = None  # runs while the headers of a request are awaited
        self._unread = math.inf  # bytes of the last answer that were unread at the last look
        self._since = self.loop.time()  # when the present state began

    def connection_made(self, transport: Transport) -> None:  # type: ignore[override]  # as in Uvicorn
        """Wait for a request; if there are too many connections now, close some."""
        super().connection_made(transport)
        self._watch()
        if len(self.connections) > min(MOST, files_allowed() // 2):
            self._make_room()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop waiting."""
        self._forget()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Stop waiting if this completes the headers of a request."""
        super().data_received(data)
        self._watch()

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        super().on_response_complete()
        self._watch()

    def _watch(self) -> None:
        cycle: Any = self.cycle  # None before the first request, though Uvicorn's type does not say so
        answered = cycle is None or cycle.response_complete
        if not answered or self.transport.get_protocol() is not self:  # a WebSocket has its own protocol
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
        """Close the connection, unless the client is still reading the last answer."""
        last_unread, self._unread = self._unread, self.transport.get_write_buffer_size()
        if 0 < self._unread < last_unread:
            self._wait(IDLE_SECONDS)
        else:
            self.transport.abort()

    def _rank(self) -> int | None:
        """The order in which connections are closed, lowest first; None if this one must not be closed."""
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
