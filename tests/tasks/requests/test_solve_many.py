"""Many problems: the same rows however often the command is stopped, whoever works; nothing is done twice."""

from __future__ import annotations

import json
import logging
import math
import os
import shutil
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from flows.cli.main import call
from planners.attempt import Attempt
from planners.world.classes.problem_classes import problem_class
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import CAR
from storage.errors import StorageError
from storage.exchange.problems import fields_of, write_problems
from storage.places.data_folder import DataFolder, open_data_folder
from storage.places.files import locked
from storage.tables import gained_experiences
from storage.tables.attempts import read_attempts, write_attempts
from storage.tables.gained_experiences import gained_shards
from tasks.requests import problem_parts as parts
from tasks.requests import solve_many as many_module
from tasks.requests.assistant import Assistant, AssistantSettings
from tasks.requests.solve_many import solve_many
from tests.flows.same_rows import equal_but_for_seconds

ROOT = Path(__file__).parents[3]
ASSISTANT = AssistantSettings("gust", "none", 5, None, 1)
COUNT = 11
SIZE = 3  # problems a part


@pytest.fixture(autouse=True)
def _small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parts, "PART_PROBLEMS", SIZE)


@pytest.fixture(scope="module")
def problems(tmp_path_factory: pytest.TempPathFactory) -> Path:
    drawn = [problem_class("curves", "easy").draw(11, index) for index in range(COUNT)]
    path = tmp_path_factory.mktemp("asked") / "problems.jsonl"
    write_problems(path, drawn)
    write_problems(path.with_suffix(".parquet"), drawn)
    return path


@pytest.fixture(scope="module")
def undisturbed(problems: Path) -> pd.DataFrame:
    out = problems.with_name("undisturbed.parquet")
    solve_many(ASSISTANT, problems, out)
    return read_attempts(out)


@pytest.mark.parametrize(("seconds", "size"), [(0.0, SIZE), (1e-320, SIZE), (4.0, 2), (100.0, 1), (1e308, 1)])
def test_parts_are_so_small_that_improving_one_takes_seconds(
    problems: Path, tmp_path: Path, seconds: float, size: int
) -> None:
    settings = ASSISTANT._replace(improve_seconds=seconds)
    file_parts = parts.parts_of(parts.SolveRequest(problems, tmp_path / "rows.parquet", settings, ""))
    assert file_parts[0].problem_slice.count == size


def test_few_problems_are_shared_out_once_they_take_long_and_the_rows_are_the_same(
    problems: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, undisturbed: pd.DataFrame
) -> None:
    begun: list[int] = []

    def flow(request: parts.SolveRequest) -> list[parts.PartResult]:
        left = [part for part in parts.parts_of(request) if not parts.SOLVE.is_written(part)]
        begun.append(left[0].index)
        return [parts.SOLVE.run(part).result for part in left]

    monkeypatch.setattr(many_module, "part_workers", lambda *_: nullcontext())
    for seconds, expected in ((0.0, [2]), (math.inf, [])):
        begun.clear()
        monkeypatch.setattr(many_module, "START_SECONDS", seconds)
        out = tmp_path / f"{seconds}.parquet"
        assert solve_many(ASSISTANT, problems, out, workers=2, flow=flow).solved_now == COUNT
        assert begun == expected
        assert equal_but_for_seconds(read_attempts(out), undisturbed)


