from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.world.problem import Problem
from storage.errors import StorageError
from storage.exchange.problem_files import FORMATS
from storage.exchange.problems import read_problems, write_problems
from storage.tables.imported_problems import read_imported, write_imported
from tests.storage.samples import box, problem_with, problems, quick, same_problem, star

GOOD: dict[str, Any] = {
    "id": "w-17",
    "class": "forest",
    "start": [0.0, 0.0, 0.785],
    "goal": [50.0, 50.0],
    "goal_radius": 2.0,
    "bounds": [-7.0, -7.0, 57.0, 57.0],
    "obstacles": [[[10.0, 12.0], [14.0, 12.0], [14.0, 15.0], [10.0, 15.0]]],
}
BOW_TIE = [[10, 10], [12, 13], [12, 10], [10, 12]]


@quick
@given(
    found=st.lists(problems(), max_size=4, unique_by=lambda problem: problem.id),
    ending=st.sampled_from([".jsonl", ".parquet"]),
)
def test_problems_come_back_exactly(
    tmp_path_factory: pytest.TempPathFactory, found: list[Problem], ending: str
) -> None:
    path = tmp_path_factory.getbasetemp() / f"problems{ending}"
    write_problems(path, found)
    before = path.read_bytes()
    read = read_problems(path)
    assert len(read) == len(found)
    assert all(map(same_problem, found, read))
    write_problems(path, read)
    assert path.read_bytes() == before


@quick
@given(found=st.lists(problems(), max_size=4))
def test_imported_problems_come_back_exactly(
    tmp_path_factory: pytest.TempPathFactory, found: list[Problem]
) -> None:
    path = tmp_path_factory.getbasetemp() / "imported.parquet"
    write_imported(path, found)
    assert all(map(same_problem, found, read_imported(path)))


def test_one_problem_makes_a_json_file_and_two_do_not(tmp_path: Path) -> None:
    problem = problem_with([box(20, 20), box(21, 21)], [box(30, 30)])
    write_problems(tmp_path / "p.json", [problem])
    assert same_problem(read_problems(tmp_path / "p.json")[0], problem)
    with pytest.raises(StorageError, match="can hold only one problem, got 2"):
        write_problems(tmp_path / "q.json", [problem, problem])
    assert not (tmp_path / "q.json").exists()


def test_the_contract_is_read_in_all_three_formats(tmp_path: Path) -> None:
    (tmp_path / "p.json").write_text(json.dumps(GOOD))
    (tmp_path / "p.jsonl").write_text(f"\n{json.dumps(GOOD)}\n\n")
    pq.write_table(pa.Table.from_pylist([GOOD]), tmp_path / "p.parquet")
    one, two, three = (read_problems(tmp_path / f"p{ending}")[0] for ending in FORMATS)
    assert same_problem(one, two)
    assert same_problem(one, three)
    assert (one.id, one.class_name, one.start, one.goal) == (
        "w-17",
        "forest",
        (0.0, 0.0, 0.785),
        (50.0, 50.0),
    )
    assert sorted(map(tuple, one.obstacles.vertices)) == sorted(map(tuple, GOOD["obstacles"][0]))


@pytest.mark.parametrize("scale", [0.2, 1.0, 3.0])
def test_a_scaled_problem_is_the_canonical_one_in_lengths_outside(tmp_path: Path, scale: float) -> None:
    fields = {
        **GOOD,
        "scale": scale,
        "goal": [50.0 * scale, 50.0 * scale],
        "goal_radius": 2.0 * scale,
        "bounds": [scale * bound for bound in GOOD["bounds"]],
        "obstacles": [[[scale * x, scale * y] for x, y in GOOD["obstacles"][0]]],
    }
    (tmp_path / "p.json").write_text(json.dumps(fields))
    (problem,) = read_problems(tmp_path / "p.json")
    assert problem.scale == scale
    assert problem.goal == pytest.approx((50.0, 50.0))
    assert problem.bounds == pytest.approx(GOOD["bounds"])
    assert np.allclose(problem.obstacles.vertices, GOOD["obstacles"][0], atol=1e-5)
    for path in (tmp_path / "q.jsonl", tmp_path / "q.parquet"):
        write_problems(path, [problem])
        (again,) = read_problems(path)
        assert again.scale == scale
        assert np.array_equal(again.obstacles.vertices, problem.obstacles.vertices)
        assert again.goal == pytest.approx(problem.goal, rel=1e-15)
    write_imported(tmp_path / "r.parquet", [problem])
    assert read_imported(tmp_path / "r.parquet")[0].scale == scale


