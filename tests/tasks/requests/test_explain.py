"""``plan --explain`` says of each recalled plan what is so."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flows.cli.main import call
from planners.attempt import Attempt
from planners.explanation import recollections
from planners.memory.library.plan_library import gathered_library
from planners.memory.memory import Memory
from planners.memory.plans.free import turned
from planners.search.help import PATIENCE
from planners.search.outcome import work_of
from planners.solve import solve
from planners.sub_plan_answers import sub_plan_answer
from planners.world.alignment import to_canonical
from planners.world.classes.families import family
from planners.world.geometry.collision import count_free_prefix, scene_of
from planners.world.geometry.occupancy import drawing_of
from planners.world.problem import CANONICAL_START, Arrival, Problem
from planners.world.vehicles.vehicle import CAR
from planners.world.view import View
from storage.archives.libraries import load_library, save_library
from storage.archives.memories import save_memory
from storage.exchange.problems import write_problems
from storage.tables.attempts import read_attempts
from tests.planners.memories import memory_of
from tests.worlds import box, problem_of, strewn

WALL = problem_of([box(25, 0, 2.35, 9, 1), box(24, 34, 2.35, 26, 0.5)], "wall")


@pytest.fixture(scope="module")
def memory() -> Memory:
    return memory_of([strewn(seed, 30) for seed in range(6)])


@pytest.mark.parametrize("problem", [problem_of([]), WALL, strewn(40, 30)], ids=["empty", "wall", "strewn"])
@pytest.mark.parametrize("assist", ["open", "repair"])
def test_it_says_what_collides_where_and_what_was_used(memory: Memory, problem: Problem, assist: str) -> None:
    attempt = solve(problem, "gust", assist, 4, memory, polished=False)
    helped = work_of(attempt.collision_checks, attempt.expansions) >= PATIENCE
    assert attempt.helped == helped
    looked_at = recollections(problem, attempt, memory)
    assert [each.plan for each in looked_at] == list(attempt.recalled)
    scene, bits = scene_of(problem), drawing_of(problem).occupied.copy()
    for each in looked_at:
        plan = turned(memory.plans[each.plan], problem.start[2])
        free = count_free_prefix(plan.states, CAR, scene)
        assert each.first_blocked == (None if free == len(plan.states) else free)
        shared = memory.masks[each.plan] & bits
        assert each.blocked_cells == sum(int(word).bit_count() for word in shared)
        assert 1 <= each.encoder_rank <= len(memory.plans)
    uses = [each.use for each in looked_at if each.use]
    used = {"recalled": ["answer"], "repaired": ["repaired"], "searched": ["guide"] if helped else []}
    assert uses == used[attempt.source]
    if attempt.source == "recalled":
        answer = next(each for each in looked_at if each.use == "answer")
        np.testing.assert_array_equal(attempt.plan.states, memory.plans[answer.plan].states)
        polished = solve(problem, "gust", assist, 4, memory)
        uses = {each.use: each.plan for each in recollections(problem, polished, memory) if each.use}
        if polished.source == "recalled":
            as_it_is = polished.duration_s == attempt.duration_s
            assert uses == {"answer" if as_it_is else "polished": answer.plan}


def test_the_command_tells_and_draws_it(
    memory: Memory, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save_memory(tmp_path / "memory", memory)
    write_problems(tmp_path / "wall.json", [WALL])
    plain, marked = tmp_path / "plain.png", tmp_path / "marked.png"
    asked = ["plan", str(tmp_path / "wall.json"), "--assist", "open", "--memory", str(tmp_path / "memory")]
    assert call([*asked, "--picture", str(plain)]) == 0
    assert "recall" not in capsys.readouterr().out
    assert call([*asked, "--picture", str(marked), "--explain"]) == 0
    told = capsys.readouterr().out
    attempt = solve(WALL, "lattice", "open", 5, memory, seed=1)
    assert f"{len(attempt.recalled)} of 6 plans of test, none of them free" in told
    rows = [match for line in told.splitlines() if (match := re.match(r"\s*\d+ +(\d+) .* of ", line))]
    assert [int(row[1]) for row in rows] == list(attempt.recalled)
    assert "guided the search" not in told  # the planner is soon done alone
    assert f"{attempt.collision_checks:,} collision checks, {attempt.expansions:,} expansions" in told
    assert "in all" in told
    alone = solve(WALL, "lattice", seed=1)
    assert alone.plan is not None
    assert re.search(rf"alone \S+ ms, {alone.plan.duration_s:.1f} s driven", told)
    assert marked.read_bytes() != plain.read_bytes()
    assert call(["plan", str(tmp_path / "wall.json"), "--explain"]) == 0
    assert "no memory" in capsys.readouterr().out


def test_it_says_that_what_is_left_of_the_current_plan_is_the_answer(
    memory: Memory, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save_memory(tmp_path / "memory", memory)
    write_problems(tmp_path / "open.json", [problem_of([], "open")])
    asked = ["plan", str(tmp_path / "open.json"), "--memory", str(tmp_path / "memory"), "--explain"]
    assert call([*asked, "--planner", "lattice", "--out", str(tmp_path / "driven.json")]) == 0
    capsys.readouterr()
    current = ["--current", str(tmp_path / "driven.json")]
    assert call([*asked, "--planner", "gust", "--unpolished", *current]) == 0
    told = capsys.readouterr().out
    assert "5 of them free, but what is left of the current plan costs no more;" in told
    assert "kept, " in told


def test_places_of_collisions_are_told_in_the_metres_of_a_problem_far_from_the_origin(
    memory: Memory, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save_memory(tmp_path / "memory", memory)
    write_problems(tmp_path / "near.json", [WALL])
    asked = json.loads((tmp_path / "near.json").read_text())
    east = 5_000.0
    asked["start"][0] += east
    asked["goal"][0] += east
    asked["bounds"] = [low + (east if axis % 2 == 0 else 0.0) for axis, low in enumerate(asked["bounds"])]
    asked["obstacles"] = [[[x + east, y] for x, y in polygon] for polygon in asked["obstacles"]]
    (tmp_path / "far.json").write_text(json.dumps(asked))
    places = []
    for name in ("near", "far"):
        plan_it = ["plan", str(tmp_path / f"{name}.json"), "--memory", str(tmp_path / "memory")]
        assert call([*plan_it, "--explain", "--json"]) == 0
        (table,) = json.loads(capsys.readouterr().out)["tables"]
        places.append([tuple(row["first_blocked_m"].values()) for row in table["rows"]])
    np.testing.assert_allclose(places[1], np.add(places[0], (east, 0.0)), atol=0.01)


def test_what_a_memory_is_worth_is_told_of_two_plans_that_were_improved_alike(
    memory: Memory, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def slower(attempt: Attempt, *_: object) -> Attempt:
        return replace(attempt, planning_seconds=attempt.planning_seconds + 1_000.0)

    monkeypatch.setattr("tasks.requests.assistant.improved", slower)
    save_memory(tmp_path / "memory", memory)
    write_problems(tmp_path / "wall.json", [WALL])
    asked = ["plan", str(tmp_path / "wall.json"), "--memory", str(tmp_path / "memory"), "--explain"]
    for improvement, slowed in ((["--improve-seconds", "0.001"], True), ([], False)):
        assert call([*asked, *improvement]) == 0
        worth = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("worth"))
        milliseconds = [float(number) for number in re.findall(r"(\S+) ms", worth)]
        assert [each > 1e6 for each in milliseconds] == [slowed, slowed]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Plans that turn round a wall which no other problem has."""
    found = [solve(strewn(seed, 30), "lattice").plan for seed in range(3)]
    folder = tmp_path_factory.mktemp("library") / "library"
    plans = [("test", plan) for plan in found if plan is not None]
    save_library(folder, gathered_library("test", CAR, plans))
    return folder


