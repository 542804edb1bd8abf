"""Closed by default: nobody from elsewhere without the password, and no server for them without one."""

from __future__ import annotations

import os
import stat
import subprocess
from pathlib import Path

import pytest

from flows.cli.main import call
from storage.places.data_folder import open_data_folder
from tasks.servers.access import AUTH, auth, auth_environment, check_address, new_secret
from tasks.servers.prefect_server import set_environment
from tasks.serving.shared_servers import password_set
from tasks.settings.errors import UsageError

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
    with pytest.raises(UsageError, match="must be user:password") as error:
        auth_environment()
    assert "s3" not in str(error.value)


def test_what_is_no_address_is_refused_with_and_without_a_password(monkeypatch: pytest.MonkeyPatch) -> None:
    for secret in ("", SECRET):
        monkeypatch.setenv(AUTH, secret)
        with pytest.raises(UsageError, match="has no address"):
            check_address("")


def test_one_setting_is_that_of_prefect_and_mlflow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    environment = {AUTH: SECRET}
    monkeypatch.setattr("os.environ", environment)
    set_environment(tmp_path)
    for name in ("PREFECT_SERVER_API_AUTH_STRING", "PREFECT_API_AUTH_STRING"):
        assert environment[name] == SECRET
    assert environment["MLFLOW_TRACKING_USERNAME"] == "robot"
    assert environment["MLFLOW_TRACKING_PASSWORD"] == "s3cret-of-the-fleet"


def test_a_password_that_is_made_is_the_owners_alone_and_another_each_time(tmp_path: Path) -> None:
    file = tmp_path / "secret"
    file.write_text("old")
    file.chmod(0o666)
    own = os.umask(0)
    try:
        made = {new_secret(file) for _ in range(3)}
    finally:
        os.umask(own)
    assert len(made) == 3
    assert file.read_text() in made
    assert stat.S_IMODE(file.stat().st_mode) == 0o600


def test_servers_without_the_setting_make_a_password_for_as_long_as_they_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = open_data_folder(tmp_path / "a data folder")
    monkeypatch.setattr("os.environ", {})
    with password_set(data) as told:
        same = [f'test "${name}" = "$(cat "$1")"' for name in (AUTH, "PREFECT_API_AUTH_STRING")]
        command = f"{told}; {' && '.join(same)}"
        file = data.path / "servers.auth"
        assert file.read_text() == os.environ[AUTH] == auth()
        assert subprocess.run(["sh", "-c", command, "sh", str(file)], check=True, env={"PATH": os.defpath})
    assert not file.exists()
