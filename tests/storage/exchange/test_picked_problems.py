"""One problem is taken out of a file of many."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.world.problem import BOUNDS, Problem
from storage.errors import StorageError
from storage.exchange.problems import read_problem, write_problems
from tests.storage.samples import problems, quick, same_problem

GOOD: dict[str, Any] = {
    "start": [0.0, 0.0, 0.785],
    "goal": [50.0, 50.0],
    "bounds": list(BOUNDS),
    "obstacles": [],
}


@quick
@given(
    found=st.lists(problems(), min_size=2, max_size=4, unique_by=lambda problem: problem.id),
    ending=st.sampled_from([".jsonl", ".parquet"]),
)
def test_each_problem_of_a_file_can_be_picked_by_its_id_or_its_number(
    tmp_path_factory: pytest.TempPathFactory, found: list[Problem], ending: str
) -> None:
    path = tmp_path_factory.getbasetemp() / f"many{ending}"
    found = [replace(problem, id=f"p-{problem.id}") for problem in found]  # no id is a number
    write_problems(path, found)
    for number, problem in enumerate(found, start=1):
        assert same_problem(read_problem(path, pick=problem.id), problem)
        assert same_problem(read_problem(path, pick=str(number)), problem)
    for wrong in (None, "0", str(len(found) + 1), "another"):
        with pytest.raises(StorageError, match=f"holds {len(found)} problems.*--pick"):
            read_problem(path, pick=wrong)


@pytest.mark.parametrize("pick", ["2", "lot-1"])
def test_who_picks_is_told_which_problem_it_is_by_id_and_line(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, pick: str
) -> None:
    path = tmp_path / "lots.jsonl"
    path.write_text("".join(json.dumps(GOOD | {"id": f"lot-{number}"}) + "\n" for number in range(3)))
    with caplog.at_level("INFO"):
        assert read_problem(path, pick=pick).id == "lot-1"
    (told,) = caplog.messages
    assert "lot-1" in told
    assert "line 2" in told


def test_who_picks_nothing_that_is_there_is_told_how_both_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "lots.jsonl"
    path.write_text("".join(json.dumps(GOOD | {"id": f"lot-{number}"}) + "\n" for number in range(3)))
    for wrong in (None, "0", "4", "lot-3"):
        with pytest.raises(StorageError, match=r"'lot-0'.*1 to 3"):
            read_problem(path, pick=wrong)


def test_an_id_is_picked_before_a_number_and_lines_count_as_messages_count_them(tmp_path: Path) -> None:
    first, second, third = (json.dumps(GOOD | {"id": name}) for name in ("a", "1", ""))
    path = tmp_path / "mine.jsonl"
    path.write_text(f"{first}\n\n{second}\n{third}\nno problem")
    assert read_problem(path, pick="1").id == "1"
    assert read_problem(path, pick="mine-4").id == "mine-4"
    path.write_text(f"{first}\n\n{second}\n{third}\n")
    assert read_problem(path, pick="3").id == "1"
    path.write_text(f"{first}\n")
    assert read_problem(path).id == read_problem(path, pick="1").id == "a"
