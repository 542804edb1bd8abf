"""Bounds on connections: how long a server waits for a request, and how many connections it keeps.

Uvicorn waits for ever for the headers of a first request. It can only bound the number of all connections,
and then a few silent ones make it answer everybody else with 503. Here, a connection that does not send
complete headers in time is closed. If there are too many connections, some are closed to make room: first
those that never sent a request, then those between two requests, then those that are still sending or
reading; within each group, those that have been in that state longest. A connection whose request is being
answered is never closed for that reason.

Uvicorn also keeps all of an answer that its client does not read. Here, the unread answers of a process are
bounded: if they have too many bytes, the clients that have been reading longest are disconnected.
"""

from __future__ import annotations

import math
import resource
from asyncio import TimerHandle, Transport
from typing import Any, Final

from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

MOST: Final = 2_000  # connections of a process, about 30 MB; with fewer, closed clients reconnect
SHARE: Final = 10  # a tenth is closed at once, because choosing one costs as much as accepting one
HEADER_SECONDS: Final = 10.0  # for the headers of a first request
IDLE_SECONDS: Final = 30.0  # from an answer to the headers of the next request
MOST_UNREAD: Final = 256 << 20  # bytes of answers in a process
AHEAD: Final = 8 << 20  # bytes that an answer may be ahead of its reader; more than any of Prefect's pages
FIRST_MESSAGE: Final = 64 << 10  # bytes of a websocket's first message, which proves the password


def files_allowed() -> int:
    """How many files and connections this process may have open."""
    return resource.getrlimit(resource.RLIMIT_NOFILE)[0]


def backlog() -> int:
    """How many connections to accept at once, so that the bounds act before files run out."""
    return min(2_048, files_allowed() // 16)


def allow_files() -> None:
    """Let this process and those that it starts have enough files open for ``MOST`` connections."""
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(files_allowed(), min(2 * MOST, most)), most))


class TimedProtocol(H11Protocol):
    """A connection that is closed if its request is overdue, or to make room for others."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._timer: TimerHandle | None = None  # runs while waiting for the headers of a request
        self._unread = math.inf  # bytes of the last answer that were unread at the last look
        self._since = self.loop.time()  # when the current state began
        self._reading_since: float | None = None  # since when part of an answer has been unread

    def connection_made(self, transport: Transport) -> None:  # type: ignore[override]  # as in Uvicorn
        """Wait for a request; if there are now too many connections, close some."""
        super().connection_made(transport)
        transport.set_write_buffer_limits(high=AHEAD)  # slow readers do not keep the application waiting
        self._watch()
        if len(self.connections) > min(MOST, files_allowed() // 2):
            self._make_room()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop waiting."""
        self._forget()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Stop waiting if this completes the headers of a request."""
        if self.transport.get_write_buffer_size() == 0:
            self._reading_since = None
        super().data_received(data)
        self._watch()

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        super().on_response_complete()
        self._bound_unread()
        self._watch()

    def pause_writing(self) -> None:
        """Wait for the client to read; the application waits too."""
        super().pause_writing()
        self._bound_unread()
        self._watch()

    def resume_writing(self) -> None:
        """Stop waiting, unless the next request is awaited."""
        super().resume_writing()
        self._watch()

    def _watch(self) -> None:
        cycle: Any = self.cycle  # None before the first request, though Uvicorn's type does not say so
        waiting = cycle is None or cycle.response_complete or self.flow.write_paused
        if not waiting or self.transport.get_protocol() is not self:  # a WebSocket has its own protocol
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

    def rank(self) -> tuple[int, float] | None:
        """The order in which connections are closed, lowest first; None if this one must not be closed."""
        group = self._group()
        return None if group is None else (group, self._since)

    def _group(self) -> int | None:
        cycle: Any = self.cycle
        if cycle is None:
            return 0
        if cycle.response_complete:
            return 1 if self.transport.get_write_buffer_size() == 0 else 2
        return 2 if cycle.more_body or self.flow.write_paused else None

    def _make_room(self) -> None:
        others = [each for each in self.connections if isinstance(each, TimedProtocol | TimedSocket)]
        ranked = [(rank, each) for each in others if each is not self and (rank := each.rank()) is not None]
        ranked.sort(key=lambda entry: entry[0])
        for each in [each for _, each in ranked[: MOST // SHARE]] or [self]:
            self.connections.discard(each)
            each.transport.abort()

    def _bound_unread(self) -> None:
        """Note that the client has something to read; if all together have too much, disconnect some."""
        if self.transport.get_write_buffer_size() == 0:
            return
        if self._reading_since is None:
            self._reading_since = self.loop.time()
        readers = [each for each in self.connections if isinstance(each, TimedProtocol)]
        unread = sum(each.transport.get_write_buffer_size() for each in readers)
        if unread <= MOST_UNREAD:
            return
        readers.sort(key=lambda each: math.inf if each._reading_since is None else each._reading_since)
        for each in readers:
            size = each.transport.get_write_buffer_size()
            if size and each is not self:
                unread -= size
                each.transport.abort()
            if unread <= MOST_UNREAD - MOST_UNREAD // SHARE:
                return


class TimedSocket(WebSocketsSansIOProtocol):
    """A websocket whose first message is short, and that makes room for others while it opens or closes."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.conn.max_message_size = FIRST_MESSAGE
        self._since = self.loop.time()

    def send_receive_event_to_app(self) -> None:
        """Pass on a message; the next ones may be longer."""
        super().send_receive_event_to_app()
        self.conn.max_message_size = self.config.ws_max_size

    def pause_writing(self) -> None:
        """Close the connection if the client proves nothing, sends pings, and reads no reply."""
        super().pause_writing()
        if self.close_sent or self.conn.max_message_size == FIRST_MESSAGE:
            self.transport.abort()

    def rank(self) -> tuple[int, float] | None:
        """Like ``TimedProtocol.rank``: an open websocket must not be closed."""
        return (0, self._since) if self.close_sent or not self.handshake_complete else None
