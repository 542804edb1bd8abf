"""Retraining a library: it grows by what was learned, is judged by what it never saw, and survives a kill."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flows.cli.main import call
from planners.attempt import Attempt
from planners.search.query import Limits
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.classes.families import family
from planners.world.vehicles.vehicle import CAR
from storage.archives.libraries import load_library
from storage.errors import StorageError
from storage.places.data_folder import open_data_folder
from storage.tables.attempts import read_attempts
from storage.tables.gained_experiences import snapshots
from storage.vehicles.vehicle_files import label_of
from storage.worlds.importing import ImportSettings
from tasks.champions.conclude import UNOPPOSED
from tasks.champions.drift_watch import LIBRARY, benchmarked_memory
from tasks.champions.promote import roll_back
from tasks.inputs.gained_on_the_job import DIGITS, Solved, question_digest, remember
from tasks.libraries import judge_library as judging
from tasks.libraries import retrain_library as task
from tasks.libraries.challenger import are_plans_missing
from tasks.libraries.judge_library import ALL, ALONE, CHALLENGER, CHAMPION, FEWEST, OTHERS, judged
from tasks.libraries.pending_library import LibraryRetraining, library_dry_run
from tasks.libraries.retrain_library import RetrainedLibrary
from tasks.registry.champion_registry import FIRST, PROMOTED, REFUSED, Registry, Version
from tasks.requests import gather_pieces
from tasks.requests.gather import SourceCounts
from tasks.requests.question_sources import is_held_back
from tasks.requests.verify_folder import verify_folder
from tasks.settings.errors import RunError, UsageError
from tasks.tracking import mlflow_runs
from tests.prepared.mlflow_database import LOUD_LIBRARIES, with_mlflow_database

pytestmark = [pytest.mark.timeout(600), LOUD_LIBRARIES]
ASKED: Final = LibraryRetraining("slots", ("perpendicular",), 3, 0.25, "standard", ImportSettings(), 4, False)


@pytest.fixture
def data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    folder = tmp_path / "data"
    monkeypatch.setenv("MOTION_MEMORY_DATA", str(folder))
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    monkeypatch.setattr(task, "publish_judgements", lambda *_: None)  # no Prefect to tell
    monkeypatch.setattr(gather_pieces, "EFFORT", Limits(expansions=2_000))  # a long search is not needed
    for each in (task, judging):
        monkeypatch.setattr(each, "FEWEST", ASKED.test_problems)
    with_mlflow_database(folder)
    yield folder
    mlflow_runs.tracker.cache_clear()


def _learn(data: Path, seed: int, count: int) -> list[str]:
    """Park on the job; the ids of what was learned."""
    drawn = [to_canonical(family("parallel").draw(seed, index))[0] for index in range(count)]
    remember(data, [Solved(each, solve(each, "lattice")) for each in drawn], CAR)
    return [each.id for each in drawn]


def _to_learn_from(seed: int, count: int) -> set[str]:
    """The names in a library of what is not held back of that which ``_learn`` learned."""
    drawn = [to_canonical(family("parallel").draw(seed, index))[0] for index in range(count)]
    return {f"{each.class_name}-{question_digest(each)[:DIGITS]}" for each in drawn if not is_held_back(each)}


def _versions(data: Path) -> list[Version]:
    return Registry(open_data_folder(data)).versions(ASKED.registered)


def _champion(data: Path) -> int:
    champion = Registry(open_data_folder(data)).aliased(ASKED.registered)
    assert champion is not None
    return champion.number


def _retrain(data: Path, asked: LibraryRetraining = ASKED) -> RetrainedLibrary:
    made = task.retrain_library(data, asked)
    assert made is not None
    return made


def _timed(monkeypatch: pytest.MonkeyPatch, seconds: Callable[[int], float]) -> None:
    """Answers whose time follows from the number of plans: a clock would decide who is champion."""

    def timed(*asked: Any, **named: Any) -> Attempt:
        plans = 0 if asked[4] is None else len(asked[4].plans)
        return replace(solve(*asked, **named), planning_seconds=seconds(plans))

    monkeypatch.setattr(judging, "solve", timed)


def _sooner(plans: int) -> float:
    return 1.0 / (1 + plans)


def _later(plans: int) -> float:
    return 100.0 * (1 + plans)  # longer than any drive that a plan may save


def _alike(_plans: int) -> float:
    return 1.0


def test_a_library_grows_by_what_was_learned_and_is_judged_by_what_it_never_saw(
    data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _timed(monkeypatch, _sooner)
    first = _retrain(data)
    assert (first.verdict, _champion(data)) == (FIRST, 1)
    assert first.version.tag("why").startswith(f"{UNOPPOSED}. Beside the planner without a memory it ")
    assert task.retrain_library(data, ASKED) is None  # nothing new
    _learn(data, 5, 8)
    before = sorted(data.rglob("*.parquet"))
    assert "would be gathered" in library_dry_run(data, ASKED)
    assert sorted(data.rglob("*.parquet")) == before

    def die(*_: Any) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as killed:
        killed.setattr(task, "settle", die)  # in the last moment
        with pytest.raises(KeyboardInterrupt):
            task.retrain_library(data, ASKED)
    assert _champion(data) == 1
    _learn(data, 6, 2)  # waits for the next time
    second = _retrain(data)
    assert (second.verdict, _champion(data), len(_versions(data))) == (PROMOTED, 2, 2)

    old, new = load_library(first.folder), load_library(second.folder)
    assert new.questions[: len(old.questions)] == old.questions
    assert all(
        np.array_equal(one.states, other.states) for one, other in zip(old.plans, new.plans, strict=False)
    )
    added = new.questions[len(old.questions) :]
    assert added
    assert all(each.startswith("parallel") for each in added)
    watched = benchmarked_memory(f"models:/{ASKED.registered}@champion")
    assert watched is not None
    assert (watched.kind, watched.name) == (LIBRARY, f"{ASKED.registered}/2")
    *classes, everything = (each.problems for each in watched.benchmark.values())
    assert sum(classes) == everything == ASKED.test_problems
    rows = read_attempts(data / "judged" / f"{second.folder.name}.parquet")
    assert set(rows["problem_id"]).isdisjoint(new.questions)
    assert set(rows["run_id"]) == {ALONE, CHAMPION, CHALLENGER}
    assert {name.split("-")[0] for name in rows["problem_id"]} == {"perpendicular", "parallel"}
    assert rows["verified"].all()

    assert [change.now for change in roll_back(data, "slots")] == [1]
    third = _retrain(data)  # of what was learned meanwhile, and of what the first does not have
    assert set(added) < set(load_library(third.folder).questions)
    assert _versions(data)[2].tag("against") == "1"
    verify_folder(data, 0.0, 1)  # raises where something is wrong


def test_a_library_that_is_no_better_is_refused_and_not_judged_again(
    data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _timed(monkeypatch, _alike)
    _retrain(data)
    more = ASKED._replace(plans=4)
    assert "not asked for in this way" in library_dry_run(data, more)
    second = _retrain(data, more)
    assert (second.verdict, _champion(data)) == (REFUSED, 1)
    for asked in (ASKED, more):
        assert task.retrain_library(data, asked) is None
        assert "version 1, version 2 was refused; nothing new was learned" in library_dry_run(data, asked)
    with Registry(open_data_folder(data))._client() as client:
        client.delete_registered_model_alias(ASKED.registered, "champion")  # by hand
    assert "would be gathered" in library_dry_run(data, ASKED)  # version 2 was refused for a better one


def test_a_first_library_that_makes_robots_later_is_no_champion(
    data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _timed(monkeypatch, _later)
    first = _retrain(data)
    registry = Registry(open_data_folder(data))
    assert (first.verdict, registry.aliased(ASKED.registered)) == (REFUSED, None)
    assert task.retrain_library(data, ASKED) is None  # it would come out alike
    assert "no champion, version 1 was refused; nothing new was learned" in library_dry_run(data, ASKED)
    _timed(monkeypatch, _sooner)
    _learn(data, 5, 8)
    second = _retrain(data)
    assert (second.verdict, _champion(data)) == (FIRST, 2)


def test_a_dry_run_refuses_what_the_command_refuses(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").touch()
    for place in ("file", "full"):
        for ask in (library_dry_run, task.retrain_library):
            with pytest.raises(StorageError, match="data folder"):
                ask(tmp_path / place, ASKED)
    assert (tmp_path / "full" / "mine.txt").exists()


@given(st.dictionaries(st.text("abc", min_size=1, max_size=2), st.integers(1, 50), min_size=1, max_size=6))
def test_no_verdict_rests_on_a_few_questions_of_a_kind(asked: dict[str, int]) -> None:
    names = [name for name, count in asked.items() for _ in range(count)]
    rows = pd.concat(
        pd.DataFrame(
            {
                "problem_id": range(len(names)), "problem_class": names, "run_id": side, "planner": "lattice",
                "source": "searched", "solved": True, "planning_seconds": 0.1, "duration_s": 8.0,
                "polished": True,
            }
        )
        for side in (ALONE, CHAMPION, CHALLENGER)
    )  # fmt: skip
    judgement = judged(rows)
    for each in (judgement.alone, judgement.champion):
        assert each is not None
        assert not each.passes  # all are equal
        columns = each.columns
        assert columns["problems"].sum() == len(names)
        assert (columns["problems"] >= FEWEST).all() or list(columns["panel"]) == [ALL]
        assert set(columns["panel"]) <= {*names, OTHERS, ALL}
        for name, count in asked.items():
            assert (name in set(columns["panel"])) <= (count >= FEWEST)


def test_one_question_in_four_is_held_back() -> None:
    held = [is_held_back(family("parallel").draw(3, index)) for index in range(400)]
    assert 60 < sum(held) < 140


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        (["trap", "lot"], "trap is the name of a run's memory"),
        (["combined", "lot"], "combined is the name of a run's memory"),
        (["../lots", "lot"], "lots"),
        (["lots", "lot", "--plans", "0"], "0 plans: give 1 or more."),
        (["lots", "lot", "--test-problems", "0"], "0 test problems: give 1 or more."),
        (["lots", "lot", "--poses", "2"], "--poses is 2"),
        (["lots", "lot", "--vehicle", "tram"], "Unknown vehicle 'tram'"),
        (["lots", "--difficulty", "hard"], "--difficulty is of classes and families"),
        (["lots", "lot", "lot"], "lot is given twice"),
        (["trap-car-1-trailer", "lot"], "trap-car-1-trailer is the name of a run's memory"),
        (["lots", "lot", "--seed", "4294967296"], "Seed 4294967296: give one below"),
        (["lots", "dock"], "dock"),
    ],
)
@pytest.mark.parametrize("command", ["retrain-library", "serve-library"])
def test_what_cannot_be_retrained_is_told_in_a_line_before_anything_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str, asked: list[str], told: str
) -> None:
    assert call([command, *asked, "--data", str(tmp_path / "data")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert told in error
    assert not (tmp_path / "data").exists()


@pytest.mark.parametrize(
    "command",
    [["retrain-library", "lots"], ["retrain-library", "lots", "--dry-run"], ["serve-library", "lots"]],
)
def test_without_sources_no_data_folder_is_made(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: list[str]
) -> None:
    assert call([*command, "--data", str(tmp_path / "data")]) == 2
    assert "nothing was learned" in capsys.readouterr().err
    assert not (tmp_path / "data").exists()


def test_two_questions_of_a_champion_decide_nothing(data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _timed(monkeypatch, _sooner)
    few = ASKED._replace(test_problems=1)
    _retrain(data, few)
    _learn(data, 5, 4)
    with pytest.raises(RunError, match="a verdict needs 4"):
        task.retrain_library(data, few)
    assert [each.name.split("-")[1] for each in (data / "libraries").iterdir()] == ["0001"]
    assert _champion(data) == 1


@pytest.mark.parametrize("end", [RunError, KeyboardInterrupt])
def test_a_retraining_that_failed_sees_what_was_learned_since_and_a_killed_one_goes_on(
    data: Path, monkeypatch: pytest.MonkeyPatch, end: type[BaseException]
) -> None:
    def stop(*_: Any) -> None:
        raise end

    asked = ASKED._replace(sources=())
    _learn(data, 6, 4)  # of which two are held back
    with monkeypatch.context() as stopped:
        stopped.setattr(task, "judge_library", stop)
        with pytest.raises(end):
            task.retrain_library(data, asked)
    _learn(data, 5, 4)
    made = _retrain(data, asked)
    begun, since = _to_learn_from(6, 4), _to_learn_from(5, 4)
    assert set(load_library(made.folder).questions) == (begun if end is KeyboardInterrupt else begun | since)


def test_too_few_questions_to_judge_by_are_enough_once_more_were_learned(
    data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _timed(monkeypatch, _sooner)
    asked = ASKED._replace(sources=(), test_problems=200)
    _learn(data, 5, 2)
    _retrain(data, asked)
    _learn(data, 6, 2)
    with pytest.raises(RunError, match="a verdict needs 4"):
        task.retrain_library(data, asked)
    _learn(data, 7, 16)
    second = _retrain(data, asked)
    assert _to_learn_from(7, 16) < set(load_library(second.folder).questions)
    taken = {each.stem for each in snapshots(open_data_folder(data).gained(label_of(CAR)))}
    assert taken == {each.tag("learned") for each in _versions(data)}  # what libraries are made of stays


def test_where_all_that_was_learned_is_held_back_it_is_told(data: Path) -> None:
    drawn = [to_canonical(family("parallel").draw(6, index))[0] for index in range(4)]
    held_back = [each for each in drawn if is_held_back(each)]
    assert remember(data, [Solved(each, solve(each, "lattice")) for each in held_back], CAR) == len(held_back)
    with pytest.raises(RunError):
        task.retrain_library(data, ASKED._replace(sources=()))
    assert not _versions(data)


@pytest.mark.parametrize(("sources", "most_asked", "code"), [([], 0, 0), (["perpendicular"], 4, 3)])
def test_the_exit_code_tells_where_sources_gave_fewer_plans_than_were_asked_for(
    data: Path, monkeypatch: pytest.MonkeyPatch, sources: list[str], most_asked: int, code: int
) -> None:
    def retrained(**given: Any) -> RetrainedLibrary | None:
        return task.retrain_library(data, ASKED._replace(sources=tuple(given["sources"]), plans=5))

    def numbers_of(_request: object) -> int:
        return most_asked

    _learn(data, 5, 4)
    monkeypatch.setattr("flows.retrain_library.retrain_library", retrained)  # in this process
    monkeypatch.setattr("tasks.servers.prefect_server.local_server", lambda _: nullcontext())
    if most_asked:
        monkeypatch.setattr(gather_pieces, "numbers_of", numbers_of)
        monkeypatch.setattr(gather_pieces, "PIECE", most_asked)
    assert call(["retrain-library", "slots", *sources, "--data", str(data)]) == code


@pytest.mark.parametrize(
    ("source", "questions", "answered", "is_missing"),
    [("lot", 15, 3, False), ("lot", 15, 2, True), ("slots.jsonl", 2, 2, False), ("slots.jsonl", 2, 1, True)],
)
def test_files_are_asked_for_what_they_hold_and_what_is_drawn_for_all_plans(
    source: str, questions: int, answered: int, is_missing: bool
) -> None:
    asked = ASKED._replace(sources=(source,))
    learned = SourceCounts("learned", 9, 9, 9, 1.0)
    counts = [SourceCounts(source, questions, answered, answered, 1.0), learned]
    assert are_plans_missing(asked, counts) == is_missing


def test_a_question_that_was_learned_judges_under_whatever_name_it_is_asked(tmp_path: Path) -> None:
    asked = [family("parallel").draw(5, index) for index in range(40)]
    renamed = [replace(to_canonical(each)[0], id=f"job-{number}") for number, each in enumerate(asked)]
    assert [*map(is_held_back, asked)] == [*map(is_held_back, renamed)]
    assert 2 < sum(map(is_held_back, asked)) < 25


def test_all_that_was_learned_is_in_a_library_that_is_gathered_anew(data: Path) -> None:
    _learn(data, 5, 8)
    questions = set(load_library(_retrain(data).folder).questions)
    learned = [to_canonical(family("parallel").draw(5, index))[0] for index in range(8)]
    kept = sum(not is_held_back(each) for each in learned)
    assert kept > ASKED.plans  # or drawn ones could not push any out
    assert sum(each.startswith("parallel") for each in questions) == kept
    assert len(questions) == ASKED.plans + kept


def test_without_sources_and_without_what_was_learned_there_is_nothing_to_gather(data: Path) -> None:
    with pytest.raises(UsageError, match="nothing was learned"):
        task.retrain_library(data, ASKED._replace(sources=()))
