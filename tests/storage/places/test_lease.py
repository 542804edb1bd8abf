"""A folder in object storage is held by one command at a time, and never by a dead one for long."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta, tzinfo
from email.utils import format_datetime
from pathlib import Path
from typing import Any

import pytest

from flows.cli.terminal import notices_shown
from storage.errors import InUseError
from storage.places import lease, objects
from storage.places.data_folder import open_data_folder
from storage.places.lease import leased
from storage.places.objects import Address
from tests.storage.object_storage import BUCKET, DATA, machine, object_storage

PLACE = Address(BUCKET, "folder/.lock")

pytestmark = pytest.mark.filterwarnings("ignore")  # of the server's libraries


@pytest.fixture
def storage() -> Iterator[Any]:
    with object_storage() as client:
        yield client


def test_a_second_command_is_told_who_holds_the_folder(storage: Any, tmp_path: Path) -> None:
    with machine(tmp_path / "one"):
        first = open_data_folder(DATA)
    with machine(tmp_path / "other"):
        second = open_data_folder(DATA)
    with machine(tmp_path / "one"), first.lock():
        with machine(tmp_path / "other"), pytest.raises(InUseError) as refused, second.lock():
            pass
        assert f"{DATA} is in use by another command (process " in str(refused.value)
    with machine(tmp_path / "other"), second.lock():
        pass


def test_who_comes_back_to_the_same_copy_need_not_wait(storage: Any) -> None:
    objects.put_if(PLACE, b'{"owner": "me", "holder": "process 1 on here"}', None)
    with pytest.raises(InUseError, match="process 1 on here"), leased(PLACE, "you", "it"):
        pass
    with leased(PLACE, "me", "it"):
        pass
    assert objects.head(PLACE) is None


def test_a_lease_that_was_not_renewed_is_taken_by_one_of_those_who_come(
    storage: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    objects.put_if(PLACE, b'{"owner": "dead"}', None)
    monkeypatch.setattr(lease, "LOST_SECONDS", -1.0)
    found = objects.head(PLACE)
    assert found is not None
    with leased(PLACE, "me", "it"):
        assert objects.put_if(PLACE, b'{"owner": "who looked when I did"}', found.etag) is None


@pytest.mark.parametrize("hours", [-1, 1])
def test_a_clock_here_that_is_set_takes_no_lease(
    storage: Any, hours: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def dated(parsed: dict[str, Any], **_: Any) -> None:  # as every server answers, but not a pretended one
        parsed["ResponseMetadata"]["HTTPHeaders"]["date"] = format_datetime(datetime.now(UTC), usegmt=True)

    class Set(datetime):
        @classmethod
        def now(cls, tz: tzinfo | None = None) -> datetime:
            return datetime.now(tz) + timedelta(hours=hours)

    objects.put_if(PLACE, b'{"owner": "alive"}', None)
    storage.meta.events.register("after-call.s3.HeadObject", dated)
    monkeypatch.setattr(objects, "datetime", Set)
    with pytest.raises(InUseError), leased(PLACE, "me", "it"):
        pass


def test_a_lease_is_renewed_and_its_loss_ends_the_command(
    storage: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(lease, "RENEWED_SECONDS", 0.02)
    ended = threading.Event()
    signals: list[int] = []

    def kill(_process: int, number: int) -> None:
        signals.append(number)
        ended.set()

    monkeypatch.setattr(lease.os, "kill", kill)
    with notices_shown(), leased(PLACE, "me", "it"):
        assert not ended.wait(0.3)
        storage.put_object(Bucket=BUCKET, Key=PLACE.key, Body=b'{"owner": "other"}')
        assert ended.wait(5.0)
    assert signals == [signal.SIGINT]
    assert "Another command took over" in capsys.readouterr().err
    assert objects.head(PLACE) is not None  # the other's


def test_an_answer_that_was_lost_is_not_taken_for_another_command(
    storage: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lease, "RENEWED_SECONDS", 0.02)
    put_if = objects.put_if
    calls = threading.Event()
    given_up: list[object] = []

    def twice(place: Address, body: bytes, etag: str | None) -> str | None:
        put_if(place, body, etag)
        calls.set()
        return None  # as if the first answer was lost, and the attempt after it met what the first had put

    with leased(PLACE, "me", "it"):
        monkeypatch.setattr(objects, "put_if", twice)
        monkeypatch.setattr(lease.os, "kill", lambda *told: given_up.append(told))
        assert calls.wait(5.0)
        monkeypatch.setattr(objects, "put_if", put_if)
    assert not given_up
    assert objects.head(PLACE) is None
