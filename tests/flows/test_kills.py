"""The main job, killed again and again: the same command goes on, and ends with an undisturbed run's rows."""

from __future__ import annotations

import os
import random
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from storage.places.data_folder import DataFolder
from storage.places.run_folder import RunFolder
from tasks.servers.prefect_server import running_server
from tests.flows.same_rows import assert_same_rows

ROOT = Path(__file__).parents[2]
KILLS = 20
LONGEST_SECONDS = 15.0  # until a kill; even a smoke run that has nothing left to do takes longer
SETTLED_SECONDS = 1.0  # a shard this old was finished: whoever wrote it had the time to say so

STAGE_MARKS = (  # what is there once a stage has begun
    "prefect/server.url",
    "runs/*/candidates/*/*.parquet",
    "runs/*/hallucinated/*/*.parquet",
    "runs/*/models/*/*",
    "runs/*/memories/*/*",
    "runs/*/results/*/*.parquet",
    "runs/*/figures/*",
)

pytestmark = [pytest.mark.slow, pytest.mark.timeout(3000)]


def _start(data: Path, workers: int) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "flows.cli.main", "run", "--preset", "smoke", "--data", str(data)]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT_")}
    with (data.parent / f"{data.name}.log").open("ab") as log:
        return subprocess.Popen(
            [*command, "--workers", str(workers)], cwd=ROOT, env=environment, stdout=log, stderr=log
        )


def _log(data: Path) -> str:
    return (data.parent / f"{data.name}.log").read_text()[-3000:]


def _finish(data: Path, workers: int) -> RunFolder:
    assert _start(data, workers).wait(timeout=900) == 0, _log(data)
    (run,) = DataFolder(data).runs()
    return run


def _kill_somebody(parent: subprocess.Popen[bytes], chance: random.Random) -> None:
    """-9 to the command, to its workers' keepers or its server: whoever comes up."""
    family = psutil.Process(parent.pid)
    victims = [family, *family.children(recursive=True)]
    victim = chance.choice(victims) if chance.random() < 0.5 else family
    victim.kill()


def _finished(data: Path) -> dict[Path, int]:
    before = time.time() - SETTLED_SECONDS
    stats = {path: path.stat() for path in (data / "runs").rglob("*.parquet")}
    return {path: stat.st_mtime_ns for path, stat in stats.items() if stat.st_mtime < before}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    return _finish(tmp_path_factory.mktemp("undisturbed") / "data", 2)


def test_a_run_killed_twenty_times_ends_with_the_rows_of_an_undisturbed_one(
    undisturbed: RunFolder, tmp_path: Path
) -> None:
    chance = random.Random(1)
    data = tmp_path / "data"
    finished: dict[Path, int] = {}
    for _ in range(KILLS):
        running = _start(data, 2)
        time.sleep(chance.uniform(1.0, LONGEST_SECONDS))
        assert running.poll() is None, _log(data)
        finished = _finished(data) | finished
        _kill_somebody(running, chance)
        time.sleep(chance.uniform(0.0, 5.0))  # a killed worker is replaced meanwhile
        running.kill()
        running.wait()
    run = _finish(data, 2)
    again = [path for path, when in finished.items() if path.stat().st_mtime_ns != when]
    assert not again, f"finished, and made once more: {again}"
    assert_same_rows(run, undisturbed)


def test_a_run_whose_server_is_killed_in_each_stage_goes_on(undisturbed: RunFolder, tmp_path: Path) -> None:
    data = tmp_path / "data"
    running = _start(data, 2)
    for mark in STAGE_MARKS:
        while not list(data.glob(mark)):
            assert running.poll() is None, _log(data)
            time.sleep(0.05)
        if mark is not STAGE_MARKS[0]:  # after the first kill it is starting already
            server = running_server(data)
            assert server is not None
            server.wait()
        for process in psutil.Process(running.pid).children():
            if "tasks.servers.prefect_app" in process.cmdline():
                process.kill()
    assert running.wait(timeout=900) == 0, _log(data)
    assert not [trouble for trouble in ("Traceback", "Errno", "ERROR", "leaked") if trouble in _log(data)]
    (run,) = DataFolder(data).runs()
    assert_same_rows(run, undisturbed)


@pytest.mark.parametrize("workers", [1, 4])
def test_any_number_of_workers_gives_the_same_rows(
    workers: int, undisturbed: RunFolder, tmp_path: Path
) -> None:
    assert_same_rows(_finish(tmp_path / "data", workers), undisturbed)
