"""The public interface: what it names, what it answers, and what it needs to be installed."""

from __future__ import annotations

import math
import os
import re
import subprocess
import sys
import typing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import motion_memory
from planners.memory.library.plan_library import gathered_library
from planners.world.classes.families import family
from planners.world.problem import CANONICAL_START, Plan
from planners.world.vehicles.vehicle import CAR, VEHICLES
from storage.archives.libraries import save_library
from storage.archives.memories import load_memory, save_memory
from storage.exchange.problems import fields_of, write_problems
from storage.tables.attempts import read_attempts
from tests.prepared.prefect_database import with_prefect_database
from tests.tasks.served import problem, write_memory
from tests.worlds import strewn

ROOT = Path(__file__).parents[2]
NOT_FOR_ROBOTS = ("prefect", "mlflow", "pandas", "pyarrow", "torch", "casadi", "matplotlib")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_memory(tmp_path_factory.mktemp("public") / "memory")


@pytest.fixture(scope="module")
def memory(folder: Path) -> motion_memory.Memory:
    return motion_memory.load(folder)


def test_a_plan_is_accepted_by_the_judge_and_a_changed_one_is_not(memory: motion_memory.Memory) -> None:
    plan = memory.plan(fields_of(problem(1))).plan
    assert plan is not None
    assert memory.check(problem(1), plan) == []
    off = plan.states.copy()
    off[3:, 0] += 0.1
    assert memory.check(problem(1), Plan(off, plan.controls, plan.dt))


def test_what_is_recalled_is_ranked_and_free_plans_are_accepted(memory: motion_memory.Memory) -> None:
    ranked = memory.recall(problem(0), k=len(memory))
    assert 0 < len(ranked) <= len(memory)
    scores = [each.score for each in ranked[1:]]
    assert scores == sorted(scores, reverse=True)
    free = [each for each in ranked if each.free]
    assert 0 < len(free) < len(ranked)
    assert ranked[0].plan.duration_s == min(each.plan.duration_s for each in free)
    assert memory.recall(problem(0), k=1)[0].number == ranked[0].number
    for each in free:
        assert memory.check(problem(0), each.plan) == []
    with pytest.raises(ValueError, match="k is 0"):
        memory.recall(problem(0), k=0)


@pytest.mark.parametrize("turn", [-2.5, -0.1, 0.3, 1.5])
def test_the_usual_place_is_reached_by_parts_if_the_start_looks_elsewhere(
    memory: motion_memory.Memory, turn: float
) -> None:
    x, y, heading = CANONICAL_START
    asked = replace(strewn(3, 4), start=(x, y, heading + turn))
    (recalled,) = memory.recall(asked)
    assert recalled.free
    assert memory.check(asked, recalled.plan) == []
    answer = replace(memory, polished=False).plan(asked)
    assert (answer.status, answer.source) == ("solved", "recalled")


@pytest.fixture(scope="module")
def alone() -> motion_memory.Memory:
    return motion_memory.load(None)


def test_a_planner_needs_no_memory(alone: motion_memory.Memory) -> None:
    answer = alone.plan(problem(0))
    assert (answer.status, answer.source, len(alone)) == ("solved", "searched", 0)
    with pytest.raises(motion_memory.UsageError, match="without a memory"):
        alone.recall(problem(0))
    with pytest.raises(motion_memory.UsageError, match="'repair' needs a memory"):
        motion_memory.load(None, assist="repair")
    jackal = motion_memory.load(None, vehicle=str(ROOT / "docs" / "vehicles" / "jackal.yaml"), warm=False)
    assert jackal.vehicle.scale < 1.0


@pytest.mark.parametrize("planner", ["lattice", "gust"])
def test_a_limit_that_is_not_reached_changes_nothing(alone: motion_memory.Memory, planner: str) -> None:
    by = replace(alone, planner=planner)
    free, limited, none = (by.plan(problem(1), time_limit=limit) for limit in (None, 1e6, 1e-9))
    assert free.plan is not None
    assert limited.plan is not None
    assert np.array_equal(free.plan.states, limited.plan.states)
    assert none.status == "time-spent" if none.plan is None else not alone.check(problem(1), none.plan)