def test_a_missing_id_comes_from_the_file_and_a_missing_class_is_unknown(tmp_path: Path) -> None:
    nameless = {name: value for name, value in GOOD.items() if name not in ("id", "class")}
    (tmp_path / "mine.jsonl").write_text(f"{json.dumps(nameless)}\n{json.dumps(nameless)}\n")
    (tmp_path / "mine.json").write_text(json.dumps(nameless))
    assert [problem.id for problem in read_problems(tmp_path / "mine.jsonl")] == ["mine-1", "mine-2"]
    assert [problem.id for problem in read_problems(tmp_path / "mine.json")] == ["mine"]
    assert read_problems(tmp_path / "mine.json")[0].class_name == "unknown"


def test_a_polygon_that_is_not_convex_stays_one_obstacle(tmp_path: Path) -> None:
    fields = {**GOOD, "obstacles": [star(25, 25, [6, 2, 6, 2, 6, 2, 6, 2]).tolist(), box(15, 30).tolist()]}
    (tmp_path / "p.json").write_text(json.dumps(fields))
    obstacles = read_problems(tmp_path / "p.json")[0].obstacles
    assert len(obstacles.obstacle_starts) == 3
    assert len(obstacles.piece_starts) > 3


def test_coordinates_are_rounded_to_float32_and_then_kept(tmp_path: Path) -> None:
    fields = {**GOOD, "obstacles": [[[10.1, 12.3], [14.7, 12.3], [14.7, 15.9]]]}
    (tmp_path / "p.json").write_text(json.dumps(fields))
    vertices = read_problems(tmp_path / "p.json")[0].obstacles.vertices
    assert np.array_equal(vertices, vertices.astype(np.float32))
    assert np.allclose(vertices, fields["obstacles"][0], atol=1e-6)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        *[
            ({name: None}, f"field {name} is missing")
            for name in GOOD
            if name not in ("id", "class", "goal_radius")
        ],
        ({"start": [0, 0]}, "start must be a list of 3 numbers"),
        ({"start": "origin"}, "start must be a list of 3 numbers"),
        ({"start": [0, 0, True]}, "start must hold numbers"),
        ({"goal": [50, "50"]}, "goal must hold numbers"),
        ({"goal": [50, None]}, "goal must hold numbers"),
        ({"goal": [50, math.nan]}, "finite"),
        ({"goal": [math.inf, 50]}, "finite"),
        ({"goal": [10**400, 50]}, "finite"),
        ({"start": [0, 0, 1e300]}, "start heading is 1e+300"),
        ({"goal": [80, 50]}, "goal centre (80, 50)"),
        ({"scale": 20.0}, "start footprint of car (scale 20) at (0, 0,"),
        ({"goal": [50, 50, 0, 0]}, "goal must be a list of 2 numbers, or 3"),
        ({"goal": [50, 50, math.nan]}, "has goal_radius"),
        ({"goal_tolerance": [0.1, 0.1]}, "has goal_tolerance, but a place has goal_radius"),
        ({"start_speed": 9}, "start speed is 9 m/s; the vehicle allows -1 to 4"),
        ({"start_speed": math.nan}, "start speed is nan"),
        ({"start_speed": "fast"}, "start_speed must hold numbers"),
        ({"start_steering": -1}, "start steering is -1"),
        ({"start_turn_rate": 0.1}, "has start_turn_rate, but the state of 'car' has speed, steering"),
        ({"start_hitch": [0.1]}, "has no trailer; name the vehicle"),
        ({"goal_speed": 1}, "goal_speed must be a list of 2 numbers"),
        ({"goal_speed": [2, 1]}, "goal_speed [2, 1] is inverted"),
        ({"goal_speed": [5, 6]}, "beyond the vehicle"),
        ({"goal_hitch": [0.1]}, "has no trailer; name the vehicle"),
        *[
            ({"goal": [50, 50, 1], "goal_radius": None, "goal_tolerance": [0.1, angle]}, "goal_tolerance")
            for angle in (math.inf, -math.inf, math.nan, 10**400)
        ],
        ({"goal_hitch": [0.1], "goal_hitch_tolerance": [math.inf]}, "goal_hitch_tolerance"),
        (
            {"moving": [{"polygon": [[1, 1], [2, 1], [2, 2]], "velocity": [1, 0]}]},
            "what moves is not supported",
        ),
        ({"scale": 0}, "scale is 0; expected"),
        ({"scale": math.nan}, "scale is nan; expected"),
        ({"scale": "large"}, "scale must hold numbers"),
        ({"goal_radius": 0}, "goal_radius is 0"),
        ({"goal_radius": -1.0}, "goal_radius is -1"),
        ({"goal_radius": [2]}, "goal_radius must hold numbers"),
        ({"bounds": [57, -7, -7, 57]}, "inverted"),
        ({"bounds": [-9000, -7, 9000, 57]}, "wider"),
        ({"bounds": [-7, -7, 57]}, "bounds must be a list of 4"),
        ({"bounds": [5, 5, 57, 57]}, "start footprint"),
        ({"bounds": [0, 0, 57, 57]}, "start footprint"),
        ({"bounds": [-7, -7, 49, 57]}, "goal centre"),
        ({"id": 17}, "id must be printable text"),
        ({"id": "a\nb"}, "id must be printable text"),
        ({"class": ["trap"]}, "class must be printable text"),
        ({"obstacles": {}}, "obstacles must be a list"),
        ({"obstacles": [[]]}, "obstacle 1 has 0 points"),
        ({"obstacles": [GOOD["obstacles"][0], [[1, 2], [3, 4]]]}, "obstacle 2 has 2 points"),
        ({"obstacles": [[[20, 20], [21, 21], [22, 22]]]}, "obstacle 1 has no area"),
        ({"obstacles": [BOW_TIE]}, "obstacle 1 crosses"),
        ({"obstacles": [[[1, 2, 3], [3, 4, 5], [5, 6, 7]]]}, "obstacle 1 must be a list of points"),
        ({"obstacles": [[[1, "2"], [3, 4], [5, 7]]]}, "must hold numbers"),
        ({"obstacles": [[[20, 20], [21, math.nan], [22, 20]]]}, "obstacle 1 has a coordinate"),
        ({"obstacles": [box(1.5, 1.5, 0.4).tolist()]}, "start footprint"),
        ({"obstacles": [box(50, 50).tolist()]}, "goal centre"),
        ({"groups": [2]}, "groups add up to 2 polygons"),
        ({"groups": [0, 1]}, "groups must be"),
        ({"groups": [True, 1]}, "groups must be"),
    ],
)
@pytest.mark.parametrize("ending", [".json", ".jsonl"])
def test_a_bad_problem_is_one_line_with_file_place_and_id(
    tmp_path: Path, change: dict[str, Any], reason: str, ending: str
) -> None:
    path = tmp_path / f"bad{ending}"
    first = {**GOOD, "id": "good"}
    bad = {name: value for name, value in {**GOOD, **change}.items() if value is not None}
    path.write_text(json.dumps(bad) if ending == ".json" else f"{json.dumps(first)}\n{json.dumps(bad)}\n")
    with pytest.raises(StorageError) as error:
        read_problems(path)
    text = str(error.value)
    assert "\n" not in text
    assert str(path) in text
    assert reason in text
    assert "id" in change or "(id 'w-17')" in text
    assert ending == ".json" or "line 2" in text


