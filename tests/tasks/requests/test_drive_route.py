"""``route``: what is written can be driven in the map's frame, and bad input gets one line."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
import shapely

from flows.cli.main import call
from planners.maps.cutting import cut_problems
from planners.maps.surroundings import surroundings_of
from planners.world.arrays import Floats
from planners.world.authority.authority_equations import simulate_again
from planners.world.vehicles.bodies import footprints
from planners.world.vehicles.vehicle import CAR
from storage.archives.memories import save_memory
from storage.exchange.plans import read_plan
from storage.exchange.problems import write_problems
from storage.worlds.importing import ImportSettings, load_map
from storage.worlds.sources import source_at
from tasks.requests import drive_route
from tests.planners.maps.agreement import cells_shape
from tests.planners.memories import memory_of
from tests.storage.samples import problem_with
from tests.storage.worlds.samples import town_cells, write_map, write_ros
from tests.worlds import SHARED

CELLS = town_cells(rows=200, columns=160)
TURNED = [500.0, -40.0, 0.7]
SCALE = 0.5


def placed(x: float, y: float) -> tuple[float, float]:
    """Grid metres in the frame of the turned map."""
    cos, sin = math.cos(TURNED[2]), math.sin(TURNED[2])
    return TURNED[0] + cos * x - sin * y, TURNED[1] + sin * x + cos * y


@pytest.fixture(scope="module")
def town(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("town")
    write_ros(folder / "town.yaml", CELLS, origin=TURNED)
    write_map(folder / "town.map", CELLS)
    world = load_map(source_at(folder / "town.map"), ImportSettings())
    cuts = cut_problems(world, surroundings_of(world, SCALE), "train", 30, 1)
    for name, metadata in (("small", {"scales": [SCALE]}), ("unsaid", {})):
        save_memory(folder / name, memory_of([cut.problem for cut in cuts], metadata=metadata))
    return folder


def in_free_cells(states: Floats) -> bool:
    """By shapely: no footprint of a car half as large meets an occupied cell of the turned map."""
    blocked = shapely.affinity.rotate(
        cells_shape(CELLS[::-1], 1.0, 0.0, 0.0), TURNED[2], origin=(0, 0), use_radians=True
    )
    blocked = shapely.affinity.translate(blocked, *TURNED[:2])
    own = states.copy()
    own[:, :2] /= SCALE
    return not any(
        shapely.Polygon(SCALE * corners).intersects(blocked)
        for corners in footprints(own, CAR).reshape(-1, 4, 2)[::5]
    )


def test_a_route_at_a_scale_over_a_turned_map_can_be_driven(
    town: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, picture = tmp_path / "plan.json", tmp_path / "route.png"
    begin, end = placed(8.0, 6.0), placed(150.0, 190.0)
    asked = ["route", str(town / "town.yaml"), "--memory", str(town / "small"), "--scale", str(SCALE)]
    asked += ["--from", f"{begin[0]},{begin[1]},{0.3 + TURNED[2]}", "--to", f"{end[0]},{end[1]}"]
    assert call([*asked, "--out", str(out), "--picture", str(picture)]) == 0
    told = capsys.readouterr()
    assert told.err == ""
    record = read_plan(out)
    assert record.scale == SCALE
    plan = record.plan
    assert plan is not None
    np.testing.assert_allclose(plan.states[0, :3] * [SCALE, SCALE, 1.0], [*begin, 0.3 + TURNED[2]])
    np.testing.assert_allclose(simulate_again(plan.states[0], plan.controls, CAR), plan.states, atol=1e-6)
    own = plan.states.copy()
    own[:, :2] *= SCALE
    assert math.dist(own[-1, :2], end) <= 2.0 * SCALE
    assert abs(plan.states[-1, 3]) < 1e-9
    assert in_free_cells(own)
    metres = re.search(r"^([\d.]+) m in ([\d.]+) s, (\d+) legs?, (\d+) from memory", told.out, re.MULTILINE)
    assert metres is not None
    assert float(metres[1]) == pytest.approx(SCALE * plan.length_m, abs=0.5)
    rows = [line.split() for line in told.out.splitlines() if re.match(r" +\d+ +(rec|rep|sea)", line)]
    assert len(rows) == int(metres[3])
    assert sum(row[1] != "searched" for row in rows) == int(metres[4])
    assert picture.stat().st_size > 10_000


def test_a_route_begins_in_motion_and_ends_in_a_pose(
    town: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, picture = tmp_path / "plan.json", tmp_path / "route.png"
    begin, end, heading = placed(8.0, 6.0), placed(150.0, 190.0), 1.0 + TURNED[2]
    asked = ["route", str(town / "town.yaml"), "--scale", str(SCALE), "--goal-tolerance", "0.06,0.02"]
    asked += ["--start-speed", "1.5", "--start-steering", "-0.1", "--picture", str(picture)]
    asked += ["--from", f"{begin[0]},{begin[1]},{0.3 + TURNED[2]}", "--to", f"{end[0]},{end[1]},{heading}"]
    assert call([*asked, "--out", str(out)]) == 0
    written = json.loads(out.read_text())
    assert written["states"][0][3:] == [1.5, -0.1]
    last = written["states"][-1]
    off = math.dist(last[:2], end)
    assert off <= 0.06
    told = re.search(r"stops ([\d.]+) m and ([\d.]+) rad from the pose", capsys.readouterr().out)
    assert told is not None
    assert float(told[1]) == pytest.approx(off, abs=0.006)
    assert float(told[2]) == pytest.approx(abs(math.remainder(last[2] - heading, math.tau)), abs=6e-4)
    assert abs(math.remainder(last[2] - heading, math.tau)) <= 0.02
    assert last[3] == pytest.approx(0.0, abs=1e-8)
    assert in_free_cells(np.array(written["states"]))
    assert call(["verify", str(out), "--map", str(town / "town.yaml")]) == 0
    assert call(["verify", str(out), "--map", str(town / "town.map")]) == 1  # which lies elsewhere
    assert picture.stat().st_size > 10_000


def test_where_nothing_can_be_learned_is_told_before_the_drive(
    town: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(drive_route, "Router", None)
    file = tmp_path / "file"
    file.touch()
    begin, end = placed(8.0, 6.0), placed(150.0, 190.0)
    asked = ["route", str(town / "town.yaml"), "--scale", str(SCALE), "--learn", str(file)]
    assert call([*asked, "--from", f"{begin[0]},{begin[1]},0.3", "--to", f"{end[0]},{end[1]}"]) == 1
    assert "data folder" in capsys.readouterr().err


def test_how_long_a_route_is_rehearsed_does_not_change_it(
    town: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plans = []
    for seconds in (0.0, 60.0):
        monkeypatch.setattr(drive_route, "REHEARSED_S", seconds)
        out = tmp_path / f"after-{seconds}.json"
        asked = ["route", str(town / "town.yaml"), "--scale", str(SCALE), "--out", str(out)]
        begin, end = placed(8.0, 6.0), placed(150.0, 190.0)
        assert call([*asked, "--from", f"{begin[0]},{begin[1]},0.3", "--to", f"{end[0]},{end[1]}"]) == 0
        plans.append(read_plan(out).plan)
    assert plans[0] is not None
    assert plans[1] is not None
    np.testing.assert_array_equal(plans[0].states, plans[1].states)


def test_a_route_stops_as_near_to_a_place_as_it_is_asked_to(town: Path, tmp_path: Path) -> None:
    out = tmp_path / "plan.json"
    asked = ["route", str(town / "town.map"), "--from", "8,6,0.3", "--to", "8,7.5", "--to", "150,190"]
    assert call([*asked, "--goal-radius", "0.3", "--out", str(out)]) == 0
    plan = read_plan(out).plan
    assert plan is not None
    assert math.dist(plan.states[-1, :2], (150.0, 190.0)) <= 0.3
    rests = plan.states[np.abs(plan.states[:, 3]) < 1e-9, :2]
    assert np.hypot(*(rests - (8.0, 7.5)).T).min() <= 0.3


def test_a_trailer_stands_in_a_pose_as_it_is_asked_to(town: Path, tmp_path: Path) -> None:
    out, picture = tmp_path / "plan.json", tmp_path / "route.png"
    asked = ["route", str(town / "town.map"), "--vehicle", "car-1-trailer", "--goal-tolerance", "0.1,0.03"]
    asked += ["--from", "8,6,0.3", "--to", "20,12,2.5", "--goal-hitch", "-0.2", "--picture", str(picture)]
    assert call([*asked, "--out", str(out)]) == 0
    last = json.loads(out.read_text())["states"][-1]
    assert abs(last[5] + 0.2) <= 0.03
    assert abs(math.remainder(last[2] - 2.5, math.tau)) <= 0.03
    assert picture.stat().st_size > 10_000


def test_who_is_there_already_is_told_so_and_gets_a_plan_that_stands(
    town: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "plan.json"
    for goal in ("8,6.5", "8,6,0.3"):
        asked = ["route", str(town / "town.map"), "--from", "8,6,0.3", "--to", goal, "--out", str(out)]
        assert call(asked) == 0
        assert "there already" in capsys.readouterr().out
        assert len(json.loads(out.read_text())["states"]) == 1
        assert call(["verify", str(out), "--map", str(town / "town.map")]) == 0


def block(drive: Path, state: int, changed: Path) -> tuple[float, float]:
    """Write the town's map with the cell occupied where a drive is in a state; x and y there."""
    x, y = json.loads(drive.read_text())["states"][state][:2]
    cells = CELLS.copy()
    cells[-1 - int(y), int(x)] = True
    write_map(changed, cells)
    return x, y


