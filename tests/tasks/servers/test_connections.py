"""Connections that owe a request: closed in time, and never so many that nobody else is let in."""

from __future__ import annotations

import asyncio
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

import httpx
import pytest
from uvicorn import Server

from tasks.servers import connections
from tasks.servers.listening import bound, config_of

MOST = 60
SILENT = 300
SHORT = 0.5  # seconds
PATIENCE = 60.0  # seconds, of a busy machine
TRIES = 5  # for what a machine that stalls makes late
Address = tuple[str, int]
sent: list[bytes] = []  # answers to /parts that the application has finished


async def app(scope: Any, receive: Any, send: Any) -> None:
    """Answer with what was sent: /slow in a while, /rude without reading it, /large in megabytes.

    /parts sends megabytes bit by bit, and /sent says whether that has ended.
    """
    if scope["type"] != "http":
        return
    if scope["path"] == "/parts":
        await send({"type": "http.response.start", "status": 200, "headers": []})
        for _ in range(50):
            await send({"type": "http.response.body", "body": bytes(100_000), "more_body": True})
        sent.append(b"all")
        await send({"type": "http.response.body"})
        return
    body, more = b"", scope["path"] != "/rude"
    while more:
        message = await receive()
        body += message.get("body", b"")
        more = message.get("more_body", False)
    body *= 10_000_000 if scope["path"] == "/large" else 1
    body = sent.pop() if scope["path"] == "/sent" and sent else body
    if scope["path"] == "/slow":
        await asyncio.sleep(3 * SHORT)
    headers = [(b"content-length", str(len(body)).encode())]
    await send({"type": "http.response.start", "status": 200, "headers": headers})
    await send({"type": "http.response.body", "body": body})


@contextmanager
def serving() -> Iterator[Address]:
    with bound("127.0.0.1", 0) as place:
        server = Server(config_of(lambda: app))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [place]})
        thread.start()
        while not server.started:
            time.sleep(0.01)
        try:
            yield place.getsockname()
        finally:
            server.should_exit = True
            thread.join()


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> Iterator[Address]:
    """A server of few connections that waits longer than any test."""
    monkeypatch.setattr(connections, "MOST", MOST)
    for name in ("HEADER_SECONDS", "IDLE_SECONDS"):
        monkeypatch.setattr(connections, name, 300.0)
    with serving() as address:
        yield address


@pytest.fixture
def hurried(monkeypatch: pytest.MonkeyPatch) -> Iterator[Address]:
    """A server that waits for half a second."""
    for name in ("HEADER_SECONDS", "IDLE_SECONDS"):
        monkeypatch.setattr(connections, name, SHORT)
    with serving() as address:
        yield address


def is_open(connection: socket.socket) -> bool:
    connection.setblocking(False)
    try:
        return connection.recv(1, socket.MSG_PEEK) != b""
    except BlockingIOError:
        return True
    except ConnectionError:
        return False
    finally:
        connection.settimeout(PATIENCE)


def is_closed(connection: socket.socket, dribble: bytes = b"") -> bool:
    """Whether a connection is closed in time, while some more comes over it."""
    end = time.monotonic() + PATIENCE
    while is_open(connection) and time.monotonic() < end:
        if dribble:
            try:
                connection.sendall(dribble)
            except ConnectionError:
                return True
        time.sleep(0.05)
    return not is_open(connection)


def test_requests_are_answered_among_any_number_of_silent_connections(patient: Address) -> None:
    url = "http://{}:{}/".format(*patient)
    with ExitStack() as stack, httpx.Client() as client:
        for number in range(SILENT):
            stack.enter_context(socket.create_connection(patient))
            if number % 10 == 0:
                assert client.post(url, content=b"again").content == b"again"
                assert httpx.post(url, content=b"new").content == b"new"


