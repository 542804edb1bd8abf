"""How flows that Prefect started end: what is expected is told in one line, what is not is raised."""

from __future__ import annotations

import logging

import pytest
from prefect.client.schemas.objects import State, StateType

from storage.errors import InUseError, StorageError
from tasks.session.ending import EXPECTED, SKIPPED, ended_in_one_line
from tasks.settings.errors import RunError, UsageError


def _ended(error: Exception) -> State[object]:
    @ended_in_one_line
    def body() -> None:
        raise error

    state = body()
    assert isinstance(state, State)
    return state


@pytest.mark.parametrize("kind", [UsageError, RunError, StorageError])
def test_an_expected_error_is_the_message_of_the_failure(
    kind: type[Exception], caplog: pytest.LogCaptureFixture
) -> None:
    state = _ended(kind("a.json is\nmissing; check the name."))
    assert (state.type, state.message) == (StateType.FAILED, "a.json is missing; check the name.")
    assert caplog.messages == ["motion-memory: a.json is missing; check the name."]


def test_a_missing_file_is_named() -> None:
    told = _ended(FileNotFoundError(2, "No such file or directory", "map.yaml")).message
    assert told == "map.yaml cannot be used: No such file or directory; check the path and who may use it."


def test_who_finds_the_data_folder_in_use_is_skipped_and_has_not_failed(
    caplog: pytest.LogCaptureFixture,
) -> None:
    state = _ended(InUseError("data is in use by another command."))
    assert (state.type, state.name, state.message) == (
        StateType.CANCELLED,
        SKIPPED,
        "data is in use by another command.",
    )
    assert all(record.levelno < logging.ERROR for record in caplog.records)
    assert "InUseError" not in caplog.text


def test_an_error_that_nobody_expected_is_raised_and_named(caplog: pytest.LogCaptureFixture) -> None:
    assert not issubclass(KeyError, EXPECTED)
    with pytest.raises(KeyError):
        _ended(KeyError("speed"))
    assert caplog.messages == ["motion-memory: KeyError: 'speed'"]


def test_whatever_comes_of_it_is_returned() -> None:
    assert ended_in_one_line(lambda count: count + 1)(1) == 2
