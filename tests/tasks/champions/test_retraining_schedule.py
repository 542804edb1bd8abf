"""What a schedule does about runs that Prefect believes at work, though nobody is."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, Self

import pytest
from prefect.client.schemas.objects import StateType

from tasks.champions import retraining_schedule


class _Client:
    """Prefect's client, with a run of this data folder and one of another."""

    def __init__(self) -> None:
        self.ended: dict[str, Any] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def read_flow_runs(self, **_: object) -> list[Any]:
        return [SimpleNamespace(id=name, parameters={"data": name}) for name in ("ours", "theirs")]

    def set_flow_run_state(self, run: str, state: Any) -> None:
        self.ended[run] = state


def test_runs_that_were_killed_are_ended_and_those_of_other_folders_are_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    client = _Client()
    monkeypatch.setattr("prefect.client.orchestration.get_client", lambda **_: client)
    retraining_schedule._end_killed("scheduled", "ours")
    assert {run: state.type for run, state in client.ended.items()} == {"ours": StateType.CRASHED}
