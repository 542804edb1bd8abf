from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
import shapely

from flows.cli.main import call
from planners.world.problem import Problem
from storage.exchange.problems import read_problems
from storage.vehicles.vehicle_files import read_vehicle
from storage.worlds.importing import ImportSettings, import_part
from storage.worlds.sources import source_at
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
    [("unicycle2_v0", [1.0, 1.0, 0.0], 5), ("unicycle1_v0", [1.0, 1.0], 3), ("car1_v0", [1.0, 1.0, 0.0], 4)],
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