def test_an_improved_plan_is_never_driven_longer(memory: motion_memory.Memory) -> None:
    rough = replace(memory, polished=False)
    for by in (rough, replace(rough, assist="none")):
        before, after = by.plan(problem(2)), by.plan(problem(2), improve_seconds=0.05)
        assert before.plan is not None
        assert after.plan is not None
        assert after.plan.duration_s <= before.plan.duration_s
        assert after.planning_seconds >= 0.05
        assert not memory.check(problem(2), after.plan)


@pytest.mark.parametrize("given", [-1.0, math.nan, math.inf, "1", True])
@pytest.mark.parametrize("name", ["time_limit", "improve_seconds"])
def test_a_time_is_a_number_of_seconds(alone: motion_memory.Memory, name: str, given: Any) -> None:
    with pytest.raises(motion_memory.UsageError, match=name):
        alone.plan(problem(0), **{name: given})
    with pytest.raises(motion_memory.UsageError, match="time_limit is 0"):
        alone.plan(problem(0), time_limit=0.0)


def test_a_library_and_a_memory_recall_an_answer_to_any_question(
    memory: motion_memory.Memory, tmp_path: Path
) -> None:
    plans = [(str(number), plan) for number, plan in enumerate(memory.stored.plans)]
    save_library(tmp_path / "library", gathered_library("random", CAR, plans))
    library = motion_memory.load(tmp_path / "library")
    with pytest.raises(motion_memory.UsageError, match="is a library"):
        motion_memory.load(tmp_path / "library", recall="encoder")
    asked = replace(strewn(3, 10), goal=(22.0, 20.0), start_motion=(1.0,))
    for stored in (memory, library):
        (answer,) = stored.recall(asked)
        assert answer.free
        assert stored.check(asked, answer.plan) == []


def test_a_memory_and_a_library_of_problems_of_any_scale_are_loaded(folder: Path, tmp_path: Path) -> None:
    memory = load_memory(folder)
    twice = replace(problem(0), scale=2.0)
    save_memory(tmp_path / "memory", replace(memory, metadata={**memory.metadata, "scales": [2.0]}))
    plans = [(str(number), plan) for number, plan in enumerate(memory.plans)]
    save_library(tmp_path / "library", gathered_library("random", CAR, plans, (2.0,)))
    for name in ("memory", "library"):
        assert motion_memory.load(tmp_path / name).plan(twice).plan is not None


def test_every_public_name_is_typed_and_explained() -> None:
    assert all((ROOT / package / "py.typed").is_file() for package in ("motion_memory", "planners", "tasks"))
    for name in motion_memory.__all__:
        value = getattr(motion_memory, name)
        assert name in (ROOT / "docs" / "python.md").read_text()
        if callable(value) and not typing.get_origin(value):
            assert value.__doc__


def test_what_goes_wrong_is_caught_by_its_public_name(
    memory: motion_memory.Memory, folder: Path, tmp_path: Path
) -> None:
    with pytest.raises(motion_memory.StorageError):
        motion_memory.load(tmp_path)
    with pytest.raises(motion_memory.StorageError):
        motion_memory.load(folder, vehicle="car-1-trailer")
    with pytest.raises(motion_memory.UsageError):
        motion_memory.load(folder, planner="luck")
    with pytest.raises(motion_memory.UsageError, match="'no'"):
        motion_memory.load(folder, polished="no")
    for wrong in (
        {"top_k": 2.5}, {"seed": -1}, {"seed": 1.5}, {"seed": "a"},
        {"planner": 3}, {"planner": ["lattice"]}, {"assist": ""}, {"vehicle": 3},
    ):  # fmt: skip
        with pytest.raises(motion_memory.UsageError):
            motion_memory.load(folder, **wrong)
    asked = {"problems": tmp_path / "problems.jsonl", "out": tmp_path / "rows.parquet"}
    for wrong in (
        {"polished": "no"},
        {"seed": "1"},
        {"top_k": True},
        {"plans": 3},
        {"problems": [problem(0)]},
    ):
        with pytest.raises(motion_memory.UsageError):
            motion_memory.solve_many(**asked | wrong)
    for k in (0, 2.5, True, "2"):
        with pytest.raises(ValueError, match=repr(k)):
            memory.recall(problem(0), k=k)
    with pytest.raises(ValueError, match="goal"):
        memory.plan(fields_of(problem(0)) | {"goal": [1]})


