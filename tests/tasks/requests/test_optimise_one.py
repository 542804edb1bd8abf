"""The command that optimises: its files hold a plan, its refusals are one line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from flows.cli.main import call
from planners.optimisation.optimise import DEFAULT_SETTINGS
from planners.world.authority.authority import faults
from planners.world.vehicles.vehicle import CAR_1_TRAILER
from storage.exchange.plans import PlanRecord, read_plan, write_plan
from storage.exchange.problems import read_problems, write_problems
from tests.worlds import problem_of


@pytest.fixture
def problem(tmp_path: Path) -> Path:
    path = tmp_path / "problem.parquet"
    write_problems(path, [problem_of([], "empty")])
    return path


def test_a_straight_line_becomes_a_plan_and_its_plan_a_beginning(
    problem: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second, drawing = (tmp_path / name for name in ("first.json", "second.json", "plan.png"))
    told = ["--out", str(first), "--picture", str(drawing)]
    assert call(["optimise", str(problem), "--straight", *told]) == 0
    told_lines = capsys.readouterr().out.splitlines()
    driver, answer, *lines = (line for line in told_lines if not line.startswith("Still "))  # if it is slow
    assert driver.startswith("vehicle  car, ")
    assert answer.startswith("converged, ")
    assert lines == [f"plan     {first}", f"picture  {drawing}"]
    assert drawing.stat().st_size > 10_000
    record = read_plan(first)
    assert (record.status, record.source, record.planner) == ("solved", "optimised", "straight-line")
    assert record.plan is not None
    assert faults(read_problems(problem)[0], record.plan) == []
    assert call(["optimise", str(problem), "--plan", str(first), "--out", str(second)]) == 0
    again = read_plan(second).plan
    assert again is not None
    assert again.duration_s <= record.plan.duration_s


def test_a_file_without_a_plan_or_of_another_vehicle_is_no_beginning(
    problem: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "none.json"
    write_plan(path, PlanRecord("p", "time-spent", None, "gust", "none", 1.0, None))
    assert call(["optimise", str(problem), "--plan", str(path)]) == 1
    assert "its status is 'time-spent'" in capsys.readouterr().err
    write_plan(path, PlanRecord("p", "time-spent", None, "gust", "none", 1.0, None, CAR_1_TRAILER))
    assert call(["optimise", str(problem), "--plan", str(path)]) == 1
    error = capsys.readouterr().err
    assert "was made for vehicle car-1-trailer" in error
    assert error.count("\n") == 1


def test_a_plan_of_another_problem_is_said_to_be_only_a_guess(
    problem: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own, other = tmp_path / "own.json", tmp_path / "other.json"
    assert call(["optimise", str(problem), "--straight", "--out", str(own)]) == 0
    record = read_plan(own)
    for change in ({"problem_id": "another"}, {"scale": 2.0}):
        write_plan(other, replace(record, **change))  # type: ignore[arg-type]
        capsys.readouterr()
        assert call(["optimise", str(problem), "--plan", str(other)]) == 0
        assert str(other) in capsys.readouterr().err
    assert call(["optimise", str(problem), "--plan", str(own)]) == 0
    assert str(own) not in capsys.readouterr().err


def test_not_to_converge_is_told_and_recorded(
    problem: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(
        "tasks.requests.optimise_one.DEFAULT_SETTINGS", DEFAULT_SETTINGS._replace(iterations=2)
    )
    out = tmp_path / "plan.json"
    assert call(["optimise", str(problem), "--straight", "--out", str(out)]) == 1
    assert "No plan for empty: iterations-spent, 2 iterations" in capsys.readouterr().err
    record = read_plan(out)
    assert (record.plan, record.status, record.source) == (None, "iterations-spent", None)
