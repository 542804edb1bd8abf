"""A robot's own process learns what the commands learn, once, and nothing that is wrong."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import motion_memory
from planners.world.classes.families import family
from planners.world.problem import Plan
from planners.world.vehicles.vehicle import CAR
from storage.exchange.problems import fields_of, write_problems
from storage.places.data_folder import DataFolder
from storage.tables.gained_experiences import read_gained
from tests.tasks.served import problem, write_memory


@pytest.fixture(scope="module")
def memory(tmp_path_factory: pytest.TempPathFactory) -> motion_memory.Memory:
    return motion_memory.load(write_memory(tmp_path_factory.mktemp("taught") / "memory"))


QUESTIONS = [family("parallel").draw(5, index) for index in range(3)]


def _learned(data: Path) -> dict[str, bytes]:
    """The plans of general questions in a data folder, by id."""
    kept = read_gained(DataFolder(data).gained_questions("car"), CAR)
    return {each.experience.problem.id: each.experience.plan.states.tobytes() for each in kept}


def test_a_robot_learns_what_the_command_learns_and_nothing_twice(tmp_path: Path) -> None:
    alone = motion_memory.load(None, warm=False)
    answers = [alone.plan(fields_of(each)) for each in QUESTIONS]
    data = tmp_path / "data"
    assert alone.learn(answers, data) == len(QUESTIONS)
    kept = _learned(data)
    assert len(kept) == len(QUESTIONS)
    for answer in answers:
        alone.learn(answer, str(data))
    assert _learned(data) == kept
    write_problems(tmp_path / "problems.jsonl", QUESTIONS)
    motion_memory.solve_many(
        tmp_path / "problems.jsonl", tmp_path / "rows.parquet", learn=tmp_path / "command"
    )
    assert _learned(tmp_path / "command") == kept


def test_what_a_memory_had_is_not_learned(memory: motion_memory.Memory, tmp_path: Path) -> None:
    answers = [memory.plan(fields_of(problem(number))) for number in range(8)]
    recalled = [each for each in answers if each.source == "recalled"]
    assert recalled
    assert memory.learn(recalled, tmp_path / "data") == 0
    assert memory.learn([], tmp_path / "data") == 0
    assert memory.learn(answers, tmp_path / "data") == sum(
        each.source in ("searched", "repaired") for each in answers
    )


def test_a_plan_that_is_wrong_is_not_learned(tmp_path: Path) -> None:
    alone = motion_memory.load(None, warm=False, judged=False)
    answer = alone.plan(fields_of(QUESTIONS[0]))
    ((asked, attempt, vehicle),) = answer._found
    assert attempt.plan is not None
    off = attempt.plan.states.copy()
    off[3:, 0] += 0.1
    wrong = replace(attempt, plan=Plan(off, attempt.plan.controls, attempt.plan.dt))
    with pytest.raises(motion_memory.PlanFaultError):
        alone.learn([answer, replace(answer, _found=((asked, wrong, vehicle),))], tmp_path / "data")
    assert not (tmp_path / "data").exists()


@pytest.mark.parametrize("given", [7, [7], "answer", [None]])
def test_what_is_no_answer_is_not_learned(memory: motion_memory.Memory, tmp_path: Path, given: Any) -> None:
    with pytest.raises(motion_memory.UsageError, match="give what"):
        memory.learn(given, tmp_path / "data")
    assert not (tmp_path / "data").exists()


def test_a_robot_without_pyarrow_is_told_what_learning_needs(
    memory: motion_memory.Memory, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for name in [
        name for name in sys.modules if name.startswith(("pyarrow", "tasks.inputs", "storage.tables"))
    ]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(motion_memory.RunError, match="pip install pyarrow"):
        memory.learn([], tmp_path / "data")


def test_straight_problems_without_a_name_are_all_learned(tmp_path: Path) -> None:
    alone = motion_memory.load(None, warm=False)
    asked = [{name: value for name, value in fields_of(problem(k)).items() if name != "id"} for k in range(3)]
    answers = [alone.plan(each) for each in asked]
    assert alone.learn(answers, tmp_path) == 3
    kept = read_gained(DataFolder(tmp_path).gained("car"), CAR)
    plans = {answer.plan.states.tobytes() for answer in answers if answer.plan is not None}
    assert len(kept) == len(plans) > 1


def test_answers_of_another_vehicle_are_not_learned(tmp_path: Path) -> None:
    answer = motion_memory.load(None, warm=False).plan(fields_of(QUESTIONS[0]))
    other = motion_memory.load(None, vehicle="differential-drive", warm=False)
    with pytest.raises(motion_memory.UsageError, match="car drives"):
        other.learn(answer, tmp_path / "data")


def test_who_found_a_plan_is_kept_with_it(tmp_path: Path) -> None:
    planners = ["lattice", "gust"]
    answers = [
        motion_memory.load(None, planner=name, warm=False).plan({**fields_of(problem(k)), "id": name})
        for k, name in enumerate(planners)
    ]
    motion_memory.load(None, warm=False).learn(answers, tmp_path)
    kept = read_gained(DataFolder(tmp_path).gained("car"), CAR)
    assert sorted((each.experience.problem.id, each.planner) for each in kept) == [
        (name, name) for name in sorted(planners)
    ]