def test_threads_that_share_a_process_share_no_assistant(
    problems: Path, tmp_path: Path, undisturbed: pd.DataFrame, monkeypatch: pytest.MonkeyPatch
) -> None:
    class OfOneThread(Assistant):
        made_in: int

        def __call__(self, problem: Problem) -> tuple[Attempt, Plan | None]:
            if not hasattr(self, "made_in"):
                self.made_in = threading.get_ident()
            assert self.made_in == threading.get_ident()
            return super().__call__(problem)

    monkeypatch.setattr(parts, "Assistant", OfOneThread)
    out = tmp_path / "rows.parquet"
    cut = parts.parts_of(parts.SolveRequest(problems, out, ASSISTANT, ""))
    met = threading.Barrier(2)  # both threads work at the same time

    def run(part: parts.FilePart) -> None:
        met.wait()
        parts.SOLVE.run(part)

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(run, cut[: len(cut) // 2 * 2]))
    solve_many(ASSISTANT, problems, out)
    assert equal_but_for_seconds(read_attempts(out), undisturbed)


def test_a_file_is_cut_into_parts_that_workers_can_share(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(parts, "PART_PROBLEMS", 500)
    line = json.dumps(fields_of(problem_class("curves", "easy").draw(11, 0)))
    for count, sizes in ((20, [20]), (400, [25] * 16), (1_650, [104] * 15 + [90])):
        path = tmp_path / f"{count}.jsonl"
        path.write_text("\n".join([line] * count))
        cut = parts.parts_of(parts.SolveRequest(path, tmp_path / "rows.parquet", ASSISTANT, ""))
        assert [part.problem_slice.count for part in cut] == sizes


class StoppedError(Exception):
    """As by Ctrl-C."""


class Counting:
    """Writes rows until it has written enough; counts."""

    def __init__(self, most: int = 1_000) -> None:
        self.written = 0
        self.most = most

    def __call__(self, path: Path, rows: Sequence[dict[str, Any]], key: str = "") -> None:
        if self.written == self.most:
            raise StoppedError
        self.written += 1
        write_attempts(path, rows, key)


def test_rows_come_in_the_order_of_the_problems(undisturbed: pd.DataFrame, problems: Path) -> None:
    ids = [json.loads(line)["id"] for line in problems.read_text().splitlines()]
    assert list(undisturbed["problem_id"]) == ids
    assert undisturbed["solved"].all()
    assert not problems.with_name("undisturbed.parquet.parts").exists()


def test_both_formats_give_the_same_rows(undisturbed: pd.DataFrame, problems: Path, tmp_path: Path) -> None:
    solve_many(ASSISTANT, problems.with_suffix(".parquet"), tmp_path / "rows.parquet")
    assert equal_but_for_seconds(read_attempts(tmp_path / "rows.parquet"), undisturbed)


def test_what_was_finished_before_an_interruption_is_not_done_again(
    undisturbed: pd.DataFrame, problems: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "rows.parquet"
    monkeypatch.setattr(parts, "write_attempts", Counting(most=2))
    with pytest.raises(StoppedError):
        solve_many(ASSISTANT, problems, out)
    assert not out.exists()
    counting = Counting()
    monkeypatch.setattr(parts, "write_attempts", counting)
    solve_many(ASSISTANT, problems, out)
    assert counting.written == -(-COUNT // SIZE) - 2
    assert equal_but_for_seconds(read_attempts(out), undisturbed)
    assert list(tmp_path.iterdir()) == [out]


def test_a_finished_command_is_not_done_again_as_long_as_all_it_wrote_is_there(
    problems: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, plans, data = (tmp_path / name for name in ("rows.parquet", "plans", "data"))
    file = tmp_path / "problems.jsonl"
    shutil.copy(problems, file)
    first = solve_many(ASSISTANT, file, out, plans, data)
    assert first.solved_now == COUNT
    monkeypatch.setattr(Assistant, "__call__", None)  # nothing is attempted
    rows = out.read_bytes()
    again = solve_many(ASSISTANT, file, out, plans, data)
    assert again.solved_now == 0
    assert out.read_bytes() == rows
    assert again.tally.outcomes == first.tally.outcomes
    assert (again.planning_seconds, again.driving_seconds) == (first.planning_seconds, first.driving_seconds)
    monkeypatch.undo()
    monkeypatch.setattr(parts, "PART_PROBLEMS", SIZE)
    assert solve_many(ASSISTANT._replace(seed=2), file, out, plans, data).solved_now == COUNT
    for lost in (plans, data, out):
        shutil.rmtree(lost) if lost.is_dir() else lost.unlink()
        assert solve_many(ASSISTANT._replace(seed=2), file, out, plans, data).solved_now == COUNT
        assert solve_many(ASSISTANT._replace(seed=2), file, out, plans, data).solved_now == 0
    file.write_text(file.read_text().replace("curves-easy-11-0", "another"))
    assert solve_many(ASSISTANT._replace(seed=2), file, out, plans, data).solved_now == COUNT


def test_ctrl_c_loses_no_problem_that_was_solved(
    undisturbed: pd.DataFrame, problems: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, plans = tmp_path / "rows.parquet", tmp_path / "plans"
    asked: list[str] = []
    attempt = Assistant.__call__

    def counted(self: Assistant, problem: Problem) -> tuple[Attempt, Plan | None]:
        asked.append(problem.id)
        if len(asked) == stop_at:
            raise KeyboardInterrupt
        return attempt(self, problem)

    monkeypatch.setattr(Assistant, "__call__", counted)
    monkeypatch.setattr(parts, "PART_PROBLEMS", COUNT)
    for last, done in ((5, 4), (3, 6)):  # within the only part, then again
        asked.clear()
        stop_at = last
        with pytest.raises(KeyboardInterrupt):
            solve_many(ASSISTANT, problems, out, plans)
        assert len(list(plans.iterdir())) == done
        assert not out.exists()
    asked.clear()
    stop_at = -1
    solved = solve_many(ASSISTANT, problems, out, plans)
    assert len(asked) == solved.solved_now == COUNT - 6
    assert equal_but_for_seconds(read_attempts(out), undisturbed)
    assert len(list(plans.iterdir())) == COUNT
    assert {each.name for each in tmp_path.iterdir()} == {"rows.parquet", "plans"}


def test_rows_of_other_options_are_not_replaced_without_a_word(
    problems: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    out, told = tmp_path / "rows.parquet", []
    caplog.set_level(logging.INFO)
    for seed in (1, 2):
        solve_many(ASSISTANT._replace(seed=seed), problems, out)
        told.append(str(out) in caplog.text)
        assert set(read_attempts(out)["seed"]) == {seed}
    assert told == [False, True]


def test_another_question_never_takes_the_parts_of_this_one(
    problems: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "rows.parquet"
    monkeypatch.setattr(parts, "write_attempts", Counting(most=2))
    with pytest.raises(StoppedError):
        solve_many(ASSISTANT, problems, out)
    monkeypatch.setattr(parts, "write_attempts", Counting())
    solve_many(ASSISTANT._replace(seed=2), problems, out)
    assert set(read_attempts(out)["seed"]) == {2}


def test_a_malformed_line_is_named_and_only_its_part_is_left_to_do(
    undisturbed: pd.DataFrame,
    problems: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    path, out = tmp_path / "problems.jsonl", tmp_path / "rows.parquet"
    lines = problems.read_text().splitlines(keepends=True)
    path.write_text("".join([*lines[:4], lines[4].replace('"goal"', '"gaol"'), *lines[5:]]))
    with pytest.raises(StorageError, match=r"problems.jsonl line 5 .*nearest is 'goal'.* All parts"):
        solve_many(ASSISTANT, path, out)
    assert not out.exists()
    wrong = lines[5].replace("[", "[true, ", 1)
    path.write_text("".join([*lines[:4], lines[4].replace('"goal"', '"gaol"'), wrong, *lines[6:]]))
    with pytest.raises(StorageError, match=r"2 problems are malformed"), caplog.at_level("ERROR"):
        solve_many(ASSISTANT, path, out)
    assert "line 5" in caplog.text
    assert "line 6" in caplog.text
    path.write_text("".join(lines))
    counting = Counting()
    monkeypatch.setattr(parts, "write_attempts", counting)
    solve_many(ASSISTANT, path, out)
    assert counting.written == 1
    assert equal_but_for_seconds(read_attempts(out), undisturbed)


def test_an_id_that_occurs_twice_is_named_with_both_lines(problems: Path, tmp_path: Path) -> None:
    path, out = tmp_path / "problems.jsonl", tmp_path / "rows.parquet"
    lines = problems.read_text().splitlines(keepends=True)
    path.write_text("".join(["\n", *lines[:9], lines[1]]))
    with pytest.raises(StorageError, match=r'line 11: id ".*-1" is also that of .*problems.jsonl line 3'):
        solve_many(ASSISTANT, path, out)
    assert not out.exists()


def test_a_file_without_problems_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "p.jsonl").write_text("\n\n")
    with pytest.raises(StorageError, match=r"p.jsonl holds no problems"):
        solve_many(ASSISTANT, tmp_path / "p.jsonl", tmp_path / "rows.parquet")
    (tmp_path / "q.jsonl").write_text("{}\n")
    with pytest.raises(StorageError, match=r"line 1: field start is missing"):
        solve_many(ASSISTANT, tmp_path / "q.jsonl", tmp_path / "rows.parquet")
    assert {each.name for each in tmp_path.iterdir()} == {"p.jsonl", "q.jsonl"}


def test_one_output_is_written_by_one_command(problems: Path, tmp_path: Path) -> None:
    (tmp_path / "rows.parquet.parts").mkdir()
    with (
        locked(tmp_path / "rows.parquet.parts" / ".lock", "other"),
        pytest.raises(StorageError, match=f"in use by another command .process {os.getpid()}."),
    ):
        solve_many(ASSISTANT, problems, tmp_path / "rows.parquet")


def test_what_is_newly_solved_is_learned_once(problems: Path, tmp_path: Path) -> None:
    for out in ("one.parquet", "other.parquet"):
        solve_many(ASSISTANT, problems, tmp_path / out, learn=tmp_path / "data")
    shards = gained_shards(DataFolder(tmp_path / "data").gained("car"))
    assert len(shards) == -(-COUNT // SIZE)


def test_what_ctrl_c_kept_from_being_learned_is_learned_by_the_same_command_again(
    problems: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: Any) -> int:
        raise KeyboardInterrupt

    out, data = tmp_path / "rows.parquet", tmp_path / "data"
    with monkeypatch.context() as stopped:
        stopped.setattr(parts, "remember", interrupted)
        with pytest.raises(KeyboardInterrupt):
            solve_many(ASSISTANT, problems, out, learn=data)
    solve_many(ASSISTANT, problems, out, learn=data)
    assert len(gained_experiences.read_gained(open_data_folder(data).gained("car"), CAR)) == COUNT


def test_answers_are_written_where_learning_fails(
    problems: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, undisturbed: pd.DataFrame
) -> None:
    def fail(*_: Any) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(parts, "remember", fail)
    out = tmp_path / "rows.parquet"
    solved = solve_many(ASSISTANT, problems, out, learn=tmp_path / "data")
    assert "No space left" in solved.unlearned
    assert solved.learned is None
    equal_but_for_seconds(read_attempts(out), undisturbed)


def test_a_damaged_file_of_what_was_learned_is_told_once_and_costs_neither_answers_nor_plans(
    problems: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(gained_experiences, "SHARDS", 0)  # they are merged each time
    folder = open_data_folder(tmp_path / "data").gained("car")
    folder.mkdir(parents=True)
    (folder / "damaged.parquet").write_bytes(b"PAR1")
    out = tmp_path / "rows.parquet"
    command = ["solve", problems, "--planner", "gust", "--out", out, "--learn", tmp_path / "data"]
    assert call([*map(str, command), "--workers", "1", "--quiet"]) == 3
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert str(folder / "damaged.parquet") in told
    assert len(read_attempts(out)) == COUNT
    (folder / "damaged.parquet").unlink()
    assert len(gained_experiences.read_gained(folder, CAR)) == COUNT
