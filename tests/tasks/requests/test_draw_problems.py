"""``draw`` writes what the classes and families draw, in a file that ``plan`` and ``solve`` take."""

from __future__ import annotations

from pathlib import Path

import pytest

from flows.cli.main import call
from planners.world.classes.families import FAMILIES, WITH_TRAILERS, family
from planners.world.classes.problem_classes import problem_class
from planners.world.problem import Problem
from storage.exchange.problems import read_problems
from storage.vehicles.vehicle_files import said_vehicle


def same(one: Problem, other: Problem) -> bool:
    return (one.id, one.bounds, one.arrival) == (other.id, other.bounds, other.arrival) and bool(
        (one.obstacles.vertices == other.obstacles.vertices).all()
    )


@pytest.mark.parametrize("name", FAMILIES)
def test_a_family_is_written_for_a_vehicle_and_read_again(name: str, tmp_path: Path) -> None:
    for given in ("car-2-trailers",) if name in WITH_TRAILERS else ("car", "docs/vehicles/road-car.yaml"):
        vehicle, out = said_vehicle(given), tmp_path / f"{len(given)}.jsonl"
        asked = ["draw", name, "--difficulty", "hard", "--problems", "3", "--seed", "4"]
        assert call([*asked, "--vehicle", given, "--out", str(out)]) == 0
        drawn = [family(name, "hard", vehicle).draw(4, index) for index in range(3)]
        assert all(same(*pair) for pair in zip(read_problems(out, vehicle), drawn, strict=True))
        first = out.read_bytes()
        assert call([*asked, "--vehicle", given, "--out", str(out)]) == 0
        assert out.read_bytes() == first


def test_classes_can_be_drawn_too_and_a_picture_of_them(tmp_path: Path) -> None:
    out, picture = tmp_path / "trap.parquet", tmp_path / "trap.png"
    asked = ["draw", "trap", "--problems", "2", "--out", str(out), "--picture", str(picture)]
    assert call(asked) == 0
    drawn = [problem_class("trap").draw(1, index) for index in range(2)]
    assert all(same(*pair) for pair in zip(read_problems(out), drawn, strict=True))
    assert picture.stat().st_size > 5_000
