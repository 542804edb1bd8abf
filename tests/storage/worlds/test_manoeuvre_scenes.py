from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from flows.cli.main import call
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import DifferentialDrive
from storage.exchange.problems import read_problems
from storage.vehicles.vehicle_files import read_vehicle
from storage.worlds.importing import ImportSettings, import_part
from storage.worlds.sources import source_at
from tests.storage.samples import quick
from tests.worlds import SHARED

GIVEN = SHARED / "manoeuvres"
VEHICLES = Path("docs/vehicles/benchmarks")
TPCAP = {
    "id": "wedge",
    "start": [0.0, 0.0, 0.1],
    "goal": [6.0, 4.0, 1.0],
    "obstacles": [[[9, -3], [12, -3], [12, 3], [11.5, 0]], [[0, 5], [2, 5], [2, 7]]],
}


def imported(path: Path, form: str, vehicle: str) -> dict[str, Problem]:
    settings = ImportSettings(vehicle=read_vehicle(VEHICLES / f"{vehicle}.yaml"))
    parts = [import_part(source_at(path, form), part, settings) for part in ("train", "test")]
    return {problem.id: problem for part in parts for problem in part.problems}


@pytest.mark.skipif(not GIVEN.is_dir(), reason="the problems of others do not lie beside the repository")
@pytest.mark.parametrize(
    ("path", "form", "vehicle", "count"),
    [
        ("tpcap/cases.json", "tpcap", "tpcap-car", 8),
        ("bench_mr/parking.json", "bench-mr", "bench-mr-car", 10),
        ("dynobench/problems.json", "dynobench", "dynobench-car1-v0", 2),
        ("dynobench/problems.json", "dynobench", "dynobench-unicycle1-v0", 2),
        ("dynobench/problems.json", "dynobench", "dynobench-unicycle1-v1", 1),
        ("dynobench/problems.json", "dynobench", "dynobench-unicycle2-v0", 2),
    ],
)
def test_every_given_problem_is_read_as_it_was_published(
    path: str, form: str, vehicle: str, count: int
) -> None:
    problems = imported(GIVEN / path, form, vehicle)
    assert len(problems) == count
    fields = json.loads((GIVEN / path).read_text())
    for raw in fields.get("cases") or fields["problems"]:
        if raw["id"] not in problems:
            continue
        problem = problems[raw["id"]]
        scale, offset = problem.scale, np.array(problem.offset)
        ends = [scale * np.array(place) + offset for place in (problem.start[:2], problem.goal)]
        assert np.allclose(ends, [raw["start"][:2], raw["goal"][:2]], rtol=0.0, atol=1e-6)
        assert problem.arrival is not None
        assert problem.arrival.heading == raw["goal"][2]
        polygons = raw["obstacles"] if "obstacles" in raw else fields["environments"][raw["environment"]]
        shapes = [shapely.box(*_corners(each)) if "size" in each else each for each in polygons]
        areas = [
            shapely.Polygon(np.array(s) - offset).area if isinstance(s, list) else s.area for s in shapes
        ]
        cut = sum(shapely.Polygon(scale * piece).area for piece in problem.obstacles.pieces())
        assert cut == pytest.approx(sum(areas), rel=1e-3)


def _corners(obstacle: dict[str, list[float]]) -> list[float]:
    centre, half = np.array(obstacle["center"]), 0.5 * np.array(obstacle["size"])
    return [*(centre - half), *(centre + half)]


def test_a_line_of_numbers_is_the_same_case_as_json(tmp_path: Path) -> None:
    corners = [number for polygon in TPCAP["obstacles"] for corner in polygon for number in corner]
    counts = [len(polygon) for polygon in TPCAP["obstacles"]]
    numbers = [*TPCAP["start"], *TPCAP["goal"], len(counts), *counts, *corners]
    (tmp_path / "wedge.csv").write_text(",".join(map(str, numbers)) + "\n")
    (tmp_path / "cases.json").write_text(json.dumps({"cases": [TPCAP]}))
    line = imported(tmp_path / "wedge.csv", "tpcap", "tpcap-car")["wedge"]
    packed = imported(tmp_path / "cases.json", "tpcap", "tpcap-car")["wedge"]
    assert (line.start, line.goal, line.bounds, line.arrival) == (
        packed.start,
        packed.goal,
        packed.bounds,
        packed.arrival,
    )
    assert (line.obstacles.vertices == packed.obstacles.vertices).all()
    assert len(line.obstacles.piece_starts) == 4  # the first obstacle is not convex


