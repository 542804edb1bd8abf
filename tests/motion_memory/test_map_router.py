"""Drives across a map in a robot's own process: those of the command ``route``, and what is refused."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import motion_memory
from flows.cli.main import call
from planners.world.authority.authority import faults
from planners.world.vehicles.vehicle import CAR, VEHICLES
from storage.places.data_folder import DataFolder
from storage.tables.gained_experiences import read_gained
from tests.motion_memory.test_public_api import NOT_FOR_ROBOTS, ROOT
from tests.storage.worlds.samples import town_cells, write_ros

TURNED = [500.0, -40.0, 0.7]
POSE = (8.0, 6.0, 0.3)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("town") / "town.yaml"
    write_ros(path, town_cells(rows=100, columns=80), origin=TURNED)
    return path


@pytest.fixture(scope="module")
def world(file: Path) -> motion_memory.OccupancyMap:
    return motion_memory.read_map(file)


@pytest.fixture(scope="module")
def alone() -> motion_memory.Memory:
    return motion_memory.load(None, warm=False)


@pytest.fixture(scope="module")
def router(world: motion_memory.OccupancyMap, alone: motion_memory.Memory) -> Any:
    return alone.router(world)


def test_a_map_is_asked_again_and_answers_as_the_command_does(
    file: Path, world: motion_memory.OccupancyMap, router: Any, tmp_path: Path
) -> None:
    begin, there, pose = world.pose(*POSE), world.pose(60.0, 80.0, 0.0)[:2], world.pose(8.0, 90.0, 1.5)
    out = tmp_path / "drive.json"
    asked = ["route", str(file), "--out", str(out), "--start-speed", "1", "--goal-radius", "0.5"]
    asked += ["--from", ",".join(map(str, begin))]
    for goal in (there, pose):
        asked += ["--to", ",".join(map(str, goal))]
    assert call(asked) == 0
    written = json.loads(out.read_text())
    question: dict[str, Any] = {"start_motion": (1.0,), "goal_radius": 0.5}
    first, again = (router.route(begin, [there, pose], **question) for _ in range(2))
    assert (first.status, first.source, first.why) == ("solved", written["source"], None)
    for answer in (first, again):
        np.testing.assert_allclose(answer.plan.states, written["states"], atol=1e-9)
        np.testing.assert_allclose(answer.plan.controls, written["controls"], atol=1e-9)
    assert first.local_plans == again.local_plans > 0
    other = router.route(begin, [pose])
    assert math.dist(other.plan.states[-1, :2], pose[:2]) <= 0.1
    assert abs(math.remainder(other.plan.states[-1, 2] - pose[2], math.tau)) <= 0.05


def test_who_asks_again_while_driving_never_arrives_later(
    world: motion_memory.OccupancyMap, router: Any
) -> None:
    goals = [world.pose(60.0, 80.0, 0.0)[:2], world.pose(8.0, 90.0, 1.5)]
    first = router.route(world.pose(*POSE), goals)
    plan = first.plan
    stop = int(np.hypot(*(plan.states[:, :2] - goals[0]).T).argmin())
    for at, left in ((0, goals), (stop // 2, goals), (stop + 20, goals[1:]), (len(plan.controls), goals[1:])):
        pose, motion = plan.states[at, :3].tolist(), plan.states[at, 3:].tolist()
        answer = router.route(pose, left, start_motion=motion, current=plan)
        assert answer.plan.duration_s <= plan.duration_s - at * plan.dt + 1e-9
        hurried = router.route(pose, left, start_motion=motion, current=plan, time_limit=1e-9)
        assert (answer.near_current, hurried.near_current) == (True, True)
        assert hurried.source == "kept" or at == len(plan.controls)  # where nothing is left to drive
        np.testing.assert_allclose(hurried.plan.states, plan.states[at:], atol=1e-6)
    elsewhere = router.route(world.pose(60.0, 6.0, 0.0), goals[1:], current=plan)
    assert (elsewhere.source, elsewhere.near_current, first.near_current) == ("searched", False, None)
    with pytest.raises(ValueError, match="current"):
        router.route(world.pose(*POSE), goals, current=replace(plan, states=plan.states[:, :4]))


def test_a_route_teaches_what_the_command_learns_of_it_and_nothing_twice(
    file: Path, world: motion_memory.OccupancyMap, alone: motion_memory.Memory, router: Any, tmp_path: Path
) -> None:
    begin, pose = world.pose(*POSE), world.pose(8.0, 90.0, 1.5)
    asked = ["route", str(file), "--learn", str(tmp_path / "command")]
    assert call([*asked, "--from", ",".join(map(str, begin)), "--to", ",".join(map(str, pose))]) == 0
    answer = router.route(begin, [pose])
    for _ in range(2):
        assert alone.learn(answer, tmp_path / "robot") > 0
    learned = {
        each.experience.problem.id: each.experience
        for each in read_gained(DataFolder(tmp_path / "robot").gained_questions("car"), CAR)
    }
    commanded = read_gained(DataFolder(tmp_path / "command").gained_questions("car"), CAR)
    assert {each.experience.problem.id for each in commanded} == set(learned)
    assert not any(faults(each.problem, each.plan, CAR) for each in learned.values())
    assert any(
        each.problem.arrival is not None and each.problem.arrival.heading is not None
        for each in learned.values()
    )  # the way into the pose
    stuck = router.route(begin, [world.pose(8.0, 90.0, 1.5)], time_limit=1e-9)
    assert alone.learn([stuck], tmp_path / "robot") == 0


def test_own_cells_at_a_scale_are_driven_over_in_their_own_metres(alone: motion_memory.Memory) -> None:
    cells = town_cells(rows=100, columns=80)[::-1]  # row 0 is the lowest
    halved = motion_memory.OccupancyMap("own", cells, 0.5, (3.0, 4.0, 0.0))
    whole = motion_memory.OccupancyMap("own", cells, 1.0)
    small = alone.router(halved, scale=0.5).route((7.0, 7.0, 0.3), [(33.0, 44.0)])
    large = alone.router(whole).route((8.0, 6.0, 0.3), [(60.0, 80.0)])
    assert small.plan is not None
    assert large.plan is not None
    np.testing.assert_allclose(
        small.plan.states[:, :2], 0.5 * large.plan.states[:, :2] + (3.0, 4.0), atol=1e-9
    )
    assert small.plan.dt == large.plan.dt


def test_where_it_is_stuck_is_told(world: motion_memory.OccupancyMap, router: Any) -> None:
    occupied = np.argwhere(world.occupied)[0][::-1] + 0.5
    wall = world.pose(*occupied, 0.0)[:2]
    answer = router.route(world.pose(*POSE), [wall])
    assert (answer.status, answer.plan, answer.source, answer.local_plans) == ("stuck", None, None, 0)
    assert "obstacle" in answer.why


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"start": (1.0, 2.0)}, "start"),
        ({"start": (1.0, 2.0, math.nan)}, "start"),
        ({"goals": []}, "^goals is"),
        ({"goals": (3.0, 4.0)}, "^goals is"),
        ({"goals": [(3.0, 4.0, 0.0, 1.0)]}, "goals"),
        ({"goals": "there"}, "goals"),
        ({"goal_radius": 0.0}, "goal_radius"),
        ({"goal_radius": "2"}, "goal_radius"),
        ({"goal_tolerance": (0.1,)}, "goal_tolerance"),
        ({"goal_tolerance": (0.1, -0.1)}, "goal_tolerance"),
        ({"goal_hitches": (0.1,)}, "hitch"),
        ({"goal_hitches": ("a",)}, "goal_hitches"),
        ({"goal_tolerance": (0.1, 0.1)}, "^goal_tolerance is for poses"),
        ({"goals": [(60.0, 80.0, 0.0)], "goal_radius": 1.0}, "^goal_radius is for places"),
        ({"start_motion": (1e3,)}, "speed"),
        ({"time_limit": 0.0}, "^time_limit is 0.0"),
        ({"time_limit": "1"}, "^time_limit"),
        ({"start_motion": "fast"}, "start_motion"),
        ({"start_motion": "12"}, "start_motion"),
        ({"start_motion": (0.5, 0.0, 0.0)}, "^The start has"),
    ],
)
def test_bad_questions_get_one_line(
    world: motion_memory.OccupancyMap, router: Any, changed: dict[str, Any], named: str
) -> None:
    asked: dict[str, Any] = {"start": world.pose(*POSE), "goals": [world.pose(60.0, 80.0, 0.0)[:2]]}
    with pytest.raises(ValueError, match=named) as raised:
        router.route(**(asked | changed))
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"name": "a/b\n.."}, "name"),
        ({"name": ""}, "name"),
        ({"name": 7}, "name"),
        ({"occupied": np.zeros((3, 3))}, "occupied"),
        ({"occupied": np.zeros((0, 3), bool)}, "occupied"),
        ({"occupied": [[True]]}, "occupied"),
        ({"resolution": 0.0}, "resolution"),
        ({"resolution": 1e-9}, "resolution"),
        ({"resolution": 1e6}, "resolution"),
        ({"origin": (0.0, 0.0)}, "origin"),
        ({"origin": (0.0, 0.0, math.inf)}, "origin"),
    ],
)
def test_bad_maps_get_one_line(
    world: motion_memory.OccupancyMap, alone: motion_memory.Memory, changed: dict[str, Any], named: str
) -> None:
    with pytest.raises(ValueError, match=named):
        alone.router(replace(world, **changed))


def test_what_is_no_map_and_who_cannot_stop_are_refused(
    world: motion_memory.OccupancyMap, alone: motion_memory.Memory, tmp_path: Path
) -> None:
    no_map: Any = world.occupied
    with pytest.raises(motion_memory.UsageError, match="OccupancyMap"):
        alone.router(no_map)
    with pytest.raises(motion_memory.UsageError, match="tolerance_m"):
        alone.router(world, tolerance_m=-1.0)
    always_on = replace(alone, vehicle=VEHICLES["car"]._replace(min_speed=0.1))
    with pytest.raises(motion_memory.UsageError, match="stop"):
        always_on.router(world)
    unknown: Any = "yes"
    with pytest.raises(motion_memory.UsageError, match="unknown"):
        motion_memory.read_map(tmp_path / "no.map", unknown=unknown)
    with pytest.raises(motion_memory.StorageError):
        motion_memory.read_map(tmp_path / "no.map")


def test_a_map_needs_nothing_that_a_robot_has_not() -> None:
    code = f"import motion_memory.map_router, sys; print([m for m in {NOT_FOR_ROBOTS} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("read", [motion_memory.read_map, motion_memory.read_worlds])
def test_without_scipy_it_is_said_what_to_install(
    read: Any, file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "storage.worlds.importing", None)  # as an import without SciPy ends
    with pytest.raises(motion_memory.RunError, match="pip install"):
        read(file)


def test_a_route_that_takes_too_long_is_given_up(
    file: Path, world: motion_memory.OccupancyMap, router: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    begin, there = world.pose(*POSE), world.pose(60.0, 80.0, 0.0)[:2]
    late = router.route(begin, [there], time_limit=1e-6)
    assert (late.status, late.plan) == ("stuck", None)
    assert "limit of time" in late.why
    usual = router.route(begin, [there])
    assert np.array_equal(router.route(begin, [there], time_limit=600.0).plan.states, usual.plan.states)
    asked = ["route", str(file), "--from", ",".join(map(str, begin)), "--to", ",".join(map(str, there))]
    assert call([*asked, "--time-limit", "1e-6", "--json"]) == 1
    told = capsys.readouterr()
    assert json.loads(told.out)["answer"]["time_is_up"] is True
    assert told.err.count("--time-limit") == 1
