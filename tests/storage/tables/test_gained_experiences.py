"""What is learned on the job: no repeats, bounded, the same whoever wrote it when."""

from __future__ import annotations

import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from planners.memory.plans.experience import Experience
from planners.world.problem import Plan, start_state
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER
from storage.errors import InUseError, StorageError
from storage.places import files
from storage.places.files import locked
from storage.tables import gained_experiences as learned
from storage.tables.experiences import read_experiences, read_searched
from storage.tables.gained_experiences import (
    add_gained,
    gained_shards,
    rows_of_class,
    snapshot_path,
    take_snapshot,
)
from tests.planners.clock import ticks
from tests.storage.samples import problem_with

ROOT = Path(__file__).parents[3]
WRITERS = 2


def experience(number: int, identity: str = "", class_name: str = "curves") -> Experience:
    """A plan of its own for each number; a problem that is its own unless it is named."""
    problem = problem_with(identity=identity or f"p-{number}", class_name=class_name)
    states = np.tile(start_state(problem), (4, 1))
    states[:, 0] += number
    return Experience(problem, Plan(states, np.zeros((3, 2))))


def add(folder: Path, experiences: list[Experience]) -> None:
    """Add them, all with the same planner, seed and time."""
    count = len(experiences)
    add_gained(
        folder,
        experiences,
        planners=["gust"] * count,
        seeds=[1] * count,
        planning_seconds=[0.5] * count,
        vehicle=CAR,
    )


def known(folder: Path, name: str = "now") -> list[str]:
    """Ids in the order of the rule."""
    return [
        each.problem.id for each in read_experiences(snapshot_path(folder, take_snapshot(folder, name, CAR)))
    ]


def test_a_problem_and_a_plan_are_learned_once(tmp_path: Path) -> None:
    add(tmp_path, [experience(1), experience(2), experience(1, "same plan"), experience(3, "p-2")])
    add(tmp_path, [experience(2)])
    assert len(known(tmp_path)) == 2


def test_the_order_of_writing_and_merging_does_not_matter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(learned, "SHARDS", 3)
    monkeypatch.setattr(learned, "MOST", 10)
    numbers = list(range(30))
    for number in numbers:
        add(tmp_path / "one", [experience(number)])
    add(tmp_path / "other", [experience(number) for number in reversed(numbers)])
    assert len(gained_shards(tmp_path / "one")) <= 4
    assert known(tmp_path / "one") == known(tmp_path / "other")
    assert len(known(tmp_path / "one")) == 10


def test_the_bound_is_of_each_class(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(learned, "MOST", 2)
    add(tmp_path, [experience(i, class_name="a" if i < 5 else "b") for i in range(6)])
    snapshot = snapshot_path(tmp_path, take_snapshot(tmp_path, "now", CAR))
    rows = {name: rows_of_class(snapshot, name) for name in ("a", "b", "c")}
    assert {name: len(some) for name, some in rows.items()} == {"a": 2, "b": 1, "c": 0}
    (only,) = read_searched(snapshot, rows["b"], CAR)
    assert (only.experience.problem.id, only.planner, only.seed) == ("p-5", "gust", 1)


def test_a_snapshot_stays_what_it_was(tmp_path: Path) -> None:
    add(tmp_path, [experience(1)])
    monday = take_snapshot(tmp_path, "monday", CAR)
    add(tmp_path, [experience(2)])
    tuesday = take_snapshot(tmp_path, "tuesday", CAR)
    assert take_snapshot(tmp_path, "monday", CAR) == monday
    assert [len(read_experiences(snapshot_path(tmp_path, each))) for each in (monday, tuesday)] == [1, 2]
    assert monday.removeprefix("monday") != tuesday.removeprefix("tuesday")


def test_a_snapshot_waits_for_a_writer_that_merges_but_not_for_ever(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    add(tmp_path, [experience(1)])
    writer = ExitStack()
    writer.enter_context(locked(tmp_path / ".lock", "it"))
    monkeypatch.setattr(files, "time", SimpleNamespace(monotonic=ticks(1.0), sleep=lambda _: None))
    with pytest.raises(InUseError):
        take_snapshot(tmp_path, "now", CAR)
    monkeypatch.setattr(files.time, "sleep", lambda _: writer.close())
    assert len(known(tmp_path)) == 1


def test_nothing_learned_and_another_vehicle_are_told_in_a_line(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match="no learned problems"):
        take_snapshot(tmp_path, "now", CAR)
    add(tmp_path, [experience(1)])
    with pytest.raises(StorageError, match="was made for vehicle car, expected car-1-trailer"):
        take_snapshot(tmp_path, "now", CAR_1_TRAILER)


def test_many_processes_at_once_lose_and_repeat_nothing(tmp_path: Path) -> None:
    script = (
        "import sys; from pathlib import Path; from storage.tables import gained_experiences as learned;"
        "from tests.storage.tables.test_gained_experiences import add, experience; learned.SHARDS = 4\n"
        "for i in range(40): add(Path(sys.argv[1]), [experience(int(sys.argv[2]) * 20 + i)])"
    )  # each shares half of what it learns with the next
    writers = [
        subprocess.Popen([sys.executable, "-c", script, str(tmp_path), str(number)], cwd=ROOT)
        for number in range(WRITERS)
    ]
    assert [writer.wait(timeout=100) for writer in writers] == [0] * WRITERS
    assert sorted(known(tmp_path)) == sorted(f"p-{i}" for i in range(20 * WRITERS + 20))
    assert len(gained_shards(tmp_path)) < 40
