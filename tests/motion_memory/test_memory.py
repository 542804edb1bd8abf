"""The call for a robot's process: the same plans as the command's, without what a robot has not."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from threading import Thread

import numpy as np
import pytest

from motion_memory import Answer, Memory, load
from planners.search.connection.pose_table import seconds_to_pose
from planners.world.authority.authority import faults
from planners.world.problem import BOUNDS, Arrival, obstacles_of
from planners.world.vehicles.vehicle import CAR
from storage.archives.memories import load_memory, save_memory
from storage.errors import StorageError
from storage.exchange.problems import fields_of
from tasks.requests.assistant import Assistant, AssistantSettings
from tasks.settings.errors import RunError, UsageError
from tests import worlds
from tests.storage.samples import box
from tests.tasks.served import problem, write_memory

ROOT = Path(__file__).parents[2]
COUNT = 8


@pytest.fixture(scope="module")
def memory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_memory(tmp_path_factory.mktemp("robot") / "memory")


@pytest.fixture(scope="module")
def planner(memory: Path) -> Memory:
    return load(memory)


def test_it_answers_as_the_command_does(planner: Memory, memory: Path) -> None:
    assistant = Assistant(AssistantSettings("lattice", "repair", 5, str(memory), 1))
    unpolished = replace(planner, polished=False)
    for i in range(COUNT):
        attempt, plan = assistant(problem(i))
        answer = planner.plan(problem(i))
        assert (answer.status, answer.source) == (attempt.status, attempt.source)
        assert plan is not None
        assert same(answer, planner.plan(fields_of(problem(i)) | {"id": answer.problem_id}))
        assert same(answer, planner.plan(json.dumps(fields_of(problem(i)))))
        given = problem(i)
        vertices, polygon_starts, _ = given.obstacles
        arrays = planner.plan_arrays(given.start, given.goal, vertices, polygon_starts)
        assert arrays.plan is not None
        assert 0.0 < arrays.planning_seconds < arrays.call_seconds
        named = unpolished.plan(problem(i))  # a search's random numbers depend on the name
        nameless = unpolished.plan_arrays(given.start, given.goal, vertices, polygon_starts)
        assert same(replace(named, problem_id=nameless.problem_id), nameless) or named.source != "recalled"
        assert answer.plan is not None
        assert np.array_equal(answer.plan.states, plan.states)
        assert faults(problem(i), answer.plan, CAR) == []


def test_any_question_may_be_asked_in_arrays_and_in_json(planner: Memory) -> None:
    nothing, none = np.empty((0, 2)), np.zeros(1, np.int64)
    arrival = Arrival(0.5, 1.5, 0.0, 3.0)
    answer = planner.plan_arrays(
        *((20.0, 10.0, -2.0), (5.0, 20.0), nothing, none), start_motion=(2.0, -0.3), arrival=arrival
    )
    assert answer.plan is not None
    assert answer.source in ("recalled", "searched")
    assert answer.plan.states[0] == pytest.approx((20.0, 10.0, -2.0, 2.0, -0.3))
    assert abs(math.remainder(answer.plan.states[-1, 2] - 0.5, math.tau)) <= 1.5
    fields = {"start": [20, 10, -2], "goal": [5, 20, 0.5], "bounds": list(BOUNDS), "obstacles": []}
    asked = {"start_speed": 2, "start_steering": -0.3, "goal_tolerance": [2, 1.5], "goal_speed": [0, 3]}
    again = planner.plan(fields | asked)
    assert again.plan is not None
    assert np.array_equal(again.plan.states, answer.plan.states)
    with pytest.raises(ValueError, match="start speed is 9"):
        planner.plan(fields | {"start_speed": 9})


def same(one: Answer, other: Answer) -> bool:
    assert one.plan is not None
    assert other.plan is not None
    return np.array_equal(one.plan.states, other.plan.states) and one.problem_id == other.problem_id


def test_no_obstacles_are_an_empty_list(planner: Memory) -> None:
    assert planner.plan_arrays((0.0, 0.0, 0.0), (20.0, 0.0), [], [0]).plan is not None  # type: ignore[arg-type]


def test_what_a_goal_pose_needs_is_made_before_the_first_is_asked_for(memory: Path) -> None:
    seconds_to_pose.cache_clear()
    planner = load(memory)
    made = seconds_to_pose.cache_info().misses
    assert made > 0
    pose = {"goal": [50.0, 50.0, 0.8], "goal_radius": None, "goal_tolerance": [0.5, 0.2]}
    assert planner.plan(fields_of(problem(0)) | pose).plan is not None
    assert seconds_to_pose.cache_info().misses == made


def test_what_was_not_warmed_up_answers_the_same(planner: Memory, memory: Path) -> None:
    seconds_to_pose.cache_clear()
    cold = load(memory, warm=False)
    assert seconds_to_pose.cache_info().misses == 0
    assert same(planner.plan(problem(0)), cold.plan(problem(0)))


def test_no_plan_is_an_answer(planner: Memory) -> None:
    walls = [box(48.0, y, 1.0) for y in np.arange(42.0, 58.0)] + [
        box(x, 43.0, 1.0) for x in np.arange(48, 58)
    ]
    closed = replace(problem(0), obstacles=obstacles_of([[wall] for wall in walls]))
    answer = planner.plan(closed)
    assert (answer.plan, answer.source) == (None, None)
    assert answer.status != "solved"
    assert answer.planning_seconds > 0.0


@pytest.mark.parametrize("bad", ["{", "[]", {}, 7, {"start": [float("nan")] * 3}, "[" * 100_000])
def test_a_malformed_problem_is_one_line(planner: Memory, bad: object) -> None:
    with pytest.raises(ValueError, match=r".+") as error:
        planner.plan(bad)  # type: ignore[arg-type]
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("as_text", [False, True])
def test_a_field_that_is_not_understood_is_refused(planner: Memory, as_text: bool) -> None:
    for name, told in (
        ("obstacels", "'obstacles'"),
        ("start_sped", "'start_speed'"),
        ("moving", "supported"),
    ):
        fields = {**fields_of(problem(0)), name: [0]}
        with pytest.raises(ValueError, match=f"'{name}'.*{told}"):
            planner.plan(json.dumps(fields) if as_text else fields)
    with pytest.raises(ValueError, match="'obstacles' more than once"):
        planner.plan(json.dumps(fields_of(problem(0)))[:-1] + ', "obstacles": []}')


def test_threads_do_not_disturb_each_other(planner: Memory) -> None:
    alone = [planner.plan(problem(i)) for i in range(COUNT)]
    wrong: list[int] = []

    def ask(i: int) -> None:
        wrong.extend(i for _ in range(15) if not same(planner.plan(problem(i)), alone[i]))

    threads = [Thread(target=ask, args=(i,)) for i in range(COUNT)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []


def test_it_is_refused_what_it_is_not_for(memory: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="Unknown planner 'prm'"):
        load(memory, planner="prm")
    with pytest.raises(StorageError, match="made for vehicle car, expected car-1-trailer"):
        load(memory, vehicle="car-1-trailer")
    with pytest.raises(StorageError, match="holds no memory"):
        load(tmp_path)
    for name in ("curves", "trap"):
        save_memory(tmp_path / "memories" / name, load_memory(memory))
    with pytest.raises(RunError, match=r"several memories; name one of its folders: curves, trap"):
        load(tmp_path)
    save_memory(tmp_path / "memories" / "combined", load_memory(memory))
    assert len(load(tmp_path).stored.plans) == len(load_memory(memory).plans)


def test_the_example_of_the_page_runs_without_what_a_robot_has_not(memory: Path, tmp_path: Path) -> None:
    page = (ROOT / "docs" / "serving.md").read_text()
    (example,) = re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)
    (tmp_path / "problem.json").write_text(json.dumps(fields_of(problem(0))))
    script = example.replace("data/runs/laptop-labels-…/memories/random", str(memory))
    script += (
        "import sys; print(sorted({'torch', 'prefect', 'mlflow', 'pandas', 'dask'} & set(sys.modules)))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script],
        cwd=tmp_path,
        env={"PATH": "/usr/bin:/bin", "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=200,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    lines = done.stdout.splitlines()
    assert lines[-1] == "[]"
    assert re.fullmatch(r"(recalled|repaired|searched): \d+ states in [0-9.]+ ms", lines[0])


@pytest.mark.parametrize("scale", [1.0, 0.1])
@pytest.mark.parametrize("states_it", [True, False])
def test_who_drives_is_the_vehicle_of_the_problem_at_its_scale(scale: float, states_it: bool) -> None:
    alone = load(None, vehicle="differential-drive", warm=False)
    asked = {
        "start": [0.0, 0.0, 0.0],
        "goal": [20.0 * scale, 4.0 * scale],
        "goal_radius": 0.5 * scale,
        "bounds": [-5.0 * scale, -9.0 * scale, 25.0 * scale, 9.0 * scale],
        "obstacles": [],
        "scale": scale,
    } | ({"vehicle": "differential-drive"} if states_it else {})
    plan = alone.plan(asked).plan
    assert plan is not None
    state = plan.states[10].tolist()
    moved = asked | {"start": state[:3], "start_speed": state[3], "start_turn_rate": state[4]}
    again = alone.plan(moved, current=plan)
    assert again.plan is not None
    assert again.near_current is True
    assert again.plan.duration_s <= plan.duration_s - 10 * plan.dt + 1e-9
    arrays = alone.plan_arrays(
        *(state[:3], asked["goal"], [], [], asked["goal_radius"], asked["bounds"], scale, state[3:]),
        current=plan,
    )
    assert arrays.near_current is True
    walled = moved | {"obstacles": [box(state[0], state[1], 0.2 * scale)]}
    with pytest.raises(ValueError, match="start footprint of differential-drive "):
        alone.plan(walled, current=plan)


def test_the_current_plan_is_numbers_of_any_kind_and_nothing_else(planner: Memory) -> None:
    asked = problem(0)
    plan = planner.plan(asked).plan
    assert plan is not None
    half = len(plan.states) // 2
    x, y, heading, *motion = plan.states[half].tolist()
    moved = replace(asked, start=(x, y, heading), start_motion=tuple(motion))
    lists = replace(plan, states=plan.states.tolist(), controls=plan.controls.tolist())
    single = replace(plan, states=plan.states.astype(np.float32), controls=plan.controls.astype(np.float32))
    for given in (plan, lists, single):
        answer = planner.plan(moved, current=given)
        assert answer.plan is not None
        assert answer.plan.duration_s <= plan.duration_s - half * plan.dt + 1e-9
        assert answer.near_current is True
    turned = replace(moved, start=(x, y, heading + math.pi))
    assert planner.plan(turned, current=plan).near_current is False
    for wrong in (
        planner.plan(asked),
        replace(plan, states=plan.states * math.nan),
        replace(plan, controls=plan.controls + 1j),
        replace(plan, states=plan.states.astype(str)[:, :1] + "m"),
        replace(plan, dt=None),
    ):
        with pytest.raises(UsageError, match="current"):
            planner.plan(moved, current=wrong)


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_only_who_drives_a_plan_may_be_within_the_margins_of_what_it_passes(scale: float) -> None:
    asked = fields_of(replace(problem(0), obstacles=obstacles_of([]), scale=scale))
    alone = load(None, warm=False)
    first = alone.plan(asked).plan
    assert first is not None
    x, y, heading, speed, steering = first.states[len(first.states) // 2].tolist()
    aside = scale * (0.5 * CAR.width + 0.01 + 0.1)
    there = (x - math.sin(heading) * aside, y + math.cos(heading) * aside)
    post = worlds.box(*there, heading, 0.1 * scale, 0.1 * scale)
    asked |= {"start": [x, y, heading], "start_speed": speed, "start_steering": steering}
    asked |= {"obstacles": [post.tolist()]}
    arrays = (
        (x, y, heading),
        asked["goal"],
        post,
        np.array([0, 4]),
        asked["goal_radius"],
        asked["bounds"],
        scale,
    )
    with pytest.raises(ValueError, match="not free"):
        alone.plan(asked)
    with pytest.raises(ValueError, match="not free"):
        alone.plan_arrays(*arrays, (speed, steering))
    for answer in (
        alone.plan(asked, current=first),
        alone.plan_arrays(*arrays, (speed, steering), current=first),
    ):
        assert answer.source == "kept"
