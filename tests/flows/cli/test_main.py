"""The command line: wrong use is told in one line on the error stream, with its exit code."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from unittest.mock import Mock

import pytest

from flows.cli.main import _interrupt, app, call
from flows.cli.run_options import worker_count

COMMANDS = (
    "run", "collect", "hallucinate", "train", "build-memory", "benchmark", "report", "verify", "draw", "plan",
    "optimise", "solve", "import-worlds", "export", "sweep", "experience-curve", "compare",
    "serve-memory", "servers",
    "retrain", "serve", "promote", "rollback", "retrain-library", "serve-library",
)  # fmt: skip


def test_a_folder_of_somebody_else_is_named_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    theirs, is_file = tmp_path / "theirs", Path.is_file

    def refused(path: Path) -> bool:
        if path.is_relative_to(theirs):
            raise PermissionError(13, "Permission denied", str(path))
        return is_file(path)

    theirs.mkdir()
    monkeypatch.setattr(Path, "is_file", refused)  # the tests' user may be root, who may do anything
    assert call(["gather", str(theirs), "--out", str(tmp_path / "library")]) == 1
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert str(theirs) in said
    assert "Errno" not in said


@pytest.mark.parametrize(
    ("arguments", "code", "told"),
    [
        (["fly"], 2, 'Unknown command "fly"'),
        (["run", "--preset", "huge"], 2, '"huge" for --preset. Choose from: "smoke", "laptop"'),
        (["run", "--classes", "maze"], 2, '"maze" for --classes. Choose from'),
        (["run", "--seed", "x"], 2, "--seed"),
        (["run", "--seed", "-3"], 2, "Seed -3 is negative"),
        (["run", "--seed", "1.7"], 2, "--seed"),
        (["train", "--hidden", "64", "2.5"], 2, "2.5"),
        (["solve", "p.jsonl", "--top-k", "2.5", "--out", "rows.parquet"], 2, "--top-k"),
        (["run", "--speed", "3"], 2, "--speed"),
        (["run", "--data"], 2, "--data"),
        (["run", "--workers", "0"], 2, "0 workers: give 1 or more."),
        (["run", "--worlds", "one", "two", "three"], 2, "two three"),
        (["run", "--worlds", "/nowhere"], 2, "/nowhere does not exist"),
        (["train", "--objective", "luck"], 2, '"luck" for --objective. Choose from'),
        (["train", "--epochs", "0"], 2, "0 epochs: give 1 or more."),
        (["train", "--hidden", "64", "0"], 2, "give 1 or more."),
        (["collect", "--difficulty", "odd"], 2, '"odd" for --difficulty. Choose from'),
        (["collect", "--vehicle", "tram"], 2, "Unknown vehicle 'tram'. Known: car, differential-drive"),
        (["plan", "p.json", "--vehicle", "tram"], 2, "Unknown vehicle 'tram'"),
        (
            ["run", "--hallucination", "dream"],
            2,
            "Unknown hallucination method 'dream'. Known: rearrange",
        ),
        (["hallucinate", "--hallucination", "minimal=0"], 2, "'minimal=0': give a weight above 0"),
        (["solve"], 2, "--problems"),
        (["plan", "p.json", "--planner", "prm"], 2, '"prm" for --planner. Choose from'),
        (["plan", "p.json", "--assist", "magic"], 2, '"magic" for --assist. Choose from'),
        (["plan", "p.json", "--assist", "open"], 2, "needs --memory"),
        (["plan", "p.json", "--improve-seconds", "-1"], 2, "0 or more"),
        (["plan", "p.json", "--picture", "p.bmp"], 2, "p.bmp is not the name of a picture"),
        (["plan", "p.json"], 1, "p.json does not exist"),
        (["draw", "maze", "--out", "p.jsonl"], 2, '"maze" for NAME. Choose from'),
        (["draw", "dock", "--out", "p.jsonl"], 2, "dock is not for car; choose parallel"),
        (["draw", "lot", "--problems", "0", "--out", "p.jsonl"], 2, "0 problems: give 1 or more."),
        (["draw", "lot", "--out", "p.txt"], 1, "p.txt ends in '.txt'"),
        (["draw", "lot", "--out", "p.json"], 1, "p.json can hold only one problem, got 100"),
        (["plan", "."], 1, ". is a folder"),
        (["plan", ""], 2, "empty"),
        (["plan", "p.json", "--current", ""], 2, "--current: an empty"),
        (["plan", "p.json", "--vehicle="], 2, "--vehicle: an empty"),
        (["solve", "p.json", "--out", ""], 2, "--out: an empty"),
        (["gather", "random", "", "--out", "library"], 2, "empty"),
        (["plan", "a\0.json"], 2, "'a\\x00.json' contains a null character"),
        (["solve", "p.json", "--out", "a\0.parquet"], 2, "'a\\x00.parquet' contains a null character"),
        (["optimise", "p.json", "--straight", "--planner", "gust"], 2, "--planner and --straight"),
        (["optimise", "p.json", "--planner", "prm"], 2, '"prm" for --planner. Choose from'),
        (["optimise", "p.json", "--clearance-weight", "-1"], 2, "Clearance weight -1.0"),
        (["optimise", "p.json", "--picture", "p.bmp"], 2, "p.bmp is not the name of a picture"),
        (["optimise", "p.json"], 1, "p.json does not exist"),
        (["solve", "p.json", "--out", "rows.csv"], 2, "rows.csv does not end in .parquet"),
        (["solve", "p.jsonl", "--out", "rows.parquet"], 1, "p.jsonl does not exist"),
        (["solve", "p.jsonl", "--out", "rows.parquet", "--workers", "0"], 2, "0 workers: give 1 or more."),
        (["retrain", "--learned", "monday"], 2, "--learned cannot be used for retraining"),
        (["retrain", "--classes", "maze"], 2, '"maze" for --classes. Choose from'),
        (["serve", "--every", "9", "--cron", "0 3 * * *"], 2, "--every and --cron are both given"),
        (["serve", "--every", "0"], 2, "Every 0 seconds: give 1 or more."),
        (["promote"], 1, "data is not a data folder"),
        (["rollback", "--data", "nowhere"], 1, "nowhere is not a data folder"),
        (["export", "nowhere", "--format", "xml", "--out", "a.csv"], 2, "Unknown format 'xml'. Known: ompl,"),
        (["export", "nowhere", "--format", "csv", "--out", "a.db"], 2, "a.db does not end in .csv"),
        (["export", "nowhere", "--format", "ompl", "--out", "."], 2, ". already exists; give a new folder"),
        (["export", "nowhere", "--format", "csv", "--out", "a.csv"], 1, "nowhere is not a run"),
        (["verify", "nowhere"], 1, "nowhere does not exist"),
        (["verify", "nowhere", "--sample", "2"], 2, "--sample is 2.0"),
        (["run", "--data", "s3://bucket/data"], 2, "s3://bucket/data cannot hold an MLflow database"),
        (["run", "--scheduler", "tcp://10.0.0.5:8786"], 2, "set PREFECT_API_URL"),
        (["run", "--preset", "smoke", "--data", "/proc/nowhere"], 1, "/proc/nowhere cannot be used"),
    ],
)
def test_wrong_use_is_one_line_and_an_exit_code(
    arguments: list[str],
    code: int,
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert call(arguments) == code
    printed = capsys.readouterr()
    assert told in printed.err
    assert printed.err.count("\n") == 1
    assert printed.out == ""
    assert list(tmp_path.iterdir()) == []


def test_a_data_folder_of_another_version_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "motion-memory.json").write_text('{"layout": 99}')
    assert call(["run", "--preset", "smoke", "--data", str(tmp_path)]) == 1
    assert "has data layout 99" in capsys.readouterr().err


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert call([command, "--help"]) == 0
    assert command in capsys.readouterr().out


def test_the_commands_are_those_of_the_contract() -> None:
    assert set(COMMANDS) <= {name for name in app if not name.startswith("-")}


def test_help_loads_nothing_that_takes_long() -> None:
    slow = ("prefect", "mlflow", "torch", "numba", "dask", "matplotlib", "pandas")
    script = (
        f"import sys; from flows.cli.main import call; call(['--help']); print({slow} & sys.modules.keys())"
    )
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        check=True,
        cwd=Path(__file__).parents[3],
    )
    assert done.stdout.strip().endswith("set()")


def test_without_a_number_there_are_as_many_workers_as_this_process_may_use_cores() -> None:
    code = "from flows.cli.run_options import worker_count; print(worker_count(None))"
    command = [sys.executable, "-c", code]
    core = min(os.sched_getaffinity(0))
    told = subprocess.run(["taskset", "-c", str(core), *command], capture_output=True, text=True, check=True)
    assert told.stdout == "1\n"
    assert 1 <= worker_count(None) <= len(os.sched_getaffinity(0))
    assert worker_count(7) == 7


def test_the_version_names_what_a_report_of_a_fault_needs(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["--version"]) == 0
    told = capsys.readouterr().out
    assert all(version(name) in told for name in ("motion-memory", "prefect", "mlflow", "numba"))


def test_completion_is_installed_where_it_is_asked_for(tmp_path: Path) -> None:
    assert call(["--install-completion", "--shell", "bash", "--output", str(tmp_path / "completion")]) == 0
    assert "motion-memory" in (tmp_path / "completion").read_text()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["run", "--preset", "smoke"], "Repeat the command to continue"),
        (["--quiet", "run"], "Repeat the command to continue"),
        (["--quiet", "plan", "a.json"], "Nothing was kept"),
        (["--json", "serve"], "Stopped."),
    ],
)
def test_ctrl_c_says_what_becomes_of_the_command_wherever_its_options_stand(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: list[str], told: str
) -> None:
    monkeypatch.setattr("flows.cli.main.threading.Timer", Mock())  # which would force an exit
    monkeypatch.setattr("sys.argv", ["motion-memory", *words])
    with pytest.raises(KeyboardInterrupt):
        _interrupt(signal.SIGINT, None)
    assert told in capsys.readouterr().err


@pytest.mark.parametrize(
    ("streams", "options", "code"),
    [
        (">&-", "", 0),
        ("2>&-", "", 0),
        ("<&- >&- 2>&-", "--json", 0),
        (">/dev/full", "", 1),
        (">/dev/full", "--json", 1),
    ],
)
def test_work_is_done_and_its_exit_code_is_right_whatever_becomes_of_the_output(
    tmp_path: Path, streams: str, options: str, code: int
) -> None:
    out = tmp_path / "drawn.jsonl"
    command = f"{sys.executable} -m flows.cli.main draw parallel --problems 1 --out {out} {options} {streams}"
    done = subprocess.run(
        ["bash", "-c", command], capture_output=True, text=True, check=False, cwd=Path(__file__).parents[3]
    )
    assert done.returncode == code
    assert out.read_text().count("\n") == 1
    assert done.stderr.count("\n") == code  # a line that says why
    assert ("the output" in done.stderr) == bool(code)


CUT_OFF = '{"start": [0, 0'
FAR_BOUNDS = json.dumps(
    {"start": [0, 0, 0], "goal": [5, 0], "goal_radius": 1, "bounds": [-9e5, -9e5, 9e5, 9e5], "obstacles": []}
)
IN_MILLIMETRES = """kind: car
name: cart
body: [[[-1000, -600], [3500, -600], [3500, 600], [-1000, 600]]]
wheelbase: 1500
limits: {speed: [-4, 4], acceleration: 1.2, steering: 1.2, steering_rate: 1.5}
step: 0.05
"""


@pytest.mark.parametrize(
    ("name", "text", "command"),
    [
        ("p.jsonl", CUT_OFF, ["solve", "p.jsonl", "--out", "rows.parquet"]),
        ("p.jsonl", FAR_BOUNDS, ["solve", "p.jsonl", "--out", "rows.parquet"]),
        ("p.json", FAR_BOUNDS, ["plan", "p.json"]),
        ("cart.yaml", IN_MILLIMETRES, ["draw", "lot", "--vehicle", "cart.yaml", "--out", "p.jsonl"]),
    ],
)
def test_a_line_that_asks_something_has_no_full_stop_after_the_question(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    name: str,
    text: str,
    command: list[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path(name).write_text(text)
    assert call(command) != 0
    told = capsys.readouterr().err
    assert "?" in told
    assert "?." not in told
