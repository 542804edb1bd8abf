"""Refuse requests that name another host, that come from pages of other sites, or that lack the password."""

from __future__ import annotations

import base64
import hmac
import ipaddress
from collections.abc import Collection
from typing import Final

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

OPEN: Final = ("/ping", "/health")  # anybody may know that a server is alive
# Headers of each answer: other sites can neither read it nor show it in a frame, and its page contacts no
# other site (Prefect's would request settings from one whenever it is opened).
_ADDED: Final = {
    "Content-Security-Policy": "connect-src 'self'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "SAMEORIGIN",
}
_SHARED: Final = "access-control-"  # headers that let other sites read answers (CORS)


class Guard:
    """Protects an ASGI application from pages of other sites, and from users without the password.

    A web page can make the browser send requests to any address, including loopback. Two headers reveal such
    a request, and the page cannot choose them: Origin is the address of the page, and Host is the name of the
    server that the page contacted. A Host that is not ours means DNS rebinding: the name of the page's site
    was made to point at this machine.
    """

    def __init__(
        self,
        app: ASGIApp,
        secret: str | None = None,
        names: Collection[str] = (),
        closed: Collection[str] = (),
    ) -> None:
        """Guard an ASGI application.

        Args:
            app: the application to protect.
            secret: the ``user:password`` to ask for (HTTP Basic); None asks for none.
            names: names by which clients may call the server, besides its address.
            closed: paths that are answered for nobody.
        """
        self._app = app
        self._credentials = None if secret is None else base64.b64encode(secret.encode())
        self._names = {_address(name) for name in names}
        self._closed = frozenset(closed)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on a request or a websocket, or refuse it with one line."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        refusal = self._refusal(scope)
        if refusal is None:
            await self._app(scope, receive, _closed(send))
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        else:
            await refusal(scope, receive, _closed(send))

    def _refusal(self, scope: Scope) -> Response | None:
        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        if len(hosts) != 1 or not self._is_own(hosts[0], scope):
            why = "Use this server's own address, or start it with the name in MOTION_MEMORY_HOSTS."
            return _refusing(400, "BAD_REQUEST", why)
        own_pages = (f"http://{hosts[0]}", f"https://{hosts[0]}")
        if any(origin not in own_pages for origin in headers.getlist("origin")):
            return _refusing(403, "PERMISSION_DENIED", "Pages of other sites may not use this server.")
        if not self._is_authorized(scope, headers):
            refusal = _refusing(401, "UNAUTHENTICATED", "Give user and password (HTTP Basic).")
            refusal.headers["WWW-Authenticate"] = 'Basic realm="motion-memory"'
            return refusal
        if scope["path"].rstrip("/") in self._closed:
            return _refusing(404, "NOT_FOUND", "This server has no such page.")
        return None

    def _is_own(self, host: str, scope: Scope) -> bool:
        """Whether a Host header names the address that was connected to, or one of the server's names."""
        name, colon, port = host.rpartition(":")
        requested = _address(name if colon and port.isdigit() else host)
        server = _address((scope.get("server") or ("",))[0])
        if requested in self._names or requested == server:
            return True
        return _is_loopback(server) and (requested == "localhost" or _is_loopback(requested))

    def _is_authorized(self, scope: Scope, headers: Headers) -> bool:
        if self._credentials is None or (scope["path"] in OPEN and scope.get("method") == "GET"):
            return True
        values = headers.getlist("authorization")
        scheme, _, credentials = (values[0] if len(values) == 1 else "").partition(" ")
        return scheme.lower() == "basic" and hmac.compare_digest(
            credentials.strip().encode("latin-1"), self._credentials
        )


Address = ipaddress.IPv4Address | ipaddress.IPv6Address


def _address(name: str) -> Address | str:
    """The IP address that a name stands for in any notation, or else the name in lower case."""
    try:
        address = ipaddress.ip_address(name.removeprefix("[").removesuffix("]"))
    except ValueError:
        return name.lower()
    return getattr(address, "ipv4_mapped", None) or address


def _is_loopback(address: Address | str) -> bool:
    return not isinstance(address, str) and address.is_loopback


def _refusing(status: int, code: str, message: str) -> Response:
    return JSONResponse({"error_code": code, "message": message}, status)


def _closed(send: Send) -> Send:
    """Wrap ``send`` so that answers have headers which keep pages of other sites from reading them."""

    async def send_closed(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name in {name for name in headers if name.startswith(_SHARED)}:
                del headers[name]
            for name, value in _ADDED.items():
                headers.setdefault(name, value)
        await send(message)

    return send_closed
