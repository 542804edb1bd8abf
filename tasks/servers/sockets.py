"""Websockets of Prefect's server: the server works for one only after it has sent the password.

Prefect accepts every websocket and takes the password from its first message. Until that arrives, which may
be never, the websocket occupies one of Prefect's few places for requests. Here, the first message is read
before Prefect knows about the websocket.
"""

from __future__ import annotations

import asyncio
import hmac
import json
from typing import Final

from starlette.types import ASGIApp, Message, Receive, Scope, Send

PROTOCOL: Final = "prefect"  # the subprotocol of clients that send the password in the first message
PROOF_SECONDS: Final = 5.0  # from the handshake to the password
MOST_UNPROVEN: Final = 100  # websockets; if there are more, the one that has waited longest is closed
_REFUSED: Final = {"type": "websocket.close", "code": 1008, "reason": "Invalid token"}


class Sockets:
    """Passes on to an ASGI application only websockets whose first message has the password."""

    def __init__(self, app: ASGIApp, secret: str) -> None:
        """Protect an application.

        Args:
            app: Prefect's server, or another one whose websockets begin in the same way.
            secret: the ``user:password`` that a first message must have as its ``token``.
        """
        self._app = app
        self._secret = secret.encode()
        self._waiting: dict[asyncio.Timeout, None] = {}  # of websockets without the password, oldest first

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on everything but websockets that do not prove the password; these are closed."""
        if scope["type"] != "websocket":
            await self._app(scope, receive, send)
            return
        seen = [await receive()]
        if PROTOCOL not in scope["subprotocols"]:
            await send(_REFUSED)
            return
        await send({"type": "websocket.accept", "subprotocol": PROTOCOL})
        first = await self._first_message(receive)
        if first["type"] == "websocket.disconnect":
            return
        if not self._is_proof(first):
            await send(_REFUSED)
            return
        seen.append(first)

        async def receive_again() -> Message:
            return seen.pop(0) if seen else await receive()

        async def send_once(message: Message) -> None:
            if message["type"] != "websocket.accept":
                await send(message)

        await self._app(scope, receive_again, send_once)

    async def _first_message(self, receive: Receive) -> Message:
        """The first message; an empty one if none arrives in time, or if others need the place."""
        try:
            async with asyncio.timeout(PROOF_SECONDS) as limit:
                self._waiting[limit] = None
                try:
                    self._make_room()
                    return await receive()
                finally:
                    self._waiting.pop(limit, None)
        except TimeoutError:
            return {"type": "websocket.receive"}

    def _make_room(self) -> None:
        while len(self._waiting) > MOST_UNPROVEN:
            oldest = next(iter(self._waiting))
            del self._waiting[oldest]
            if not oldest.expired():
                oldest.reschedule(0.0)  # long ago: it ends now

    def _is_proof(self, message: Message) -> bool:
        try:
            content = json.loads(message.get("text") or "")
        except (ValueError, RecursionError):
            return False
        token = content.get("token") if isinstance(content, dict) else None
        return isinstance(token, str) and hmac.compare_digest(token.encode("utf-8", "replace"), self._secret)
