"""More than one machine: object storage, databases on PostgreSQL, workers that share nothing, and faults."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import distributed
import psycopg2
import pytest

from storage.places.data_folder import open_data_folder
from storage.places.mirror import fetch, files_in
from storage.places.run_folder import RunFolder
from tests.cluster.machines import Fleet, fleet, wait_for
from tests.flows.same_rows import assert_same_rows
from tests.flows.small_run import in_one_process

RUN = (
    "run", "--preset", "smoke", "--classes", "trap", "--experiences", "4", "--candidates", "8",
    "--problems-per-experience", "10", "--test-problems", "120", "--epochs", "2",
)  # fmt: skip
AWAY_SECONDS = 8.0
STAGE_SECONDS = 240.0

pytestmark = [pytest.mark.cluster, pytest.mark.timeout(900), pytest.mark.filterwarnings("default")]


@pytest.fixture
def machines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Fleet]:
    with fleet(tmp_path) as made:
        for name, value in made.environment("test").items():
            monkeypatch.setenv(name, value)
        yield made


def _is_at(client: distributed.Client, name: str, what: str) -> bool:
    """Whether the worker of that name is in a chunk of that kind."""
    named = {
        info["name"]: address for address, info in client.scheduler_info(n_workers=-1)["workers"].items()
    }
    return any(str(key).startswith(what) for key in client.processing().get(named.get(name), ()))


def _fetched(run: RunFolder) -> RunFolder:
    for path in files_in(run.path, "*.parquet", below=True):
        fetch(path)
    return run


def test_two_machines_one_killed_and_every_service_failing_once_give_the_rows_of_one_process(
    machines: Fleet, tmp_path: Path
) -> None:
    import boto3

    boto3.client("s3").create_bucket(Bucket=machines.bucket)
    command = [sys.executable, "-m", "flows.cli.main", *RUN, "--scheduler", machines.scheduler_address]
    running = machines.start("command", *command).running
    try:
        run = _disturb(machines, running)
    except AssertionError as error:
        raise AssertionError(f"{error}\n{machines.logs()}") from error
    undisturbed = in_one_process(run, tmp_path / "local")
    assert running.wait(timeout=300) == 0, machines.logs()
    assert len(assert_same_rows(_fetched(run), undisturbed)) >= 6
    _check_databases(machines, run.path.name)
    _check_nobody_holds_it(machines)


def _disturb(machines: Fleet, running: subprocess.Popen[bytes]) -> RunFolder:
    """Do to a run what a bad day does; its folder."""

    def wait(what: str, is_so: Callable[[], bool]) -> None:
        wait_for(what, lambda: is_so() or running.poll() is not None, STAGE_SECONDS)
        assert running.poll() is None, f"the command ended before {what}"

    data = open_data_folder(machines.environment("test")["MOTION_MEMORY_DATA"])
    wait("a run", lambda: bool(data.runs()))
    (run,) = data.runs()
    wait("hallucinated problems", lambda: bool(run.shards("hallucinated", "trap")))
    machines.scheduler.kill()
    machines.scheduler = machines.start_scheduler()
    for name, worker in machines.workers.items():
        worker.running.wait(timeout=60)  # it ends with its scheduler, and its keeper starts it again
        machines.workers[name] = machines.start_worker(name)
    with distributed.Client(machines.scheduler_address, set_as_default=False) as client:
        wait("the benchmark", lambda: _is_at(client, "one", "benchmark_chunk"))
        machines.workers["one"].kill()
        machines.postgres.stop()
        time.sleep(AWAY_SECONDS)
        assert running.poll() is None, "the command ended with its database"
        machines.postgres.start()
    return run


def _check_databases(machines: Fleet, run_name: str) -> None:
    """Prefect and MLflow have kept the run in PostgreSQL."""
    with (
        closing(psycopg2.connect(machines.postgres.address("mlflow"))) as database,
        database.cursor() as rows,
    ):
        rows.execute("SELECT count(*) FROM tags WHERE key = 'motion_memory.run' AND value = %s", [run_name])
        assert rows.fetchone() == (3,)  # the run, its training, its benchmark
        rows.execute("SELECT DISTINCT status FROM runs")
        assert rows.fetchall() == [("FINISHED",)]
    address = machines.postgres.address("prefect")
    with closing(psycopg2.connect(address)) as database, database.cursor() as rows:
        rows.execute("SELECT state_type::text FROM flow_run WHERE parent_task_run_id IS NULL")
        assert rows.fetchall() == [("COMPLETED",)]


def _check_nobody_holds_it(machines: Fleet) -> None:
    with open_data_folder(machines.environment("test")["MOTION_MEMORY_DATA"]).lock():
        pass
