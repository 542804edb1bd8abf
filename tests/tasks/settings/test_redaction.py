from __future__ import annotations

import base64

import pytest

from tasks.settings.redaction import redacted

SECRET = "s3cret-of-the-fleet"


@pytest.mark.parametrize(
    "text",
    [
        f"MLflow at http://robot:{SECRET}@10.0.0.5:5000 cannot be used",
        f"postgresql+asyncpg://robot:{SECRET}@host/db",
        f"tcp://{SECRET}@host:8786",
        f"two: http://a:{SECRET}@x and https://b:{SECRET}@y/path?q=1",
    ],
)
def test_a_password_in_an_address_goes_and_the_rest_stays(text: str) -> None:
    shown = redacted(text)
    assert SECRET not in shown
    assert "***@" in shown
    assert shown.split("://")[0] == text.split("://")[0]
    assert shown.rpartition("@")[2] == text.rpartition("@")[2]


@pytest.mark.parametrize(
    "name",
    ["MOTION_MEMORY_AUTH", "PREFECT_API_AUTH_STRING", "MLFLOW_TRACKING_PASSWORD", "AWS_SECRET_ACCESS_KEY",
     "AWS_SESSION_TOKEN", "PREFECT_API_KEY"],
)  # fmt: skip
def test_a_secret_of_the_environment_goes_whole_in_part_and_encoded(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    value = f"robot:{SECRET}"
    monkeypatch.setenv(name, value)
    encoded = base64.b64encode(value.encode()).decode()
    shown = redacted(f"a {value} b {SECRET} c Basic {encoded} d")
    assert shown == "a *** b *** c Basic *** d"


def test_a_password_in_a_variable_that_holds_an_address_goes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"http://robot:{SECRET}@host")
    assert redacted(f"user robot with {SECRET} was refused") == "user robot with *** was refused"


@pytest.mark.parametrize("text", ["", "no secret", "a@b.c", "http://127.0.0.1:5000/x@y", "3 > 2"])
def test_what_is_not_secret_stays(text: str) -> None:
    assert redacted(text) == text