def test_who_was_silent_longest_makes_room_and_who_is_answered_does_not(patient: Address) -> None:
    with ExitStack() as stack:
        asked, kept = (stack.enter_context(socket.create_connection(patient)) for _ in range(2))
        kept.sendall(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n")
        assert kept.recv(12) == b"HTTP/1.1 200"
        asked.sendall(b"GET /slow HTTP/1.1\r\nHost: x\r\n\r\n")
        silent = [stack.enter_context(socket.create_connection(patient)) for _ in range(MOST)]
        assert is_closed(silent[0])
        assert is_open(silent[-1])
        assert is_open(kept)
        assert asked.recv(12) == b"HTTP/1.1 200"


def test_where_none_is_silent_the_one_that_asked_longest_ago_makes_room(patient: Address) -> None:
    with ExitStack() as stack:
        idle = []
        for _ in range(MOST + 1):
            idle.append(stack.enter_context(socket.create_connection(patient)))
            idle[-1].sendall(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n")
            assert idle[-1].recv(12) == b"HTTP/1.1 200"
        assert is_open(idle[-1])
        while idle[0].recv(1000):
            pass


@pytest.mark.parametrize(
    ("first", "dribble"),
    [
        (b"", b""),
        (b"GET / HTTP/1.1\r\nHost: x\r\n", b""),
        (b"GET / HTTP/1.1\r\nHost: x\r\n", b"x"),
    ],
    ids=["silent", "half a header", "a header byte by byte"],
)
def test_a_request_that_does_not_come_is_not_waited_for(
    hurried: Address, first: bytes, dribble: bytes
) -> None:
    began = time.monotonic()
    with socket.create_connection(hurried) as connection:
        connection.sendall(first)
        assert is_closed(connection, dribble)
    assert time.monotonic() - began > 0.5 * SHORT


@pytest.mark.parametrize("path", [b"/", b"/rude"])
def test_a_second_request_that_does_not_come_is_not_waited_for(hurried: Address, path: bytes) -> None:
    length = 10**6 if path == b"/rude" else 0
    for _ in range(TRIES):
        with suppress(ConnectionError), socket.create_connection(hurried) as connection:
            connection.sendall(b"POST %b HTTP/1.1\r\nHost: x\r\nContent-Length: %d\r\n\r\n" % (path, length))
            answer = b""
            while not answer.endswith(b"\r\n\r\n") and (more := connection.recv(1000)):
                answer += more
            if answer.endswith(b"\r\n\r\n"):
                assert is_closed(connection, b"x")
                return
    pytest.fail("the first request was never answered")


def test_who_sends_half_a_request_makes_room_after_the_silent(patient: Address) -> None:
    url = "http://{}:{}/".format(*patient)
    with ExitStack() as stack:
        for number in range(SILENT):
            half = stack.enter_context(socket.create_connection(patient))
            half.sendall(b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 9\r\n\r\n1")
            if number % 10 == 0:
                assert httpx.post(url, content=b"new").content == b"new"


def bytes_read(address: Address, wait_before: float, wait_between: float) -> int:
    """How much of a large answer comes to a reader who takes its time."""
    read = 0
    with suppress(ConnectionError), socket.create_connection(address) as connection:
        connection.sendall(b"POST /large HTTP/1.1\r\nHost: x\r\nContent-Length: 1\r\n\r\n1")
        time.sleep(wait_before)
        while read < 10_000_000 and (more := len(connection.recv(400_000))):
            read += more
            time.sleep(wait_between)
    return read


def test_an_answer_is_not_cut_off_while_it_is_read(hurried: Address) -> None:
    assert any(bytes_read(hurried, 0.0, 0.05) >= 10_000_000 for _ in range(TRIES))
    assert any(bytes_read(hurried, 5 * SHORT, 0.0) < 10_000_000 for _ in range(TRIES))


def test_answers_that_nobody_reads_do_not_pile_up(patient: Address, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "MOST_UNREAD", 50_000_000)
    ask = b"POST /large HTTP/1.1\r\nHost: x\r\nContent-Length: 1\r\n\r\n1"
    with ExitStack() as stack:
        readers = [stack.enter_context(socket.create_connection(patient)) for _ in range(20)]
        for reader in readers:
            reader.sendall(2 * ask)  # the second answer waits for the first one to be read
            assert reader.recv(12) == b"HTTP/1.1 200"
            assert len(httpx.post("http://{}:{}/large".format(*patient), content=b"1").content) == 10_000_000
        got = []
        for reader in readers:
            reader.settimeout(PATIENCE)
            size = 0
            with suppress(ConnectionError):
                while size < 20_000_000 and (more := len(reader.recv(1_000_000))):
                    size += more
            got.append(size)
        assert sum(size > 10_000_000 for size in got) <= 5
        assert got[-1] > 20_000_000 - 1_000


def test_slow_readers_keep_no_application_waiting(patient: Address) -> None:
    with socket.create_connection(patient) as reader:
        reader.sendall(b"GET /parts HTTP/1.1\r\nHost: x\r\n\r\n")
        assert reader.recv(12) == b"HTTP/1.1 200"
        end = time.monotonic() + PATIENCE
        while httpx.get("http://{}:{}/sent".format(*patient)).content != b"all":
            assert time.monotonic() < end


def test_a_request_that_takes_longer_to_answer_is_answered(hurried: Address) -> None:
    for _ in range(TRIES):  # on a busy machine the request itself may come too late
        with suppress(httpx.TransportError), httpx.Client(base_url="http://{}:{}".format(*hurried)) as client:
            answers = [client.post("/slow", content=b"late").content for _ in range(2)]
            assert answers == [b"late", b"late"]
            return
    pytest.fail("a server cut off its own answer, again and again")