def test_a_route_is_refused_on_a_map_that_has_changed_in_its_way(
    town: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "plan.json"
    asked = ["route", str(town / "town.map"), "--from", "8,6,0.3", "--to", "150,190", "--out", str(out)]
    assert call(asked) == 0
    assert call(["verify", str(out), "--map", str(town / "town.map")]) == 0
    x, y = block(out, 100, tmp_path / "changed.map")
    capsys.readouterr()
    assert call(["verify", str(out), "--map", str(tmp_path / "changed.map")]) == 1
    told = capsys.readouterr().err
    assert "Collision" in told
    near = re.search(r"near \((\S+), (\S+)\)", told)
    assert near is not None
    assert math.dist((float(near[1]), float(near[2])), (x, y)) < 4.0  # metres of the map


def test_where_a_scaled_route_collides_is_told_in_metres_of_the_map(
    town: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "plan.json"
    asked = ["route", str(town / "town.map"), "--scale", str(SCALE), "--from", "8,6,0.3", "--to", "150,190"]
    assert call([*asked, "--out", str(out)]) == 0
    x, y = block(out, 200, tmp_path / "changed.map")
    capsys.readouterr()
    assert call(["verify", str(out), "--map", str(tmp_path / "changed.map")]) == 1
    near = re.search(r"near \((\S+), (\S+)\)", capsys.readouterr().err)
    assert near is not None
    assert math.dist((float(near[1]), float(near[2])), (x, y)) < 3.0


def test_it_goes_through_all_goals_without_a_memory(town: Path, tmp_path: Path) -> None:
    out = tmp_path / "plan.json"
    asked = ["route", str(town / "town.map"), "--from", "8,6,0.3", "--to", "150,190", "--to", "10,190"]
    assert call([*asked, "--out", str(out)]) == 0
    record = read_plan(out)
    assert record.plan is not None
    assert record.source == "searched"
    for goal in ((150.0, 190.0), (10.0, 190.0)):
        assert np.hypot(*(record.plan.states[:, :2] - goal).T).min() <= 2.0


def test_who_drives_a_route_is_given_what_is_left_of_it_unless_another_is_quicker(
    town: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    drive, again = tmp_path / "drive.json", tmp_path / "again.json"
    (x, y), (right, up) = placed(8.0, 6.0), placed(60.0, 80.0)
    asked = ["route", str(town / "town.yaml"), "--to", f"{right},{up}"]
    scaled, begin = ["--scale", str(SCALE)], f"{x},{y},1.0"
    assert call([*asked, *scaled, "--from", begin, "--out", str(drive)]) == 0
    first = read_plan(drive).plan
    assert first is not None
    x, y, heading, speed, steering = json.loads(drive.read_text())["states"][20]
    moved = ["--from", f"{x},{y},{heading}", "--start-speed", str(speed), "--start-steering", str(steering)]
    moved += ["--time-limit", "1e-9"]  # in which nothing is found
    current = ["--current", str(drive), "--out", str(again), "--picture", str(tmp_path / "kept.png")]
    assert call([*asked, *scaled, *moved, *current]) == 0
    left = read_plan(again)
    assert left.source == "kept"
    assert left.plan is not None
    np.testing.assert_allclose(left.plan.states, first.states[20:], atol=1e-6)

    capsys.readouterr()
    far = placed(60.0, 6.0)
    assert call([*asked, *scaled, "--from", f"{far[0]},{far[1]},1.0", "--current", str(drive), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["answer"]["near_current"] is False
    assert [str(drive) in warning for warning in told["warnings"]] == [True]
    assert call([*asked, "--from", begin, "--current", str(drive)]) == 2
    assert "scale" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "code", "told"),
    [
        (["--from", "8,6", "--to", "150,190"], 2, "--from '8,6': give x,y,heading"),
        (["--from", "8,6,nan", "--to", "150,190"], 2, "--from '8,6,nan': give x,y,heading"),
        (["--from", "8,6,0", "--to", "north"], 2, "--to 'north': give x,y"),
        (["--from", "8,6,0"], 2, "--to"),
        (["--from", "8,6,0", "--to", "150,190,0,0"], 2, "--to '150,190,0,0': give x,y"),
        (["--from", "8,6,0", "--to", "150,190,0", "--goal-tolerance", "1"], 2, "metres,radians, 2 numbers"),
        (["--from", "8,6,0", "--to", "150,190,0", "--goal-tolerance", "0,1"], 2, "numbers above 0"),
        (["--from", "8,6,0", "--to", "150,190", "--goal-tolerance", "1,1"], 2, "for poses: give --to x,y"),
        (["--from", "8,6,0", "--to", "150,190,0", "--goal-hitch", "0"], 2, "car has 0 trailers"),
        (["--from", "8,6,0", "--to", "150,190,0", "--goal-radius", "1"], 2, "for places: give --to x,y"),
        (["--from", "8,6,0", "--to", "150,190", "--goal-radius", "0"], 2, "metres above 0"),
        (["--from", "8,6,0", "--to", "150,190", "--goal-hitch", "0", "--vehicle", "car-1-trailer"], 2,
         "for poses: give --to x,y"),
        (["--from", "8,6,0", "--to", "150,190,0", "--goal-hitch", "2", "--vehicle", "car-1-trailer"], 2,
         "expected up to 1"),
        (["--from", "8,6,0", "--to", "150,190", "--start-speed", "5"], 2, "start speed is 5 m/s; the veh"),
        (["--from", "8,6,0", "--to", "150,190", "--start-turn-rate", "1"], 2, "has speed, steering"),
        (["--from", "8,6,0", "--to", "150,190", "--start-hitch", "0.1"], 2, "has no trailer"),
        (["--from", "-8,6,0", "--to", "150,190"], 2, "outside the map, at (-8.00, 6.00)"),
        (["--from", "8,6,0", "--to", "150,1900"], 2, "outside the map, at (150.00, 1900.00)"),
        (["--from", "8,6,0", "--to", "8,6", "--to", "150,1900"], 2, "goal 2 lies outside the map"),
        (["--from", "8,6,0", "--to", "150,190", "--scale", "0"], 2, "Scale is 0"),
        (["--from", "8,6,0", "--to", "150,190", "--resolution", "100"], 2, "is 20,000 m wide; at scale 1"),
        (["--from", "8,6,0", "--to", "150,190", "--assist", "open"], 2, "needs --memory"),
        (["--from", "8,6,0", "--to", "150,190", "--picture", "r.txt"], 2, "r.txt is not the name of a"),
        (["--from", "8,6,0", "--to", "150,190", "--memory", "small"], 1, "of scale 0.5, expected 1"),
        (["--from", "8,6,0", "--to", "9,60", "--scale", "0.5", "--memory", "unsaid"], 1, "of scale 1, exp"),
        (["--from", "8,6,0", "--to", "150,190", "--memory", "small", "--vehicle", "differential-drive"], 1,
         "differential-drive"),
    ],
)  # fmt: skip
def test_wrong_use_gets_one_line(
    town: Path, options: list[str], code: int, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    places = [str(town / each) if each in ("small", "unsaid") else each for each in options]
    assert call(["route", str(town / "town.map"), *places]) == code
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1


def test_a_memory_is_refused_for_a_problem_of_another_scale(
    town: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_problems(tmp_path / "p.json", [problem_with()])
    asked = ["plan", str(tmp_path / "p.json"), "--assist", "closed", "--memory", str(town / "small")]
    assert call(asked) == 1
    assert "was made of problems of scale 0.5, expected 1" in capsys.readouterr().err


@pytest.mark.skipif(not SHARED.is_dir(), reason="the real worlds are not here")
@pytest.mark.parametrize(
    ("name", "options", "metres"),
    [
        ("denver_ros.yaml", [
            "--from", "-113,22,0", "--to", "104,107", "--to", "100,-68", "--to", "-98,-68"], 500),
        ("Berlin_0_256.map", [
            "--from", "15,240,0", "--to", "250,20", "--to", "120,30", "--to", "70,215"], 500),
    ],
)  # fmt: skip
def test_half_a_kilometre_through_a_city(
    name: str, options: list[str], metres: float, tmp_path: Path
) -> None:
    out = tmp_path / "plan.json"
    assert call(["route", str(SHARED / "maps" / name), *options, "--out", str(out)]) == 0
    plan = read_plan(out).plan
    assert plan is not None
    assert plan.length_m >= metres


def test_where_no_route_is_found_the_picture_says_where(town: Path, tmp_path: Path) -> None:
    picture, plan = tmp_path / "stuck.png", tmp_path / "plan.json"
    begin = placed(8.0, 6.0)
    asked = ["route", str(town / "town.yaml"), "--scale", str(SCALE), "--from", f"{begin[0]},{begin[1]},0.7"]
    asked += ["--to", "0,0", "--picture", str(picture), "--out", str(plan)]
    assert call(asked) == 2
    assert picture.stat().st_size > 10_000
    assert not plan.exists()


def test_programs_are_told_where_a_route_is_stuck_and_how_narrow_it_is_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two rooms of 20 m with a door of half a metre between them, one cell wide."""
    cells = np.zeros((40, 82), bool)
    cells[:, 40:42] = True
    cells[20, 40:42] = False
    np.save(tmp_path / "rooms.npy", cells)
    asked = ["route", str(tmp_path / "rooms.npy"), "--resolution", "0.5", "--scale", "2"]
    asked += ["--from", "5,5,0", "--to", "36,5"]
    assert call([*asked, "--json"]) != 0
    told = json.loads(capsys.readouterr().out)
    answer = told["answer"]
    assert answer["status"] == "stuck"
    assert answer["why"] in told["error"]
    assert 0.5 <= answer["gap"]["width_m"] <= 1.0
    assert answer["vehicle_width_m"] == 2 * CAR.width
    assert answer["gap"]["place"] == pytest.approx([20.5, 10.0], abs=1.0)
    assert "plan" not in told["files"]


@pytest.mark.skipif(not SHARED.is_dir(), reason="the real worlds are not here")
def test_a_heavy_vehicle_that_pays_for_driving_backwards_turns_round_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It begins in a corner, facing away: backing all the way took 50 s, turning round takes 65 s."""
    (tmp_path / "hauler.yaml").write_text(
        "name: hauler\n"
        "kind: car\n"
        "body: [[[-1.5, -1], [6.5, -1], [6.5, 1], [-1.5, 1]]]\n"
        "wheelbase: 5\n"
        "limits: {speed: [-4, 4], acceleration: 0.3, steering: 0.6, steering_rate: 0.5}\n"
        "step: 0.1\n"
        "costs: {backwards: 3, gear_change: 1}\n"
    )
    asked = [
        "route",
        str(SHARED / "maps/Berlin_0_256.map"),
        "--vehicle",
        str(tmp_path / "hauler.yaml"),
    ]
    asked += ["--from", "248,20,-1.5", "--to", "120,30,0"]
    assert call([*asked, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    answer = told["answer"]
    assert any(f"{answer['cost_s']:.1f} s" in line for line in told["lines"])
    assert answer["backwards_m"] < 0.1 * answer["length_m"]
    assert answer["cost_s"] < 1.5 * answer["duration_s"]
