"""A user who waits for a plan is told that the work goes on."""

from __future__ import annotations

import logging
import time

import pytest

from tasks.requests import waiting
from tasks.requests.waiting import told_meanwhile


def test_what_takes_long_is_told_again_and_again_and_nothing_afterwards(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(waiting, "FIRST_S", 0.02)
    monkeypatch.setattr(waiting, "EVERY_S", 0.02)
    with caplog.at_level(logging.INFO), told_meanwhile("planning"):
        time.sleep(0.5)
    told = len(caplog.records)
    assert told >= 2
    time.sleep(0.1)
    assert len(caplog.records) == told


def test_what_is_soon_done_is_not_told_nor_is_a_failure_kept_waiting(
    caplog: pytest.LogCaptureFixture,
) -> None:
    began = time.monotonic()
    with caplog.at_level(logging.INFO), pytest.raises(KeyboardInterrupt), told_meanwhile("planning"):
        raise KeyboardInterrupt
    assert time.monotonic() - began < 1.0
    assert caplog.records == []
