"""``verify`` of memories, libraries and plan files: each plan is judged, and each fault is told."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flows.cli.main import call
from planners.memory.library.plan_library import gathered_library
from planners.world.classes.problem_classes import problem_class
from planners.world.problem import Plan
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR
from storage.archives.libraries import save_library
from storage.exchange.problems import write_problems
from storage.places.data_folder import open_data_folder
from tests.tasks.served import write_memory
from tests.worlds import box, problem_of


def _driven(acceleration: float, steps: int = 40) -> Plan:
    controls = np.tile([acceleration, 0.0], (steps, 1))
    return Plan(simulate(np.zeros(5), controls, CAR), controls, CAR.dt)


def test_the_plans_of_a_memory_and_of_a_library_are_judged(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_memory(tmp_path / "memory", plans=4)
    assert call(["verify", str(tmp_path / "memory")]) == 0
    assert "4 plans" in capsys.readouterr().out
    slow, fast = _driven(0.5 * CAR.max_acceleration, 10), _driven(2.0 * CAR.max_acceleration)
    save_library(tmp_path / "library", gathered_library("general", CAR, [("slow", slow)]))
    assert call(["verify", str(tmp_path / "library")]) == 0
    save_library(tmp_path / "library", gathered_library("general", CAR, [("slow", slow), ("fast", fast)]))
    assert call(["verify", str(tmp_path / "library")]) == 1
    told = capsys.readouterr().err
    assert "plan 1" in told
    assert "plan 0" not in told


def test_libraries_in_a_data_folder_are_judged_with_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "data" / "libraries" / "general"
    open_data_folder(tmp_path / "data")
    for acceleration, code in ((0.5, 0), (2.0, 1)):
        plan = _driven(acceleration * CAR.max_acceleration)
        save_library(folder, gathered_library("general", CAR, [("one", plan)]))
        assert call(["verify", str(tmp_path / "data")]) == code
    assert "plan 0" in capsys.readouterr().err


def test_a_folder_of_something_else_is_refused_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(["verify", str(tmp_path)]) == 1
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("far_m", [0.0, 9_484_378_811.0])
def test_plans_in_files_are_judged_in_their_problems_or_by_themselves(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], far_m: float
) -> None:
    problems, plans = tmp_path / "problems.jsonl", tmp_path / "plans"
    near = [problem_class("random").draw(5, index) for index in range(3)]
    write_problems(problems, [replace(each, offset=(far_m, -far_m)) for each in near])
    assert call(["solve", str(problems), "--out", str(tmp_path / "rows.parquet"), "--plans", str(plans)]) == 0
    capsys.readouterr()
    for options in ([], ["--problems", str(problems)]):
        assert call(["verify", str(plans), *options, "--json"]) == 0
        assert sum(json.loads(capsys.readouterr().out)["answer"]["checked"].values()) == 3

    one, broken = plans / f"{near[0].id}.json", plans / "broken.json"
    broken.write_text((plans / f"{near[1].id}.json").read_text().replace('"dt": ', '"dt": 1'))
    (plans / "twin.json").write_text(one.read_text())
    assert call(["verify", str(plans), "--problems", str(problems)]) == 1
    assert "broken.json" in capsys.readouterr().err
    broken.unlink()

    fields = json.loads(one.read_text())
    fields["controls"][3][0] += 0.01  # no longer what leads from state to state
    one.write_text(json.dumps(fields))
    for options in ([], ["--problems", str(problems)]):
        assert call(["verify", str(plans), *options]) == 1
        told = capsys.readouterr().err
        assert one.name in told
        assert "twin" not in told
        assert near[1].id not in told


def test_a_plan_is_judged_in_the_world_as_it_is_now(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    world, changed, plan = (tmp_path / name for name in ("world.json", "changed.json", "plan.json"))
    free = problem_of([], "room")
    write_problems(world, [free])
    assert call(["plan", str(world), "--out", str(plan)]) == 0
    x, y = np.array(json.loads(plan.read_text())["states"])[40, :2].tolist()
    write_problems(changed, [problem_of([box(x, y, 0.0, 1.0, 1.0)], "room-with-a-box")])
    assert call(["verify", str(plan), "--problems", str(world)]) == 0
    capsys.readouterr()
    assert call(["verify", str(plan), "--problems", str(changed)]) == 1
    told = capsys.readouterr().err
    assert "room-with-a-box" in told
    assert "Collision" in told
    write_problems(changed, [replace(free, scale=0.5)])
    assert call(["verify", str(plan), "--problems", str(changed)]) == 1
    assert "Scale" in capsys.readouterr().err


def test_problems_are_refused_beside_what_holds_no_plan_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_memory(tmp_path / "memory", plans=4)
    write_problems(tmp_path / "room.json", [problem_of([], "room")])
    assert call(["verify", str(tmp_path / "memory"), "--problems", str(tmp_path / "room.json")]) == 2
    assert call(["verify", str(tmp_path / "memory"), "--map", str(tmp_path / "room.map")]) == 2
    assert call(["verify", str(tmp_path / "room.json")]) == 1
    assert capsys.readouterr().err.count("\n") == 3


def test_of_a_route_it_is_told_that_its_map_is_not_looked_at(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    town, drive = str(tmp_path / "town.npy"), str(tmp_path / "drive.json")
    np.save(town, np.zeros((160, 160), np.uint8))
    assert call(["route", town, "--from", "20,20,0", "--to", "120,120", "--out", drive]) == 0
    assert call(["verify", drive]) == 0
    assert "--map" in capsys.readouterr().out
    assert call(["verify", drive, "--map", town]) == 0
    assert "--map" not in capsys.readouterr().out
