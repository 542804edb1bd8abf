"""The guard: pages of other sites reach nothing, whatever they send; nor does who lacks the password."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import httpx
import pytest
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.cors import CORSMiddleware
from starlette.responses import PlainTextResponse
from starlette.routing import Route

from tasks.servers.guard import Guard
from tests.own_loop import run
from tests.tasks.servers.attacks import EVIL

SECRET = "robot:s3cret-of-the-fleet"
METHODS = ["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"]


def request(
    method: str,
    path: str,
    *,
    secret: str | None = None,
    names: Collection[str] = (),
    closed: Collection[str] = (),
    at: str = "127.0.0.1:4200",
    **options: Any,
) -> httpx.Response:
    """Ask a guarded server that listens at an address and lets pages of all sites in."""

    async def inside(_: Any) -> PlainTextResponse:
        return PlainTextResponse("inside")

    everybody = Middleware(CORSMiddleware, allow_origins=["*"], allow_methods=["*"], allow_headers=["*"])
    app = Starlette(routes=[Route("/{path:path}", inside, methods=METHODS)], middleware=[everybody])

    async def ask() -> httpx.Response:
        transport = httpx.ASGITransport(Guard(app, secret, names, closed))
        async with httpx.AsyncClient(transport=transport, base_url=f"http://{at}") as client:
            return await client.request(method, path, **options)

    return run(ask())


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": EVIL},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:8888"},
        {"Origin": "http://127.0.0.1"},
        {"Origin": "http://127.0.0.1:4200.evil.example"},
        {"Origin": "http://localhost:4200"},
        {"Origin": EVIL, "Access-Control-Request-Method": "PATCH"},
        {"Origin": f"{EVIL}:4200", "Host": "evil.example:4200"},
        {"Host": "evil.example"},
        {"Host": "127.0.0.1.evil.example"},
        {"Host": "evil.example@127.0.0.1"},
        {"Host": "127.0.0.1:4200:4200"},
        {"Host": "192.168.0.7:4200"},
        {"Host": ""},
    ],
)
def test_a_page_of_another_site_is_refused(headers: dict[str, str]) -> None:
    for method in METHODS:
        answer = request(method, "/x", headers=headers)
        assert answer.status_code in (400, 403)
        assert "inside" not in answer.text
        assert not [name for name in answer.headers if name.startswith("access-control-")]


@pytest.mark.parametrize(
    ("at", "host"),
    [
        ("127.0.0.1:4200", "127.0.0.1:4200"),
        ("127.0.0.1:4200", "LOCALHOST:8765"),  # as through a tunnel of SSH
        ("127.0.0.1:4200", "[::1]:4200"),
        ("[::1]:4200", "[0:0:0:0:0:0:0:1]"),
        ("[::ffff:10.0.0.5]:80", "10.0.0.5"),
        ("10.0.0.5:4200", "10.0.0.5:4200"),
        ("10.0.0.5:4200", "planner.lan:4200"),
        ("172.17.0.2:4200", "10.9.8.7:4200"),  # of a container
    ],
)
def test_the_servers_own_pages_reach_it_and_are_let_in_by_no_header_for_others(at: str, host: str) -> None:
    names = ("Planner.lan", "10.9.8.7")
    for origin in ({}, {"Origin": f"http://{host}"}, {"Origin": f"https://{host}"}):
        answer = request("POST", "/x", at=at, names=names, headers={"Host": host} | origin)
        assert answer.text == "inside"
        assert not [name for name in answer.headers if name.startswith("access-control-")]


def test_a_loopback_name_is_not_that_of_a_server_elsewhere() -> None:
    assert request("GET", "/x", at="10.0.0.5:4200", headers={"Host": "localhost:4200"}).status_code == 400


def test_only_who_knows_the_password_is_let_in() -> None:
    user, _, password = SECRET.partition(":")
    assert request("GET", "/x", secret=SECRET, auth=(user, password)).text == "inside"
    assert request("POST", "/x", secret=SECRET, auth=(user, password)).text == "inside"
    for wrong in [None, (user, ""), ("", password), (user, password + "x"), (user, password[:-1])]:
        answer = request("GET", "/x", secret=SECRET, auth=wrong)
        assert answer.status_code == 401
        assert answer.headers["www-authenticate"].startswith("Basic")
        assert "inside" not in answer.text
    for header in ("", "Basic", "Basic ", f"Bearer {SECRET}", f"Basic {SECRET}", "Basic \xff"):
        headers = {"Authorization": header.encode("latin-1")}
        assert request("GET", "/x", secret=SECRET, headers=headers).status_code == 401


def test_a_browser_that_has_the_password_does_not_lend_it_to_other_sites() -> None:
    user, _, password = SECRET.partition(":")
    answer = request("POST", "/x", secret=SECRET, auth=(user, password), headers={"Origin": EVIL})
    assert answer.status_code == 403


def test_whether_it_lives_is_told_to_everybody_and_nothing_else_is() -> None:
    assert request("GET", "/ping", secret=SECRET).text == "inside"
    assert request("GET", "/health", secret=SECRET).text == "inside"
    for path in ("/ping/", "/x/health", "/PING", "/ping%2f", "/ping;x"):
        assert request("GET", path, secret=SECRET).status_code == 401
    assert request("POST", "/ping", secret=SECRET).status_code == 401


@pytest.mark.parametrize(
    ("secret", "headers"),
    [
        (SECRET, {"host": "127.0.0.1"}),
        (None, {"host": "127.0.0.1", "origin": EVIL}),
        (None, {"host": "evil.example", "origin": EVIL}),
        (None, {}),
    ],
)
def test_a_websocket_is_closed_before_it_opens(secret: str | None, headers: dict[str, str]) -> None:
    sent = []

    async def send(message: Any) -> None:
        sent.append(message)

    fields = [(name.encode(), value.encode()) for name, value in headers.items()]
    scope = {"type": "websocket", "path": "/ping", "headers": fields, "server": ("127.0.0.1", 80)}
    run(Guard(Starlette(), secret)(scope, None, send))  # type: ignore[arg-type]
    assert sent == [{"type": "websocket.close", "code": 1008}]


def test_closed_paths_are_not_there_for_anybody() -> None:
    for path in ("/docs", "/docs/", "/%64ocs"):
        assert request("GET", path, closed=("/docs",)).status_code == 404
    assert request("GET", "/docs/x", closed=("/docs",)).text == "inside"
