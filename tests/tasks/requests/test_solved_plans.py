"""The plans of many problems: a file for each, and they are missed when they are lost."""

from __future__ import annotations

from pathlib import Path

import pytest

from planners.world.classes.problem_classes import problem_class
from storage.exchange.plans import read_plan
from storage.exchange.problems import write_problems
from tasks.requests import problem_parts as parts
from tasks.requests.assistant import AssistantSettings
from tasks.requests.solve_many import solve_many

ASSISTANT = AssistantSettings("gust", "none", 5, None, 1)
COUNT = 11
SIZE = 3  # problems a part


@pytest.fixture
def problems(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(parts, "PART_PROBLEMS", SIZE)
    path = tmp_path / "problems.jsonl"
    write_problems(path, [problem_class("curves", "easy").draw(11, index) for index in range(COUNT)])
    return path


def test_plans_lie_in_one_folder_and_very_many_in_one_a_part(
    problems: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    solve_many(ASSISTANT, problems, tmp_path / "rows.parquet", tmp_path / "few")
    files = sorted((tmp_path / "few").iterdir())
    assert len(files) == COUNT
    assert all(read_plan(file).problem_id == file.stem for file in files)
    monkeypatch.setattr(parts, "MOST_IN_ONE_FOLDER", COUNT - 1)
    solve_many(ASSISTANT, problems, tmp_path / "rows.parquet", tmp_path / "many")
    assert sorted(each.name for each in (tmp_path / "many").rglob("*.json")) == [each.name for each in files]
    assert len(list((tmp_path / "many").iterdir())) == -(-COUNT // SIZE)


@pytest.mark.parametrize("most_in_one_folder", [COUNT, COUNT - 1])
def test_a_command_whose_plans_are_lost_is_not_finished(
    problems: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, most_in_one_folder: int
) -> None:
    monkeypatch.setattr(parts, "MOST_IN_ONE_FOLDER", most_in_one_folder)
    out, plans = tmp_path / "rows.parquet", tmp_path / "plans"
    solve_many(ASSISTANT, problems, out, plans)
    files = sorted(plans.rglob("*.json"))
    assert len(files) == COUNT
    for lost in (files, files[3:4], files[-1:]):
        for file in lost:
            file.unlink()
        assert solve_many(ASSISTANT, problems, out, plans).solved_now == COUNT
        assert sorted(plans.rglob("*.json")) == files
        assert solve_many(ASSISTANT, problems, out, plans).solved_now == 0