def test_dynobench_in_yaml_with_a_bent_trailer(tmp_path: Path) -> None:
    (tmp_path / "park.yaml").write_text(
        "name: park\nenvironment:\n  min: [0, -0.5]\n  max: [3.5, 2.5]\n  obstacles:\n"
        "  - {type: box, center: [2.7, 0.2], size: [0.5, 0.25]}\n"
        "robots:\n- {type: car1_v0, start: [0.8, 0.6, 0.1, 0.4], goal: [1.9, 0.9, 0, 0.2]}\n"
    )
    problem = imported(tmp_path / "park.yaml", "dynobench", "dynobench-car1-v0")["park"]
    assert problem.start_motion == pytest.approx((0.0, 0.0, -0.3))
    arrival = problem.arrival
    assert arrival is not None
    assert arrival.hitches == pytest.approx((-0.2,))
    worst = problem.scale * problem.goal_radius + 0.5 * arrival.heading_tolerance
    worst += 0.5 * (arrival.heading_tolerance + arrival.hitch_tolerances[0])
    assert worst <= 0.1 + 1e-12  # dynobench's own tolerance, whatever of ours is used up


@pytest.mark.parametrize(
    ("content", "form", "told"),
    [
        ("[1]", "tpcap", "expected an object"),
        ('{"cases": 1}', "tpcap", "has no list of cases"),
        ('{"cases": [{"id": "a", "start": [1], "goal": [0, 0, 0]}]}', "tpcap", "start must be a list"),
        ('{"problems": []}', "bench-mr", "has no environments"),
        ('{"problems": [{"id": "a", "model": "quad2d_v0"}]}', "dynobench", "is for the model quad2d_v0"),
    ],
)
def test_what_is_wrong_with_a_file_is_told_in_one_line(
    content: str, form: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "scenes.json").write_text(content)
    out = tmp_path / "out.jsonl"
    arguments = ["import-worlds", str(tmp_path / "scenes.json"), "--format", form, "--out", str(out)]
    assert call([*arguments, "--vehicle", str(VEHICLES / "tpcap-car.yaml"), "--part", "train"]) == 1
    assert told in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize(
    ("model", "start", "count"),
    [
        ("unicycle2_v0", [1.0, 1.0, 0.0], 5),
        ("unicycle1_v0", [1.0, 1.0], 3),
        ("unicycle_first_order_0", [1.0, 1.0, 0.0, 0.0], 3),
        ("car1_v0", [1.0, 1.0, 0.0], 4),
        ("car2_v0", [1.0, 1.0, 0.0], 5),
    ],
)
def test_a_state_of_too_few_numbers_is_told(
    model: str, start: list[float], count: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fields = {"id": "short", "model": model, "start": start, "goal": [5, 5, 0, 0, 0][:count]}
    fields |= {"bounds": [[0, 0], [10, 10]], "obstacles": []}
    (tmp_path / "short.json").write_text(json.dumps({"problems": [fields]}))
    vehicle = VEHICLES / f"dynobench-{model.replace('_', '-')}.yaml"
    out = tmp_path / "out.jsonl"
    arguments = ["import-worlds", str(tmp_path / "short.json"), "--format", "dynobench", "--out", str(out)]
    assert call([*arguments, "--vehicle", str(vehicle), "--part", "train"]) == 1
    told = capsys.readouterr().err
    assert "short.json" in told
    assert f"start must be a list of {count} numbers, got {start}" in told
    assert not out.exists()


@pytest.mark.parametrize("line", ["1,2,3,4,5,6,1,3,0,0,1", "1,2,3,4,5,6,1,3,0,0,1,0,1,1,7", "1,2,x"])
def test_a_line_that_is_cut_off_or_too_long_is_refused(line: str, tmp_path: Path) -> None:
    (tmp_path / "case.csv").write_text(line)
    settings = ImportSettings(vehicle=read_vehicle(VEHICLES / "tpcap-car.yaml"))
    told = import_part(source_at(tmp_path / "case.csv"), "train", settings).skipped[0][1]
    assert "cut off" in told or "continues with" in told


def test_an_imported_case_is_a_problem_file_in_its_own_frame(tmp_path: Path) -> None:
    far = [4_484_378_811.25, -354_286_007.25]
    moved = {
        **TPCAP,
        "start": [far[0], far[1], 0.1],
        "goal": [far[0] + 6.0, far[1] + 4.0, 1.0],
        "obstacles": [[[far[0] + x, far[1] + y] for x, y in polygon] for polygon in TPCAP["obstacles"]],
    }
    for name, case in (("near", TPCAP), ("far", moved)):
        (tmp_path / f"{name}.json").write_text(json.dumps({"cases": [case]}))
        out = str(tmp_path / f"{name}.jsonl")
        vehicle = str(VEHICLES / "tpcap-car.yaml")
        asked = ["import-worlds", str(tmp_path / f"{name}.json"), "--format", "tpcap", "--out", out]
        assert call([*asked, "--vehicle", vehicle]) == 0
    written = json.loads((tmp_path / "far.jsonl").read_text())
    assert written["start"] == [far[0], far[1], 0.1]
    car = read_vehicle(VEHICLES / "tpcap-car.yaml")
    (near,), (there,) = (read_problems(tmp_path / f"{name}.jsonl", car) for name in ("near", "far"))
    shift = (np.array(far) - there.offset) / there.scale  # less than a metre: offsets are whole ones
    assert math.hypot(*shift) < 1.0
    assert np.allclose(there.obstacles.vertices, near.obstacles.vertices + shift, rtol=0.0, atol=1e-6)


@pytest.mark.skipif(not GIVEN.is_dir(), reason="the problems of others do not lie beside the repository")
def test_every_model_of_dynobench_has_a_vehicle_of_its_size_and_limits() -> None:
    models = json.loads((GIVEN / "dynobench/problems.json").read_text())["models"]
    for model, about in models.items():
        vehicle = read_vehicle(VEHICLES / f"dynobench-{model.replace('_', '-')}.yaml")
        speeds = [vehicle.scale * vehicle.min_speed, vehicle.scale * vehicle.max_speed]
        assert speeds == [about["min_vel"], about["max_vel"]]
        if "min_angular_vel" in about:
            least, most = about["min_angular_vel"], about["max_angular_vel"]
            assert isinstance(vehicle, DifferentialDrive)
            assert vehicle.max_turn_rate == min(-least, most)
        if about.get("shape") == "sphere":
            (outline,) = vehicle.about.outline
            ring = vehicle.scale * shapely.Polygon(outline).exterior.distance(shapely.Point(0.0, 0.0))
            reach = vehicle.scale * max(math.hypot(x, y) for x, y in outline)
            assert about["radius"] - 1e-12 <= ring
            assert reach <= 1.021 * about["radius"]


def problem_of(folder: Path, model: str, **fields: object) -> Problem:
    raw = {"id": "kin", "model": model, "bounds": [[0, 0], [6, 6]], "obstacles": [], **fields}
    (folder / "kin.json").write_text(json.dumps({"problems": [raw]}))
    return imported(folder / "kin.json", "dynobench", f"dynobench-{model.replace('_', '-')}")["kin"]


def test_a_second_order_car_starts_in_motion_with_its_wheels_turned(tmp_path: Path) -> None:
    problem = problem_of(tmp_path, "car2_v0", start=[1, 2, 0.3, 0.2, -0.4], goal=[4, 4, 1, 0, 0])
    assert problem.scale * problem.start_motion[0] == pytest.approx(0.2)
    assert problem.start_motion[1] == pytest.approx(-0.4)
    assert problem.arrival is not None
    assert problem.arrival.heading == 1.0
    assert problem.scale * problem.arrival.most_speed == pytest.approx(0.04)


@quick
@given(
    x=st.floats(-1.0, 7.0), y=st.floats(-1.0, 7.0), heading=st.floats(-3.1, 3.1),
    model=st.sampled_from(["car2_v0", "unicycle1_v0", "unicycle_first_order_0"]),
)  # fmt: skip
def test_whoever_stays_in_the_bounds_keeps_the_reference_point_in_those_of_dynobench(
    x: float, y: float, heading: float, model: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    rest = [0, 0] if model == "car2_v0" else []
    ends = {"start": [3, 3, 0, *rest], "goal": [4, 4, 0, *rest]}
    problem = problem_of(tmp_path_factory.mktemp("bounds"), model, **ends)
    vehicle = read_vehicle(VEHICLES / f"dynobench-{model.replace('_', '-')}.yaml")
    box = shapely.box(-vehicle.rear, -0.5 * vehicle.width, vehicle.front, 0.5 * vehicle.width)
    turned = shapely.affinity.rotate(box, heading, origin=(0, 0), use_radians=True)
    body = shapely.affinity.translate(turned, x / problem.scale, y / problem.scale)
    if shapely.box(*problem.bounds).contains(body):
        assert -1e-9 <= x <= 6.0 + 1e-9
        assert -1e-9 <= y <= 6.0 + 1e-9


SQUARE = [[9.0, -3.0], [12.0, -3.0], [12.0, 3.0], [9.0, 3.0]]


@pytest.mark.parametrize(
    ("obstacles", "area"),
    [
        ([SQUARE[::-1]], 18.0),
        ([[*SQUARE, SQUARE[0]]], 18.0),
        ([[SQUARE[0], SQUARE[0], SQUARE[1], SQUARE[2], SQUARE[2], SQUARE[2], SQUARE[3]]], 18.0),
        ([[*SQUARE[:1], [10.0, -3.0], *SQUARE[1:]]], 18.0),
        ([SQUARE, [[12, -3], [15, -3], [15, 3], [12, 3]]], 36.0),  # touching
        ([[[100, 100], [103, 100], [103, 106], [100, 106]]], 18.0),  # out of bounds
        ([[[-4, -3], [14, -3], [14, 8], [-4, 8], [-4, 7.5], [13.5, 7.5], [13.5, -2.5], [-4, -2.5]]], 23.0),
    ],
)
@pytest.mark.parametrize("far", [(0.0, 0.0), (4_484_378_811.25, -354_286_007.25)])
def test_polygons_are_read_however_they_are_drawn(
    obstacles: list[list[list[float]]], area: float, far: tuple[float, float], tmp_path: Path
) -> None:
    x, y = far
    moved = [[[x + u, y + w] for u, w in polygon] for polygon in obstacles]
    case = {"id": "drawn", "start": [x, y, 0.1], "goal": [x + 6.0, y + 4.0, 1.0], "obstacles": moved}
    (tmp_path / "drawn.json").write_text(json.dumps({"cases": [case]}))
    problem = imported(tmp_path / "drawn.json", "tpcap", "tpcap-car")["drawn"]
    pieces = [shapely.Polygon(problem.scale * piece) for piece in problem.obstacles.pieces()]
    assert sum(piece.area for piece in pieces) == pytest.approx(area, rel=1e-6)
    offset = np.array(problem.offset) - far
    for polygon in obstacles:
        wanted = shapely.Polygon(np.array(polygon) - offset)
        assert shapely.union_all(pieces).buffer(1e-5).contains(wanted)


def test_an_obstacle_over_the_start_is_told_in_one_line(tmp_path: Path) -> None:
    case = {**TPCAP, "obstacles": [[[-1, -1], [1, -1], [1, 1], [-1, 1]]]}
    (tmp_path / "case.json").write_text(json.dumps({"cases": [case]}))
    settings = ImportSettings(vehicle=read_vehicle(VEHICLES / "tpcap-car.yaml"))
    parts = [
        import_part(source_at(tmp_path / "case.json", "tpcap"), part, settings) for part in ("train", "test")
    ]
    ((_, told),) = [each for part in parts for each in part.skipped]
    assert "start footprint" in told
    assert "\n" not in told
