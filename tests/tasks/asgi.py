"""An ASGI application asked in this process; what it raises is raised here."""

from __future__ import annotations

from typing import Any

import httpx

from tests.own_loop import run


class Client:
    """Asks one request after another."""

    def __init__(self, app: Any) -> None:
        self._transport = httpx.ASGITransport(app)

    def get(self, path: str, **asked: Any) -> httpx.Response:
        return run(self._ask("GET", path, **asked))

    def post(self, path: str, **asked: Any) -> httpx.Response:
        return run(self._ask("POST", path, **asked))

    async def _ask(self, method: str, path: str, **asked: Any) -> httpx.Response:
        async with httpx.AsyncClient(transport=self._transport, base_url="http://here") as client:
            return await client.request(method, path, **asked)