def test_it_says_what_parts_of_plans_had_for_a_question(
    library: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stored = load_library(library, CAR)
    told = {}
    pose = Arrival(CANONICAL_START[2], 0.05)
    for question in (replace(strewn(seed, 60), arrival=pose) for seed in range(2, 20)):
        if len(told) == 3:  # recalled; no parts are found; a search finds a quicker plan
            break
        write_problems(tmp_path / "one.json", [question])
        asked = ["plan", str(tmp_path / "one.json"), "--memory", str(library), "--assist", "closed"]
        assert call([*asked, "--explain"]) == 0
        line, *_, source = (line for line in capsys.readouterr().out.splitlines() if line)
        parts = sub_plan_answer(stored, View(to_canonical(question)[0]), CAR)
        searched = source.startswith("searched")
        quicker = searched and parts.recalled and parts.plan is not None
        assert ("quicker" in line) == quicker
        assert not quicker or f"{parts.plan.duration_s:.1f} s" in line
        assert ("no parts" in line) == (searched and parts.plan is None)
        told[source.partition(",")[0], quicker] = line
    assert len(set(told.values())) == len(told) == 3


def test_the_stored_drive_that_was_moved_is_told_and_drawn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stored, asked = (family("parallel").draw(1, number) for number in (0, 1))
    plan = solve(to_canonical(stored)[0], "lattice").plan
    assert plan is not None
    save_library(tmp_path / "library", gathered_library("parallel", CAR, [("stored", plan)]))
    write_problems(tmp_path / "asked.json", [asked], for_it_alone=True)
    told = {}
    for options in ((), ("--explain",)):
        drawing = tmp_path / f"{len(options)}.png"
        plan_it = ["plan", str(tmp_path / "asked.json"), "--memory", str(tmp_path / "library"), *options]
        assert call([*plan_it, "--picture", str(drawing)]) == 0
        told[options] = capsys.readouterr().out, drawing.read_bytes()
    assert "plan 0 of 1 plans" in told[("--explain",)][0]
    assert told[()][1] != told[("--explain",)][1]


@pytest.mark.parametrize("command", ["plan", "solve"])
def test_a_strategy_of_recall_is_refused_for_a_library(
    library: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    write_problems(tmp_path / "one.json", [strewn(20, 30)])
    out = tmp_path / ("plan.json" if command == "plan" else "rows.parquet")
    asked = [command, str(tmp_path / "one.json"), "--memory", str(library), "--out", str(out)]
    assert call([*asked, "--recall", "encoder"]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert "--recall encoder" in told
    assert not out.exists()


def test_a_memory_that_is_given_is_used_whether_an_assist_is_named_or_not(
    memory: Memory, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save_memory(tmp_path / "memory", memory)
    write_problems(tmp_path / "wall.json", [WALL])
    plan = ["plan", str(tmp_path / "wall.json"), "--explain"]
    solve_all = ["solve", str(tmp_path / "wall.json"), "--out", str(tmp_path / "rows.parquet")]
    assert call([*plan, "--memory", str(tmp_path / "memory")]) == 0
    assert "of 6 plans of test" in capsys.readouterr().out
    assert call([*solve_all, "--memory", str(tmp_path / "memory")]) == 0
    assert read_attempts(tmp_path / "rows.parquet")["assist"].tolist() == ["repair"]
    capsys.readouterr()
    for command in (plan, solve_all):
        assert call([*command, "--memory", str(tmp_path / "nowhere")]) == 1
        assert capsys.readouterr().err.count("\n") == 1
