"""Worlds of polygons, of stacks of cells, and of problem files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from planners.world.problem import BOUNDS
from storage.exchange.problems import write_problems
from storage.worlds.importing import Imported, ImportSettings, import_part
from storage.worlds.pictures import PIXELS
from storage.worlds.sources import source_at
from tests.storage.samples import box, problem_with, quick, same_problem, stars
from tests.storage.worlds.samples import write_scene


def imported(path: Path, **settings: object) -> Imported:
    return import_part(source_at(path), "train", ImportSettings(**settings))  # type: ignore[arg-type]


@quick
@given(polygons=st.lists(stars, max_size=4))
def test_scenes_of_polygons_are_covered_exactly(
    tmp_path_factory: pytest.TempPathFactory, polygons: list[np.ndarray]
) -> None:
    folder = tmp_path_factory.getbasetemp() / "yard"
    folder.mkdir(exist_ok=True)
    write_scene(folder / "0.txt", [polygon.tolist() for polygon in polygons])
    (problem,) = imported(folder).problems
    assert (problem.id, problem.class_name, problem.bounds) == ("yard-0", "yard", BOUNDS)
    pieces = shapely.union_all([shapely.Polygon(piece) for piece in problem.obstacles.pieces()])
    whole = shapely.union_all([shapely.Polygon(polygon) for polygon in polygons])
    assert pieces.symmetric_difference(whole).area < 1e-3
    assert len(problem.obstacles.obstacle_starts) - 1 == len(polygons)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "has '' where the number of polygons was expected"),
        ("x", "has 'x' where the number of polygons was expected"),
        ("-1", "has '-1' where"),
        ("1\n3\n1 1 2 1 2", "has '' where a coordinate of polygon 1 was expected"),
        ("1\n9999999\n1 1", "where a coordinate of polygon 1"),
        ("1\n3\n1 1 2 1 2 nan", "polygon 1 has a coordinate that is not a finite number"),
        ("1\n2\n1 1 2 1", "polygon 1 has 2 points"),
        ("1\n4\n20 20 30 30 30 20 20 30", "crosses or touches itself"),
        ("1\n3\n20 20 30 20 30 30 7", "continues with '7'"),
        ("1\n3\n-5 -5 5 -5 0 5", "start footprint"),
    ],
)
def test_a_bad_scene_is_skipped_with_its_reason(tmp_path: Path, text: str, reason: str) -> None:
    (tmp_path / "0.txt").write_text(text)
    ((_, told),) = imported(tmp_path).skipped
    assert reason in told
    assert "\n" not in told


def test_stacks_of_cells_are_worlds_like_pictures(tmp_path: Path) -> None:
    stack = np.zeros((4, PIXELS, PIXELS), np.uint8)
    stack[:, 100:110, 60:70] = 1
    stack[3, :30, -30:] = 1  # over the goal
    np.save(tmp_path / "woods.npy", stack)
    found = {part: import_part(source_at(tmp_path / "woods.npy"), part) for part in ("train", "test")}  # type: ignore[arg-type]
    assert [problem.id for problem in found["train"].problems] == ["woods-0", "woods-2"]
    assert [problem.id for problem in found["test"].problems] == ["woods-1"]
    ((place, reason),) = found["test"].skipped
    assert place.endswith("woods.npy woods[3]")
    assert "goal centre" in reason
    np.save(tmp_path / "woods.npy", stack[:, 1:])
    ((_, reason),) = imported(tmp_path / "woods.npy").skipped
    assert "expected worlds [n, 201, 201]" in reason


def test_problem_files_keep_their_problems_and_list_the_bad_ones(tmp_path: Path) -> None:
    problems = [problem_with([box(20, 20 + i)], identity=f"p-{i}") for i in range(6)]
    write_problems(tmp_path / "mine.jsonl", problems)
    lines = (tmp_path / "mine.jsonl").read_text().splitlines()
    lines[4] = lines[4].replace('"goal"', '"gaol"')
    (tmp_path / "mine.jsonl").write_text("\n".join([*lines, lines[0], "{}"]))
    train, test = (import_part(source_at(tmp_path / "mine.jsonl"), part) for part in ("train", "test"))
    assert [p.id for p in train.problems] == ["p-0", "p-2"]
    assert [p.id for p in test.problems] == ["p-1", "p-3", "p-5"]
    assert all(same_problem(a, b) for a, b in zip(train.problems, problems[::2], strict=False))
    assert ["nearest is 'goal'" in reason for _, reason in train.skipped] == [True, False]
    assert "occurs twice" in train.skipped[1][1]
    assert "field start is missing" in test.skipped[0][1]


def test_an_id_of_two_files_is_skipped_the_second_time(tmp_path: Path) -> None:
    for part in ("train", "test"):
        (tmp_path / "mine" / part).mkdir(parents=True)
    for name in ("a", "b"):
        write_problems(tmp_path / "mine" / "train" / f"{name}.json", [problem_with([box(20, 20)])])
    found = imported(tmp_path / "mine")
    assert [problem.id for problem in found.problems] == ["p-1"]
    assert "which another problem has" in found.skipped[0][1]


def test_no_more_worlds_are_read_than_asked_for(tmp_path: Path) -> None:
    for number in range(8):
        write_scene(tmp_path / f"{number}.txt", [box(20, 20).tolist()])
    assert len(imported(tmp_path, count=2).problems) == 2


def test_a_world_that_cannot_be_read_does_not_hide_those_after_it(tmp_path: Path) -> None:
    worlds = np.zeros((4, PIXELS, PIXELS), np.uint8)
    worlds[1, 5, 5] = 2
    np.save(tmp_path / "worlds.npy", worlds)
    train, test = (import_part(source_at(tmp_path / "worlds.npy"), part) for part in ("train", "test"))
    assert (len(train.problems), len(test.problems), len(test.skipped)) == (2, 1, 1)
    assert "holds 2" in test.skipped[0][1]
