"""Websockets: who does not prove the password soon is closed, and keeps nobody else from being answered."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from typing import Any

import httpx
import pytest
from starlette.applications import Starlette
from starlette.responses import PlainTextResponse
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket
from uvicorn import Server
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from tasks.servers import sockets
from tasks.servers.connections import FIRST_MESSAGE
from tasks.servers.listening import bound, config_of
from tasks.servers.sockets import Sockets
from tests.own_loop import run

SECRET = "robot:s3cret-of-the-fleet"
PROOF = json.dumps({"type": "auth", "token": SECRET})
SLOTS = 3  # requests and websockets that the application works for at once
SHORT = 0.3  # seconds
PATIENCE = 60.0  # seconds, of a busy machine
TRIES = 5  # for what a machine that stalls makes late


async def echo(socket: WebSocket) -> None:
    """Accept as Prefect does, and then send everything back."""
    await socket.accept(subprotocol="prefect")
    assert (await socket.receive_json())["token"] == SECRET
    await socket.send_json({"type": "auth_success"})
    async for message in socket.iter_text():
        await socket.send_text(message)


async def health(_: Any) -> PlainTextResponse:
    return PlainTextResponse("healthy")


class Narrow:
    """Let few requests and websockets in at once, like Prefect's server on SQLite."""

    def __init__(self, app: Any) -> None:
        self.app, self.slots = app, asyncio.Semaphore(SLOTS)

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        async with self.slots:
            await self.app(scope, receive, send)


@asynccontextmanager
async def serving() -> AsyncIterator[str]:
    app = Narrow(Starlette(routes=[Route("/health", health), WebSocketRoute("/in", echo)]))
    with bound("127.0.0.1", 0) as place:
        config = config_of(lambda: Sockets(app, SECRET))
        config.lifespan = "off"
        server = Server(config)
        running = asyncio.create_task(server.serve(sockets=[place]))
        while not server.started:
            await asyncio.sleep(0.01)
        try:
            yield f"127.0.0.1:{place.getsockname()[1]}"
        finally:
            server.should_exit = True
            await running


def opened(address: str) -> connect:
    return connect(f"ws://{address}/in", subprotocols=["prefect"], proxy=None)  # type: ignore[list-item]


async def is_answered(address: str) -> bool:
    """Whether a request and a websocket with the password are answered."""
    async with httpx.AsyncClient(trust_env=False, timeout=PATIENCE) as client:
        answer = await client.get(f"http://{address}/health")
    async with opened(address) as socket:
        await socket.send(PROOF)
        told = [await socket.recv()]
        await socket.send("x" * 10 * FIRST_MESSAGE)
        told.append(await socket.recv())
    return answer.text == "healthy" and "auth_success" in str(told[0]) and len(told[1]) == 10 * FIRST_MESSAGE


async def closing_code(socket: ClientConnection) -> int | None:
    with pytest.raises(ConnectionClosed):
        await asyncio.wait_for(socket.recv(), PATIENCE)
    return socket.close_code


def test_others_are_answered_whoever_holds_websockets_without_a_password(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sockets, "PROOF_SECONDS", 300.0)
    monkeypatch.setattr(sockets, "MOST_UNPROVEN", 20)

    async def hold() -> None:
        async with serving() as address, AsyncExitStack() as stack:
            held = [await stack.enter_async_context(opened(address)) for _ in range(50)]
            assert await is_answered(address)
            assert await closing_code(held[0]) == 1008  # it made room
            await held[-1].send(PROOF)
            assert "auth_success" in str(await held[-1].recv())

    run(hold())


def test_a_websocket_that_proves_nothing_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sockets, "PROOF_SECONDS", SHORT)

    async def stays(address: str) -> bool:
        with suppress(ConnectionClosed):  # the proof came too late
            async with opened(address) as proven:
                await proven.send(PROOF)
                await asyncio.sleep(3 * SHORT)
                await proven.send("still here")
                return [await proven.recv(), await proven.recv()][1] == "still here"
        return False

    async def wait() -> None:
        async with serving() as address:
            async with opened(address) as silent:
                assert await closing_code(silent) == 1008
            for _ in range(TRIES):
                if await stays(address):
                    return
            pytest.fail("a websocket with the password was closed")

    run(wait())


@pytest.mark.parametrize(
    ("first", "code"),
    [
        (json.dumps({"type": "auth", "token": "robot:wrong"}), 1008),
        (json.dumps({"type": "auth", "token": None}), 1008),
        (json.dumps([SECRET]), 1008),
        ("nonsense", 1008),
        ("[" * 20_000, 1008),
        (b"\xff", 1008),
        ("x" * 2 * FIRST_MESSAGE, 1009),
    ],
)
def test_what_is_no_proof_is_refused(first: str | bytes, code: int) -> None:
    async def send() -> None:
        async with serving() as address, opened(address) as socket:
            await socket.send(first)
            assert await closing_code(socket) == code

    run(send())