@pytest.mark.parametrize("value", [None, []])
def test_a_problem_may_say_that_nothing_moves(tmp_path: Path, value: object) -> None:
    path = tmp_path / "p.json"
    path.write_text(json.dumps({**GOOD, "moving": value}))
    assert len(read_problems(path)) == 1


@pytest.mark.parametrize("value", ["[]", "3", "null", '"w"', "[[1, 2]]"])
def test_what_is_no_object_is_no_problem(tmp_path: Path, value: str) -> None:
    (tmp_path / "p.json").write_text(value)
    with pytest.raises(StorageError, match="expected an object"):
        read_problems(tmp_path / "p.json")


def test_an_id_that_occurs_twice_is_refused(tmp_path: Path) -> None:
    (tmp_path / "p.jsonl").write_text(f"{json.dumps(GOOD)}\n{json.dumps(GOOD)}\n")
    with pytest.raises(StorageError, match=r"line 2 \(id 'w-17'\): this id occurs twice"):
        read_problems(tmp_path / "p.jsonl")


def test_a_file_that_is_missing_cut_off_or_of_another_kind_is_refused(tmp_path: Path) -> None:
    (tmp_path / "cut.json").write_text(json.dumps(GOOD)[:-5])
    (tmp_path / "cut.jsonl").write_text(json.dumps(GOOD) + "\n" + json.dumps(GOOD)[:20])
    (tmp_path / "deep.json").write_text("[" * 100_000)
    (tmp_path / "picture.json").write_bytes(b"\x89PNG\xff")
    (tmp_path / "cut.parquet").write_bytes(b"PAR1")
    (tmp_path / "other.parquet").write_bytes(b"")
    pq.write_table(pa.table({"x": [1]}), tmp_path / "other.parquet")
    (tmp_path / "folder.json").mkdir()
    for name, reason in [
        ("gone.json", "does not exist"),
        ("gone.jsonl", "does not exist"),
        ("gone.parquet", "does not exist"),
        ("gone.csv", ".json, .jsonl, .parquet"),
        ("cut.json", "not valid JSON"),
        ("cut.jsonl", "line 2: it is not valid JSON"),
        ("deep.json", "not valid JSON"),
        ("picture.json", "not a text file"),
        ("cut.parquet", "not a complete Parquet file"),
        ("other.parquet", "unknown field 'x'"),
        ("folder.json", "is a folder"),
    ]:
        with pytest.raises(StorageError) as error:
            read_problems(tmp_path / name)
        assert reason in str(error.value)
        assert "\n" not in str(error.value)
        assert name in str(error.value)
