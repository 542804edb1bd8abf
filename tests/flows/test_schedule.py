"""A schedule fires again and again, retrains on what was learned in between, and ends with all it started."""

from __future__ import annotations

import gc
import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import psutil
import pytest

from dashboards.verdicts.drift import Usefulness
from storage.places.data_folder import DataFolder
from tasks.champions.drift_watch import DRIFT, BenchmarkedMemory, report_drift
from tasks.registry.champion_registry import FIRST, PROMOTED, Registry
from tasks.servers.prefect_server import running_server
from tasks.settings.errors import UsageError
from tasks.tracking.model_names import registered_name
from tests.tasks.champions.retrained import CLASS, SETTINGS, learn

ROOT = Path(__file__).parents[2]
EVERY_SECONDS = 15.0
PATIENCE_SECONDS = 400.0  # of a busy machine; half a minute each on an idle one
pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(900),
    pytest.mark.filterwarnings(  # of MLflow's libraries among themselves
        "ignore::DeprecationWarning",
        "ignore::FutureWarning",
        "ignore:.*type hint",
        "ignore:Unnamed CHECK",
        "ignore::ResourceWarning",
    ),
]


def _wait(what: Callable[[], Any], process: subprocess.Popen[bytes], log: Path) -> Any:
    deadline = time.monotonic() + PATIENCE_SECONDS
    while not (found := what()):
        assert process.poll() is None, log.read_text()[-3000:]
        assert time.monotonic() < deadline, log.read_text()[-3000:]
        time.sleep(0.5)
    return found


@pytest.fixture
def served(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Path, Path, Any]]:
    """A data folder whose retraining is served, the log of that, and its process."""
    for name in [name for name in os.environ if name.startswith(("PREFECT_", "MLFLOW_"))]:
        monkeypatch.delenv(name)
    data, log, settings = (tmp_path / name for name in ("data", "log", "settings.json"))
    settings.write_text(SETTINGS.to_json())
    asked = map(str, (settings, data, EVERY_SECONDS))
    command = [sys.executable, "-m", "tests.flows.served", *asked]
    with log.open("wb") as sink:
        process = subprocess.Popen(
            command,
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdout=sink,
            stderr=sink,
            start_new_session=True,
        )
    try:
        yield data, log, process
    finally:
        process.kill()
        process.wait()


def test_a_schedule_retrains_on_what_was_learned_in_between(
    served: tuple[Path, Path, subprocess.Popen[bytes]], monkeypatch: pytest.MonkeyPatch
) -> None:
    data, log, process = served

    def registry_of() -> Registry:  # made anew each time: the database may not be there yet
        return Registry(DataFolder(data))

    def has_second_champion() -> bool:
        champion = registry_of().aliased(name)
        assert champion is not None
        return champion.number == 2

    name = registered_name(CLASS, "car")
    (first,) = _wait(lambda: _judged(registry_of(), name, 1), process, log)
    assert first.tag("verdict") == FIRST
    learn(str(data), seed=901, count=150)
    two = _wait(lambda: _judged(registry_of(), name, 2), process, log)
    assert two[1].tag("verdict") == PROMOTED, log.read_text()[-3000:]
    assert _wait(has_second_champion, process, log)
    assert "champion is version 1; " in log.read_text()

    monkeypatch.setenv("MOTION_MEMORY_DATA", str(data))
    then = Usefulness(problems=500, hits=400, mean_ms=1.0, median_ms=0.1)
    memory = BenchmarkedMemory(f"{name}/2", {"gust open 5 exhaustive": then}, data)
    now = {"gust open 5 exhaustive": replace(then, problems=200, hits=80)}
    assert any(DRIFT in line for line in report_drift(memory, now, data))
    _wait(lambda: _automated(data), process, log)

    family = psutil.Process(process.pid).children(recursive=True)
    os.killpg(process.pid, signal.SIGINT)  # as Ctrl-C does
    assert process.wait(timeout=60) == 130, log.read_text()[-3000:]
    assert "Traceback" not in log.read_text()  # of the retraining that was starting
    _, alive = psutil.wait_procs(family, timeout=20)
    assert not alive
    assert running_server(data) is None
    gc.collect()  # a socket of Prefect's client, while its warning is ignored


def _judged(registry: Registry, name: str, count: int) -> Any:
    found = registry.versions(name)
    return len(found) == count and all(each.tag("verdict") for each in found) and found


def _automated(data: Path) -> int:
    """Retrainings that an event has started."""
    with closing(sqlite3.connect(f"file:{data / 'prefect' / 'prefect.db'}?mode=ro", uri=True)) as database:
        (found,) = database.execute(
            "SELECT count(*) FROM flow_run WHERE deployment_id IS NOT NULL AND NOT auto_scheduled"
        ).fetchone()
    return int(found)


@pytest.mark.parametrize(
    ("every", "cron", "told"),
    [
        (60.0, "0 3 * * *", "--every and --cron are both given"),
        (0.5, None, "Every 0.5 seconds: give 1 or more"),
        (None, "at night", "'at night' is not a cron expression"),
    ],
)
def test_a_schedule_that_cannot_be_is_refused_before_anything_starts(
    every: float | None, cron: str | None, told: str, tmp_path: Path
) -> None:
    from flows.cli.retraining_commands import ENTRYPOINT, retrain_flow
    from tasks.champions.retraining_schedule import retraining_parameters, serve

    parameters = retraining_parameters(SETTINGS, False, 1)
    with pytest.raises(UsageError, match=told):
        serve(retrain_flow, ENTRYPOINT, parameters, tmp_path / "data", every, cron)
    assert not (tmp_path / "data").exists()
