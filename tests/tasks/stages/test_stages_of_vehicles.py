"""The whole pipeline for a car with a trailer, tiny and in this process; and that nobody else may use it."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from dashboards.verdicts.comparison import CONTROL, SAME, compare_runs
from planners.world.classes.problem_classes import problem_class
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER
from storage.archives.memories import load_memory
from storage.errors import StorageError
from storage.exchange.plans import read_plan
from storage.exchange.problems import write_problems
from storage.places.run_folder import RunFolder
from storage.tables.attempts import read_attempts
from tasks.fan_out.chunk import run_folder
from tasks.reports.measure_in_turn import MeasuredRun, measure_in_turn
from tasks.requests.assistant import Assistant, AssistantSettings
from tasks.requests.plan_one import plan_one
from tasks.requests.solve_many import solve_many
from tasks.requests.verify_folder import verify_folder
from tasks.settings.presets import for_preset
from tasks.stages.benchmark import BENCHMARK
from tasks.stages.build_memory import BUILD_MEMORY
from tasks.stages.draw_examples import DRAW_EXAMPLES
from tasks.stages.hallucinate import HALLUCINATE
from tasks.stages.train import TRAIN
from tests.flows.same_rows import equal_but_for_seconds
from tests.tasks.in_process import collect, run_stage

PLANNER = "follow"
SETTINGS = replace(
    for_preset("smoke", classes=["trap"], difficulty="easy", planners=[PLANNER], vehicle="car-1-trailer"),
    experiences=3,
    problems_per_experience=5,
    test_problems=3,
    collector=PLANNER,
    epochs=1,
)
WAYS = 1 + len(SETTINGS.assists_of(PLANNER))  # in which a problem is attempted


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    data = str(tmp_path_factory.mktemp("data"))
    collect(data, SETTINGS)
    for stage in (HALLUCINATE, TRAIN, BUILD_MEMORY, BENCHMARK, DRAW_EXAMPLES):
        run_stage(stage, data, SETTINGS)
    return run_folder(data, SETTINGS)


@pytest.fixture
def problems(tmp_path: Path) -> Path:
    drawn = [problem_class("trap", "easy", CAR_1_TRAILER).draw(4, index) for index in range(2)]
    write_problems(tmp_path / "problems.jsonl", drawn)
    return tmp_path / "problems.jsonl"


def test_every_attempt_is_of_the_trailer_and_its_plan_was_judged(run: RunFolder) -> None:
    rows = read_attempts(run.results)
    assert set(rows["vehicle"]) == {"car-1-trailer"}
    assert len(rows) == 3 * WAYS
    assert rows["solved"].all()
    assert rows["verified"].all()


def test_the_memory_holds_the_trailers_angles(run: RunFolder) -> None:
    memory = load_memory(run.memory("trap"), CAR_1_TRAILER)
    assert memory.vehicle == CAR_1_TRAILER
    assert {plan.states.shape[1] for plan in memory.plans} == {6}
    assert max(np.abs(plan.states[:, 5]).max() for plan in memory.plans) > 0.05


def test_its_figures_are_drawn(run: RunFolder) -> None:
    assert (run.figures / "problems-trap.png").stat().st_size > 10_000


def test_verify_makes_the_same_attempts_again(run: RunFolder) -> None:
    checked = verify_folder(run.path.parents[1], sample=1.0, workers=1)
    assert checked["attempts made again"] == 3 * WAYS


def test_attempts_of_earlier_versions_are_made_again_as_they_were(run: RunFolder, tmp_path: Path) -> None:
    data = tmp_path / "data"
    shutil.copytree(run.path.parents[1], data)
    for path in (data / "runs" / run.path.name / "results").rglob("*.parquet"):
        table = pq.read_table(path)
        pq.write_table(table.drop_columns(["polished", "hit"]), path)
    assert verify_folder(data, sample=1.0, workers=1)["attempts made again"] == 3 * WAYS


def test_its_memories_measured_in_turn_do_not_differ_from_themselves(run: RunFolder) -> None:
    side = MeasuredRun(run, SETTINGS)
    first, other = (rows.reset_index(drop=True) for rows in measure_in_turn(side, side, problems=2))
    assert len(first) == 2 * WAYS
    attempt = ["problem_id", "planner", "assist", "top_k", "recall"]
    assert not first.duplicated(attempt).any()
    ours, theirs = (rows.sort_values(attempt).drop(columns="run_id") for rows in (first, other))
    assert equal_but_for_seconds(ours, theirs)
    timed = (rows.assign(planning_seconds=0.01 + 0.001 * rows["expansions"]) for rows in (first, other))
    rows = compare_runs(*timed, in_turn=True)
    assert len(rows) == WAYS
    assert set(rows["verdict"]) == {SAME, CONTROL}


def test_its_memory_solves_problems_of_ones_own(run: RunFolder, problems: Path, tmp_path: Path) -> None:
    settings = AssistantSettings(PLANNER, "open", 3, str(run.path), 1, "car-1-trailer")
    solved = solve_many(settings, problems, tmp_path / "rows.parquet", tmp_path / "plans")
    rows = read_attempts(tmp_path / "rows.parquet")
    assert rows["solved"].all()
    assert solved.tally.hits == rows["hit"].sum()
    found = solve_many(settings._replace(polished=False), problems, tmp_path / "first.parquet")
    first = read_attempts(tmp_path / "first.parquet")
    assert found.tally.hits == first["hit"].sum() == solved.tally.hits
    assert (rows["duration_s"] <= first["duration_s"]).all()
    alone = solve_many(settings._replace(memory=None, assist="none"), problems, tmp_path / "alone.parquet")
    assert alone.tally.hits is None
    for path in (tmp_path / "plans").iterdir():
        plan = read_plan(path, CAR_1_TRAILER).plan
        assert plan is not None
        assert plan.states.shape[1] == 6
        with pytest.raises(StorageError, match="for vehicle car-1-trailer, expected car"):
            read_plan(path, CAR)


def test_its_memory_is_refused_to_the_car(run: RunFolder, problems: Path, tmp_path: Path) -> None:
    settings = AssistantSettings(PLANNER, "open", 3, str(run.path), 1, "car")
    with pytest.raises(StorageError, match="made for vehicle car-1-trailer, expected car"):
        solve_many(settings, problems, tmp_path / "rows.parquet", None)


def test_a_picture_and_a_plan_are_written(run: RunFolder, problems: Path, tmp_path: Path) -> None:
    one = tmp_path / "one.json"
    one.write_text(problems.read_text().splitlines()[0])
    assistant = Assistant(AssistantSettings(PLANNER, "closed", 3, str(run.path), 1, "car-1-trailer"))
    plan_one(assistant, one, tmp_path / "plan.json", tmp_path / "plan.png")
    assert read_plan(tmp_path / "plan.json", CAR_1_TRAILER).plan is not None
    assert (tmp_path / "plan.png").stat().st_size > 10_000
