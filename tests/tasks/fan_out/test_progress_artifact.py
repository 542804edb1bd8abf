"""Progress in Prefect: it only grows, ends at 100 %, and nothing depends on it."""

from __future__ import annotations

import pytest
from prefect import artifacts

from tasks.fan_out import progress_artifact as task
from tasks.fan_out.progress_artifact import progress_artifact


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    shares: list[float] = []
    monkeypatch.setattr(task, "EVERY_SECONDS", 0.0)
    monkeypatch.setattr(artifacts, "create_progress_artifact", lambda share, *_: shares.append(share) or "id")
    monkeypatch.setattr(artifacts, "update_progress_artifact", lambda _, share: shares.append(share))
    return shares


def test_progress_grows_and_ends_at_a_hundred(told: list[float]) -> None:
    shown: list[int] = []
    with progress_artifact("hallucinate", 8, shown.append) as show:
        for done in (0, 2, 2, 6):
            show(done)
    assert told == [0.0, 25.0, 25.0, 75.0, 100.0]
    assert shown == [0, 2, 2, 6, 8]


def test_what_is_soon_over_has_no_artifact(told: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(task, "EVERY_SECONDS", 60.0)
    with progress_artifact("train", 3, lambda _: None) as show:
        show(3)
    assert told == []


def test_without_prefect_the_work_goes_on(told: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(*_: object) -> None:
        raise OSError("no server")

    monkeypatch.setattr(artifacts, "create_progress_artifact", gone)
    shown: list[int] = []
    with progress_artifact("train", 2, shown.append) as show:
        show(1)
        show(2)
    assert (shown, told) == ([1, 2], [])
