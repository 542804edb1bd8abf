"""The picture of the first problems of a file and of the plans that ``solve`` found for them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from dashboards.figures import pictures
from dashboards.figures.pictures import Example
from planners.world.authority.authority import faults
from planners.world.classes.problem_classes import problem_class
from storage.exchange.problems import read_problems, write_problems
from tasks.requests import problem_parts
from tasks.requests.assistant import AssistantSettings
from tasks.requests.solve_many import solve_many
from tasks.settings.errors import UsageError

ASSISTANT = AssistantSettings("gust", "none", 5, None, 1)
COUNT = 8
SIZE = 3  # problems a part


@pytest.fixture
def problems(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(problem_parts, "PART_PROBLEMS", SIZE)
    path = tmp_path / "problems.jsonl"
    write_problems(path, [problem_class("curves", "easy").draw(11, index) for index in range(COUNT)])
    return path


def test_the_first_problems_and_their_plans_are_drawn(
    problems: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[Sequence[Example]] = []
    real = pictures.gallery

    def gallery(examples: Sequence[Example], title: str) -> Figure:
        drawn.append(examples)
        return real(examples, title)

    monkeypatch.setattr(pictures, "gallery", gallery)
    rows, plans, drawing = tmp_path / "rows.parquet", tmp_path / "plans", tmp_path / "plans.png"
    for _ in range(2):  # of finished rows, too
        solve_many(ASSISTANT, problems, rows, plans, drawing=drawing)
        assert drawing.stat().st_size > 10_000
        drawing.unlink()
    asked = read_problems(problems)
    for examples in drawn:
        assert [example.problem.id for example in examples] == [each.id for each in asked[: len(examples)]]
        assert SIZE < len(examples) < COUNT
        for example in examples:
            assert example.answer is not None
            assert not faults(example.problem, example.answer)
    with pytest.raises(UsageError, match="--plans"):
        solve_many(ASSISTANT, problems, rows, drawing=drawing)
    for file in (problems, tmp_path / "new.parquet"):
        with pytest.raises(UsageError, match="is a file"):
            solve_many(ASSISTANT, problems, tmp_path / "new.parquet", file)
