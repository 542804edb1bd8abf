"""Whole commands: each port is on loopback and in the documented list; a planted secret is found nowhere."""

from __future__ import annotations

import json
import re
import shutil
import signal
from pathlib import Path
from unittest.mock import Mock

import httpx
import pytest

from flows.cli.main import call
from storage.exchange.problems import fields_of
from storage.places.data_folder import DataFolder
from storage.tables.attempts import read_attempts
from tasks.requests.assistant import AssistantSettings
from tasks.requests.solve_many import solve_many
from tasks.session import command_session
from tests.flows import small_run
from tests.flows.closed import assert_closed, assert_nowhere_in
from tests.flows.conftest import SmallRuns
from tests.flows.planted import PLANTED, SECRET
from tests.flows.same_rows import equal_but_for_seconds
from tests.flows.watched import watch
from tests.prepared.prefect_database import with_prefect_database
from tests.tasks.served import JSON, good_request, problem, write_memory
from tests.tasks.servers.attacks import EVIL

ELSEWHERE = f"http://robot:{SECRET}@127.0.0.1:9"  # where nobody answers
COUNT = 10  # problems to solve
IMPATIENT = {"MLFLOW_HTTP_REQUEST_MAX_RETRIES": "0"}
PARTS_OF_ONE = """
from flows.cli.main import main
from tasks.requests import problem_parts, solve_many
problem_parts.PART_PROBLEMS = 1
solve_many.FEW_PROBLEMS = 0  # even so few are left to workers
main()
"""
KILLED = f"""
import os, signal
from tasks.requests import solve_many

def solve_or_die(part, told, solve=solve_many.solve_part_reporting):
    if part.index == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return solve(part, told)

solve_many.solve_part_reporting = solve_or_die
{PARTS_OF_ONE}
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a memory and problems."""
    place = tmp_path_factory.mktemp("closed")
    write_memory(place / "memory")
    (place / "one.json").write_text(json.dumps(fields_of(problem(0))))
    lines = [json.dumps(fields_of(problem(i))) for i in range(COUNT)]
    (place / "many.jsonl").write_text("\n".join(lines))
    return place


@pytest.mark.timeout(600)  # whoever comes first makes the run
def test_a_run_and_what_it_leaves(small_runs: SmallRuns) -> None:
    assert {port.process for port in small_runs.watched.ports} == {"server", "command", "child"}
    assert_closed("run", small_runs.watched)
    assert_nowhere_in(small_runs.two.path.parents[1])


@pytest.fixture
def of_small_run(small_runs: SmallRuns, tmp_path: Path) -> tuple[Path, list[str]]:
    """A copy of the small run's data folder, and the options of a command on it."""
    data = tmp_path / "data"
    shutil.copytree(small_runs.two.path.parents[1], data)
    return data, [*small_run.OPTIONS, "--data", str(data), "--workers", "1"]


@pytest.mark.slow  # a server and a worker, as for the run
@pytest.mark.timeout(600)
def test_a_failing_stage_tells_no_secret(of_small_run: tuple[Path, list[str]], tmp_path: Path) -> None:
    data, options = of_small_run
    (run,) = DataFolder(data).runs()
    masks = run.memory("random") / "masks.npy"
    masks.write_bytes(masks.read_bytes()[:-1] + b"x")
    run.shard("results", "random", 0).unlink()  # so that a worker reads the memory
    failed = watch(["benchmark", *options], tmp_path / "failed.log", PLANTED)
    assert failed.code == 1
    assert "masks.npy is damaged" in failed.output
    assert SECRET not in failed.output
    assert_nowhere_in(data)