def test_many_are_solved_as_by_the_command(folder: Path, tmp_path: Path) -> None:
    write_problems(tmp_path / "problems.jsonl", [problem(i) for i in range(3)])
    assert len(motion_memory.read_problems(tmp_path / "problems.jsonl")) == 3
    motion_memory.solve_many(tmp_path / "problems.jsonl", tmp_path / "rows.parquet", memory=folder)
    assert read_attempts(tmp_path / "rows.parquet")["solved"].all()


def test_without_a_vehicle_that_of_the_file_is_meant(tmp_path: Path) -> None:
    vehicle = VEHICLES["differential-drive"]
    asked = family("parallel", vehicle=vehicle).draw(1, 0)
    write_problems(tmp_path / "problems.jsonl", [asked], vehicle, for_it_alone=True)
    assert len(motion_memory.read_problems(tmp_path / "problems.jsonl")) == 1
    motion_memory.solve_many(tmp_path / "problems.jsonl", tmp_path / "rows.parquet")
    assert read_attempts(tmp_path / "rows.parquet")["solved"].all()
    with pytest.raises(motion_memory.StorageError, match="differential-drive"):
        motion_memory.read_problems(tmp_path / "problems.jsonl", vehicle="car")


def test_problems_are_cut_from_a_map(tmp_path: Path) -> None:
    np.save(tmp_path / "map.npy", np.zeros((220, 220), bool))
    cut = motion_memory.read_worlds(tmp_path / "map.npy", count=2, resolution=1.0)
    assert len(cut) == 2


@pytest.mark.parametrize(
    "wrong",
    [{"count": 0}, {"count": -1}, {"count": 2.5}, {"count": True}, {"count": "2"}, {"seed": -1},
     {"seed": 1.5}, {"seed": "1"}, {"vehicle": "tram"}, {"vehicle": None}, {"path": 3}],
)  # fmt: skip
def test_wrong_numbers_and_names_are_refused_before_a_map_is_read(
    wrong: dict[str, Any], tmp_path: Path
) -> None:
    np.save(tmp_path / "map.npy", np.zeros((220, 220), bool))
    asked = {"path": tmp_path / "map.npy", "count": 2, "resolution": 1.0}
    with pytest.raises(motion_memory.UsageError):
        motion_memory.read_worlds(**asked | wrong)


@pytest.mark.parametrize("resolution", [0, -1.0, float("nan"), float("inf"), "1"])
def test_a_resolution_that_is_no_length_is_refused(resolution: Any, tmp_path: Path) -> None:
    np.save(tmp_path / "map.npy", np.zeros((220, 220), bool))
    with pytest.raises((ValueError, motion_memory.StorageError), match="resolution"):
        motion_memory.read_worlds(tmp_path / "map.npy", count=2, resolution=resolution)


def test_a_file_of_which_nothing_can_be_used_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "cut.json").write_text('{"start": [0, 0')
    with pytest.raises(motion_memory.StorageError, match="holds no usable problem"):
        motion_memory.read_worlds(tmp_path / "cut.json")


def test_importing_it_needs_nothing_that_a_robot_has_not() -> None:
    code = f"import motion_memory, sys; print([m for m in {NOT_FOR_ROBOTS} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.slow  # a server of Prefect is started for it
def test_the_flow_in_the_documentation_runs(folder: Path, tmp_path: Path) -> None:
    examples = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "python.md").read_text(), re.DOTALL)
    (example,) = [each for each in examples if "@flow" in each]
    (tmp_path / "example.py").write_text(example)
    write_problems(tmp_path / "problems.jsonl", [problem(i) for i in range(3)])
    home = with_prefect_database(tmp_path / "data") / "prefect"
    done = subprocess.run(
        [sys.executable, "-m", "tests.motion_memory.run_example",
         *map(str, (tmp_path / "example.py", tmp_path / "problems.jsonl", folder))],
        cwd=ROOT, env={**os.environ, "PREFECT_HOME": str(home), "DO_NOT_TRACK": "true"},
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.stdout.split() == ["3"], done.stderr[-2000:]
