"""What is learned on the job is among the candidates of who asks for it, and the same for equal settings."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planners.memory.plans.experience import Experience
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.families import family
from planners.world.classes.problem_classes import problem_class
from planners.world.problem import Arrival, Problem
from planners.world.vehicles.vehicle import CAR, VEHICLES, Vehicle, trailers_of
from planners.world.workspace import Workspace
from storage.errors import StorageError
from storage.exchange.problems import fields_of
from storage.places.data_folder import open_data_folder
from storage.tables import gained_experiences
from storage.tables.experiences import read_experiences
from tasks.fan_out.chunk import run_folder
from tasks.inputs.gained_on_the_job import Solved, remember, snapshot_of_questions, with_gained
from tasks.settings.presets import for_preset
from tasks.settings.run_settings import RunSettings
from tasks.stages.collect import VARIANTS, candidates_of
from tests.tasks.in_process import collect

SETTINGS = replace(
    for_preset("smoke", classes=["curves"], difficulty="easy", seed=5),
    experiences=3,
    candidates=4,
    test_problems=2,
)


def _solved(problem: Problem) -> Solved:
    return Solved(problem, solve(problem, "gust"))


@pytest.fixture(scope="module")
def solved() -> list[Solved]:
    return [_solved(problem_class("curves", "easy").draw(12, index)) for index in range(5)]


def _candidates(data: Path, settings: RunSettings) -> list[Experience]:
    run = run_folder(str(data), settings)
    return [each for path in run.shards("learned", "curves") for each in read_experiences(path)]


def _questions(data: Path) -> list[Experience]:
    return read_experiences(snapshot_of_questions(data, CAR, f"now-{len(list(data.rglob('*.parquet')))}"))


def test_what_was_learned_is_chosen_among(tmp_path: Path, solved: list[Solved]) -> None:
    assert remember(tmp_path, solved, CAR) == len(solved)
    settings = with_gained(SETTINGS, tmp_path, "monday")
    assert settings.run_name != SETTINGS.run_name
    collect(str(tmp_path), settings)
    learned = _candidates(tmp_path, settings)
    assert {each.problem.id for each in learned} == {problem.id for problem, _ in solved}
    assert not any(fault for each in learned for fault in faults(each.problem, each.plan, CAR))
    kept = read_experiences(run_folder(str(tmp_path), settings).experiences("curves"))
    assert len(kept) == SETTINGS.experiences


def test_what_was_learned_is_as_good_as_what_was_drawn(tmp_path: Path, solved: list[Solved]) -> None:
    remember(tmp_path, solved, CAR)
    settings = with_gained(SETTINGS, tmp_path, "monday")
    collect(str(tmp_path), settings)
    learned = _candidates(tmp_path, settings)
    for problem, attempt in solved:
        theirs = candidates_of(problem, VARIANTS[:-1], settings, CAR, Workspace())
        ours = [each.plan for each in learned if each.problem.id == problem.id]
        assert len(ours) == len(VARIANTS)
        assert attempt.duration_s is not None
        assert all(
            np.array_equal(one.experience.plan.states, other.states)
            for one, other in zip(theirs, ours, strict=False)
        )
        assert ours[-1].duration_s <= attempt.duration_s
    collect(str(tmp_path), published := replace(settings, as_published=True))
    given = {problem.id: attempt.plan for problem, attempt in solved}
    for each in _candidates(tmp_path, published):
        plan = given[each.problem.id]
        assert plan is not None
        assert np.array_equal(each.plan.states, plan.states)


def test_a_name_means_the_same_after_more_was_learned(tmp_path: Path, solved: list[Solved]) -> None:
    remember(tmp_path, solved[:2], CAR)
    before = with_gained(SETTINGS, tmp_path, "monday")
    remember(tmp_path, solved[2:], CAR)
    assert with_gained(SETTINGS, tmp_path, "monday") == before
    assert with_gained(SETTINGS, tmp_path, "tuesday").digest != before.digest
    assert RunSettings.from_json(before.to_json()) == before


def test_problems_that_a_run_tests_with_are_not_learned_from(tmp_path: Path, solved: list[Solved]) -> None:
    asked = problem_class("curves", "easy").draw(2 * SETTINGS.seed + 1, 1)
    remember(tmp_path, [*solved[:1], _solved(asked)], CAR)
    settings = with_gained(SETTINGS, tmp_path, "now")
    collect(str(tmp_path), settings)
    assert {each.problem.id for each in _candidates(tmp_path, settings)} == {solved[0].problem.id}


def test_runs_learn_from_what_begins_straight_ahead_and_libraries_from_the_rest(
    tmp_path: Path, solved: list[Solved]
) -> None:
    turned = [
        _solved(replace(problem, start=(*problem.start[:2], problem.start[2] + 1e-3)))
        for problem, _ in solved[:2]
    ]
    moved = Solved(turned[0].problem, replace(turned[1].attempt, source="repaired"))  # of a memory
    assert remember(tmp_path, [*turned, solved[2], moved], CAR) == 3
    settings = with_gained(SETTINGS, tmp_path, "now")
    collect(str(tmp_path), settings)
    assert {each.problem.id for each in _candidates(tmp_path, settings)} == {solved[2].problem.id}
    kept = _questions(tmp_path)
    assert {tuple(each.problem.start) for each in kept} == {tuple(problem.start) for problem, _ in turned}
    assert not any(fault for each in kept for fault in faults(each.problem, each.plan, CAR))


@pytest.mark.parametrize("vehicle", [CAR, VEHICLES["car-1-trailer"]], ids=["car", "trailer"])
def test_a_question_is_kept_as_it_was_asked(tmp_path: Path, vehicle: Vehicle) -> None:
    given = problem_class("curves", "easy", vehicle).draw(12, 1)
    trailers = len(trailers_of(vehicle))
    arrivals = [
        None,
        Arrival(),
        Arrival(0.5, 0.02, 0.0, 0.0, (0.1,) * trailers, (0.02,) * trailers),
        Arrival(None, 0.0, -1.0, 2.0),
    ]
    motion = (1.5, 0.1, *(0.2,) * trailers)
    attempt = replace(solve(given, "lattice", vehicle=vehicle), source="searched")
    for number, arrival in enumerate(arrivals):
        asked = replace(given, start=(0.0, 0.0, 0.3), start_motion=motion, arrival=arrival, scale=2.0)
        data = tmp_path / str(number)
        assert remember(data, [Solved(asked, attempt)], vehicle) == 1
        (kept,) = read_experiences(snapshot_of_questions(data, vehicle, "now"), vehicle)
        assert fields_of(replace(kept.problem, id=asked.id), vehicle) == fields_of(asked, vehicle)


def test_questions_are_told_apart_by_what_they_ask_and_not_by_their_names(
    tmp_path: Path, solved: list[Solved]
) -> None:
    monday, tuesday = (
        Solved(replace(problem, id="job-1", start=(*problem.start[:2], 0.0)), attempt)
        for problem, attempt in solved[:2]
    )
    for day in (monday, tuesday, monday):
        remember(tmp_path, [day], CAR)
    assert len(_questions(tmp_path)) == 2
    renamed = Solved(
        replace(monday.problem, id="job-7"), replace(monday.attempt, plan=solved[3].attempt.plan)
    )
    remember(tmp_path, [renamed], CAR)
    assert len(_questions(tmp_path)) == 2


def test_recalled_plans_are_nothing_new(tmp_path: Path, solved: list[Solved]) -> None:
    again = [Solved(problem, replace(attempt, source="recalled")) for problem, attempt in solved]
    assert remember(tmp_path, again, CAR) == 0
    with pytest.raises(StorageError, match="holds no learned problems"):
        with_gained(SETTINGS, tmp_path, "now")


@pytest.mark.parametrize("which", [0, 1])
def test_a_damaged_file_of_one_kind_of_problems_keeps_none_from_being_learned(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, solved: list[Solved], which: int
) -> None:
    monkeypatch.setattr(gained_experiences, "SHARDS", 0)  # they are merged each time
    slot = to_canonical(family("parallel").draw(5, 0))[0]
    folder = open_data_folder(tmp_path)
    folders = (folder.gained("car"), folder.gained_questions("car"))
    damaged = folders[which] / "damaged.parquet"
    damaged.parent.mkdir(parents=True)
    damaged.write_bytes(b"PAR1")
    with pytest.raises(StorageError, match=str(damaged)) as error:
        remember(tmp_path, [Solved(slot, solve(slot, "lattice")), *solved], CAR)
    assert str(pickle.loads(pickle.dumps(error.value))) == str(error.value)  # workers send it
    damaged.unlink()
    counts = [len(gained_experiences.read_gained(each, CAR)) for each in folders]
    assert counts == [len(solved), 1]
