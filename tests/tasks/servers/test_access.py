"""Closed by default: nobody from elsewhere without the password, and no server for them without one."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest
from starlette.applications import Starlette
from starlette.responses import PlainTextResponse
from starlette.routing import Route

from flows.cli.main import call
from tasks.servers.access import AUTH, Guarded, auth_environment, check_address
from tasks.servers.prefect_server import set_environment
from tasks.settings.run_settings import UsageError
from tests.tasks.asgi import Client

SECRET = "robot:s3cret-of-the-fleet"


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "::1", "127.8.9.1"])
def test_loopback_needs_no_password(host: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(AUTH, raising=False)
    check_address(host)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.7", "2001:db8::1"])
def test_an_address_that_others_reach_needs_one(host: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(AUTH, raising=False)
    with pytest.raises(UsageError, match=f"set {AUTH}=user:password, or listen on 127.0.0.1"):
        check_address(host)
    monkeypatch.setenv(AUTH, SECRET)
    check_address(host)


@pytest.mark.parametrize("command", [["serve-memory", "memory"], ["servers"]])
def test_commands_refuse_it_in_one_line_and_write_nothing(
    command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv(AUTH, raising=False)
    assert call([*command, "--host", "0.0.0.0"]) == 2
    told = capsys.readouterr()
    assert told.err.count("\n") == 1
    assert AUTH in told.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("value", ["s3cret", ":s3cret", "s3cret:", "user:s3\ncret", "usér:s3cret"])
def test_a_malformed_password_is_refused_without_being_shown(
    value: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(AUTH, value)
    with pytest.raises(UsageError, match="not to user:password") as error:
        auth_environment()
    assert "s3" not in str(error.value)


def test_what_is_no_address_is_refused_with_and_without_a_password(monkeypatch: pytest.MonkeyPatch) -> None:
    for secret in ("", SECRET):
        monkeypatch.setenv(AUTH, secret)
        with pytest.raises(UsageError, match="No address is known of"):
            check_address("")


def test_one_setting_is_that_of_prefect_and_mlflow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    environment = {AUTH: SECRET}
    monkeypatch.setattr("os.environ", environment)
    set_environment(tmp_path)
    for name in ("PREFECT_SERVER_API_AUTH_STRING", "PREFECT_API_AUTH_STRING"):
        assert environment[name] == SECRET
    assert environment["MLFLOW_TRACKING_USERNAME"] == "robot"
    assert environment["MLFLOW_TRACKING_PASSWORD"] == "s3cret-of-the-fleet"


def client(secret: str | None) -> Client:
    async def answer(_: Any) -> PlainTextResponse:
        return PlainTextResponse("inside")

    return Client(Guarded(Starlette(routes=[Route("/{path:path}", answer, methods=["GET", "POST"])]), secret))


def test_only_who_knows_the_password_is_let_in() -> None:
    guarded = client(SECRET)
    user, _, password = SECRET.partition(":")
    assert guarded.get("/x", auth=(user, password)).text == "inside"
    assert guarded.post("/x", auth=(user, password)).text == "inside"
    for wrong in [None, (user, ""), ("", password), (user, password + "x"), (user, password[:-1])]:
        answer = guarded.get("/x", auth=wrong)
        assert answer.status_code == 401
        assert answer.headers["www-authenticate"].startswith("Basic")
        assert "inside" not in answer.text
    for header in ("", "Basic", "Basic ", f"Bearer {SECRET}", f"Basic {SECRET}", "Basic \xff"):
        assert guarded.get("/x", headers={"Authorization": header.encode("latin-1")}).status_code == 401


def test_whether_it_lives_is_told_to_everybody_and_nothing_else_is() -> None:
    guarded = client(SECRET)
    assert guarded.get("/ping").text == guarded.get("/health").text == "inside"
    for path in ("/ping/", "/x/health", "/PING", "/ping%2f", "/ping;x"):
        assert guarded.get(path).status_code == 401
    assert guarded.post("/ping").status_code == 401


def test_a_websocket_is_closed_to_who_does_not_know_the_password() -> None:
    sent = []

    async def send(message: Any) -> None:
        sent.append(message)

    scope = {"type": "websocket", "path": "/ping", "headers": []}
    asyncio.run(Guarded(Starlette(), SECRET)(scope, None, send))  # type: ignore[arg-type]
    assert sent == [{"type": "websocket.close", "code": 1008}]


def test_without_a_password_all_are_let_in() -> None:
    assert client(None).get("/x").text == "inside"