@pytest.mark.timeout(600)
@pytest.mark.filterwarnings("ignore")  # of MLflow's libraries among themselves
def test_an_mlflow_that_cannot_be_used_is_told_first_and_without_its_secret(
    of_small_run: tuple[Path, list[str]], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    data, options = of_small_run
    unreached = IMPATIENT | {"MLFLOW_TRACKING_URI": ELSEWHERE, "MOTION_MEMORY_DEBUG": "0"}
    for name, value in (PLANTED | unreached).items():
        monkeypatch.setenv(name, value)
    begun = Mock()  # a server, or a cluster
    for what in ("local_server", "_workers_for"):
        monkeypatch.setattr(command_session, what, begun)
    assert call(["report", *options]) == 1
    told = "".join(capsys.readouterr())
    assert "MLflow at http://***@127.0.0.1:9 cannot be used" in told
    assert "Traceback" not in told
    assert SECRET not in told
    begun.assert_not_called()
    assert_nowhere_in(data)


@pytest.mark.timeout(600)
def test_a_killed_solve_goes_on_with_two_workers_to_the_same_rows(place: Path) -> None:
    problems, out = place / "many.jsonl", place / "solved" / "rows.parquet"
    parts = with_prefect_database(out.with_name("rows.parquet.parts"))
    arguments = ["solve", str(problems), "--out", str(out), "--planner", "gust", "--workers"]
    killed = watch([*arguments, "1"], place / "killed.log", PLANTED, script=KILLED)
    assert killed.code == -signal.SIGKILL
    assert len(list(parts.glob("[0-9]*.parquet"))) == 2
    watched = watch([*arguments, "2"], place / "solve.log", PLANTED, script=PARTS_OF_ONE)
    assert watched.code == 0, watched.output[-2000:]
    assert f"{COUNT} of {COUNT}" in watched.output
    assert {port.process for port in watched.ports} == {"server", "command", "child"}
    assert_closed("solve", watched)
    assert_nowhere_in(place)
    solve_many(AssistantSettings("gust", "none", 5, None, 1), problems, place / "undisturbed.parquet")
    assert equal_but_for_seconds(read_attempts(out), read_attempts(place / "undisturbed.parquet"))
    assert list(out.parent.iterdir()) == [out]


def test_serving_a_memory(place: Path) -> None:
    answers = []

    def asked(output: str) -> bool:
        found = re.search(r"serving  (http://\S+)/invocations.*\naccess", output)
        if found is None:
            return False
        with httpx.Client(base_url=found[1], timeout=60.0) as client:
            for auth in (None, ("robot", "wrong"), ("robot", SECRET)):
                for body in (good_request(), b"{"):
                    answer = client.post("/invocations", content=body, headers=JSON, auth=auth)
                    answers.append(answer.status_code)
            answers.append(client.get("/version").status_code)
            answers.append(client.get("/ping").status_code)
            for foreign in ({"Origin": EVIL}, {"Host": "evil.example"}):
                given = {"content": good_request(), "headers": JSON | foreign, "auth": ("robot", SECRET)}
                answers.append(client.post("/invocations", **given).status_code)
        return True

    arguments = ["serve-memory", str(place / "memory"), "--port", "0"]
    watched = watch(arguments, place / "serve.log", PLANTED, asked)
    assert watched.code == 0, watched.output
    assert answers[:8] == [401, 401, 401, 401, 200, 400, 401, 200]
    assert set(answers[8:]) <= {400, 403}
    assert {port.process for port in watched.ports} >= {"child"}
    assert_closed("serve-memory", watched)


def test_planning_opens_no_port_and_a_traceback_tells_no_secret(place: Path) -> None:
    arguments = ["plan", str(place / "one.json"), "--assist", "open", "--memory", "models:/x@y"]
    unreached = {"MLFLOW_TRACKING_URI": ELSEWHERE, "MOTION_MEMORY_DEBUG": "1"}
    watched = watch(arguments, place / "plan.log", PLANTED | IMPATIENT | unreached)
    assert watched.code == 1
    assert "cannot be fetched from MLflow at http://***@127.0.0.1:9" in watched.output
    assert "Traceback" in watched.output
    assert watched.ports == set()
    assert SECRET not in watched.output
