"""The fan-out: results in order, nothing done twice, killed workers replaced, failures in one line."""

from __future__ import annotations

import fcntl
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock, Mock

import dask
import pytest

from tasks.fan_out import fan_out
from tasks.settings.errors import RunError, UsageError
from tests.prepared.prefect_database import with_prefect_database

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> dict[str, Any]:
    """What ``odd_chunks.py`` prints; a process of its own, since Prefect reads its settings when imported.

    Made once for all processes of the tests.
    """
    shared = tmp_path_factory.getbasetemp()
    shared = shared if worker_id == "master" else shared.parent
    with (shared / "odd-chunks.json").open("a+") as printed:
        fcntl.flock(printed, fcntl.LOCK_EX)
        printed.seek(0)
        text = printed.read()
        if not text:
            data = shared / "odd-chunks"
            with_prefect_database(data)
            environment = {
                name: value for name, value in os.environ.items() if not name.startswith("PREFECT_")
            }
            environment["PYTHONPATH"] = str(ROOT)
            script = [sys.executable, str(Path(__file__).with_name("odd_chunks.py")), str(data)]
            done = subprocess.run(script, env=environment, capture_output=True, text=True, timeout=200)
            assert done.returncode == 0, done.stderr
            text = done.stdout
            printed.write(text)
    result: dict[str, Any] = json.loads(text)
    return result


def test_results_come_in_the_order_of_the_chunks(found: dict[str, Any]) -> None:
    assert found["plain"] == list(range(8))


def test_what_is_done_is_not_done_again_unless_its_shard_is_gone(found: dict[str, Any]) -> None:
    assert found["again"] == found["one lost"] == list(range(8))
    assert found["counts"] == [1] * 8  # the fifth was emptied before it was done again


def test_a_killed_worker_costs_no_chunk(found: dict[str, Any]) -> None:
    assert found["killed"] == list(range(8))


def test_workers_are_one_thread_and_keep_freed_memory_for_the_next_batch(found: dict[str, Any]) -> None:
    assert found["environment"] == [{"OMP_NUM_THREADS": "1"}] * 8


def test_a_failing_chunk_is_told_in_one_line(found: dict[str, Any]) -> None:
    assert found["failing"] == "failing test: chunk 2 of failing failed: this is no chunk"


def test_a_chunk_that_kills_more_workers_than_allowed_is_the_culprit(found: dict[str, Any]) -> None:
    assert found["allowed failures"] == 2  # from then on one, so that the second worker is one too many
    assert found["deadly"].startswith("deadly test: chunk 2 of deadly ended 2 worker processes")


def test_a_stranger_on_this_machine_gets_nothing_from_a_local_cluster(found: dict[str, Any]) -> None:
    assert found["strangers"] == []


@pytest.mark.parametrize(
    ("settings", "address", "told"),
    [
        ({}, "tls://127.0.0.1:9", "needs a certificate"),
        ({"require-encryption": True}, "tcp://127.0.0.1:9", "does not begin with tls://"),
    ],
)
def test_a_scheduler_that_cannot_be_reached_safely_is_wrong_use(
    settings: dict[str, Any], address: str, told: str
) -> None:
    with (
        dask.config.set({f"distributed.comm.{name}": value for name, value in settings.items()}),
        pytest.raises(UsageError, match=told),
        fan_out.cluster(scheduler=address),
    ):
        pass


def test_a_worker_that_dies_while_it_starts_ends_the_command_in_one_line(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def dies(**_: Any) -> None:
        raise RuntimeError("Nanny failed to start.")

    monkeypatch.setattr(fan_out, "LocalCluster", dies)
    with pytest.raises(RunError, match="worker process ended"), fan_out.cluster(1):
        pass


@pytest.mark.parametrize(
    ("status", "fetched", "lost"),
    [
        ("finished", None, False),
        ("finished", ConnectionResetError("closed"), True),
        ("cancelled", None, True),
        ("lost", None, True),
        ("error", None, False),
    ],
)
def test_a_result_that_is_lost_on_its_way_counts_as_not_done(
    status: str, fetched: Exception | None, lost: bool
) -> None:
    future = Mock(status=status)
    future.result.side_effect = fetched
    assert (fan_out._state(future) is fan_out.GONE) == lost


def test_what_goes_wrong_with_a_scheduler_at_hand_is_not_blamed_on_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("tasks.fan_out.fan_out.Client", MagicMock())
    with pytest.raises(UsageError, match="too few"), fan_out.cluster(scheduler="tcp://127.0.0.1:1"):
        raise UsageError("too few")
