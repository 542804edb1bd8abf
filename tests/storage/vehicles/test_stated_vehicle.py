"""The vehicle of a file of problems: it comes back, is enough by itself, and no other one drives."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flows.cli.main import call
from planners.memory.library.plan_library import gathered_library
from planners.world.problem import Plan
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, DIFFERENTIAL_DRIVE, Vehicle, name_of
from storage.archives.libraries import save_library
from storage.errors import StorageError
from storage.exchange.problems import fields_of, read_problems, vehicle_of_problems, write_problems
from storage.vehicles.definitions import definition_of
from storage.vehicles.vehicle_files import read_vehicle
from tasks.registry.settled_vehicle import settled_vehicle
from tests.tasks.served import write_memory
from tests.worlds import problem_of, strewn

BUS_FILE = Path(__file__).parents[3] / "docs" / "vehicles" / "bus.yaml"
BUS = read_vehicle(BUS_FILE)


@pytest.mark.parametrize("ending", [".json", ".jsonl", ".parquet"])
@pytest.mark.parametrize("vehicle", [DIFFERENTIAL_DRIVE, BUS], ids=["built-in", "of a file"])
def test_a_file_states_its_vehicle_and_refuses_another(tmp_path: Path, ending: str, vehicle: Vehicle) -> None:
    path = tmp_path / f"problems{ending}"
    write_problems(path, [replace(problem_of([]), scale=vehicle.scale)], vehicle)
    stated = vehicle_of_problems(path)
    assert stated is not None
    assert definition_of(stated) == definition_of(vehicle)
    assert len(read_problems(path, stated)) == 1
    with pytest.raises(
        StorageError, match=f"is for vehicle {name_of(vehicle)}, but car-1-trailer is to drive"
    ):
        read_problems(path, CAR_1_TRAILER)


def test_a_problem_for_the_car_states_nothing_and_a_wrong_statement_is_told(tmp_path: Path) -> None:
    path = tmp_path / "problem.json"
    write_problems(path, [problem_of([])], CAR)
    fields = json.loads(path.read_text())
    assert "vehicle" not in fields
    assert vehicle_of_problems(path) is None
    for said in ("tram", "{", 7, ["car"], {"name": "car"}):
        path.write_text(json.dumps(fields | {"vehicle": said}))
        with pytest.raises(StorageError, match="vehicle") as error:
            vehicle_of_problems(path)
        assert "\n" not in str(error.value)


def test_who_names_no_vehicle_gets_that_of_the_problem_or_of_the_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_problems(Path("own.json"), [problem_of([])], DIFFERENTIAL_DRIVE)
    write_problems(Path("any.json"), [problem_of([])])
    write_memory(Path("memory"), plans=3)

    def driver(*words: str) -> str:
        assert call(["plan", *words, "--json"]) == 0
        return str(json.loads(capsys.readouterr().out)["answer"]["vehicle"])

    assert driver("own.json") == "differential-drive"
    assert driver("any.json") == "car"
    assert driver("any.json", "--memory", "memory") == "car"
    controls = np.full((9, 2), 0.1)
    plan = Plan(simulate(np.zeros(6), controls, CAR_1_TRAILER), controls, CAR_1_TRAILER.dt)
    save_library(Path("theirs"), gathered_library("general", CAR_1_TRAILER, [("asked", plan)]))
    assert settled_vehicle(None, Path("any.json"), "theirs") == "car-1-trailer"
    assert settled_vehicle("car", Path("any.json"), "theirs") == "car"


@pytest.mark.parametrize("given", [[], ["--vehicle", "car"], ["--vehicle", "differential-drive"]])
@pytest.mark.parametrize("command", [["plan"], ["solve", "--out", "rows.parquet"]])
def test_no_vehicle_is_advised_where_memory_and_problems_are_for_different_ones(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    given: list[str],
    command: list[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    write_problems(Path("own.json"), [problem_of([])], DIFFERENTIAL_DRIVE)
    write_memory(Path("memory"), plans=3)
    assert call([*command, "own.json", "--memory", "memory", *given]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert {"own.json", "differential-drive", "memory", "car", "`gather`", "`adapt`"} <= set(
        told.replace(",", "").replace(":", "").split()
    )
    assert "--vehicle" not in told


@pytest.mark.parametrize("command", ["plan", "optimise", "solve", "gather"])
@pytest.mark.parametrize(("drawn", "given"), [("car", "differential-drive"), ("bus.yaml", "car")])
def test_a_family_is_for_the_vehicle_it_was_drawn_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str, drawn: str, given: str
) -> None:
    file, out = tmp_path / "slot.json", tmp_path / "out.parquet"
    vehicle = str(BUS_FILE) if drawn == "bus.yaml" else drawn
    draw = ["draw", "parallel", "--problems", "1", "--vehicle", vehicle, "--out", str(file)]
    assert call(draw) == 0
    assert vehicle_of_problems(file) is not None
    wanted = [] if command in ("plan", "optimise") else ["--out", str(out)]
    assert call([command, str(file), "--vehicle", given, *wanted]) != 0
    told = capsys.readouterr().err
    assert f"is for vehicle {drawn.partition('.')[0]}, but {given} is to drive" in told
    assert told.count("\n") == 1
    assert not out.exists()


def test_a_file_names_the_vehicle_of_all_its_problems_or_of_none(tmp_path: Path) -> None:
    stated = json.dumps(fields_of(strewn(1, 5)) | {"vehicle": "car"})
    silent = json.dumps(fields_of(strewn(2, 5)))
    for lines in ((stated, silent), (silent, stated)):
        (tmp_path / "mixed.jsonl").write_text("\n".join(lines))
        with pytest.raises(StorageError, match="line 2"):
            read_problems(tmp_path / "mixed.jsonl")
