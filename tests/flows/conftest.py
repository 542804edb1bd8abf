"""One small run, made once for all processes of the tests: by its command, watched, and stage by stage."""

from __future__ import annotations

import fcntl
import json
from typing import NamedTuple

import pytest

from storage.places.data_folder import DataFolder
from storage.places.run_folder import RunFolder
from tests.flows import small_run
from tests.flows.planted import PLANTED
from tests.flows.watched import Port, Watched, watch
from tests.prepared.prefect_database import with_prefect_database


class SmallRuns(NamedTuple):
    """A run by its command with two workers, and by its stages in one process; what the command showed."""

    two: RunFolder
    one: RunFolder
    watched: Watched


@pytest.fixture(scope="session")
def small_runs(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> SmallRuns:
    """The runs; the command's environment holds secrets."""
    shared = tmp_path_factory.getbasetemp()
    shared = shared if worker_id == "master" else shared.parent
    first, second, seen = shared / "two-workers", shared / "one-worker", shared / "small-run.json"
    with (shared / "small-run.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not seen.exists():
            with_prefect_database(first)
            command = ["run", *small_run.OPTIONS, "--data", str(first), "--workers", "2"]
            watched = watch(command, shared / "small-run.log", PLANTED)
            assert watched.code == 0, watched.output[-2000:]
            (run,) = DataFolder(first).runs()
            small_run.in_one_process(run, second)
            seen.write_text(json.dumps([watched.output, sorted(watched.ports)]))
    output, ports = json.loads(seen.read_text())
    (two,), (one,) = DataFolder(first).runs(), DataFolder(second).runs()
    return SmallRuns(two, one, Watched(0, output, {Port(*port) for port in ports}))
