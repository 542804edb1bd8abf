"""``adapt``: what is kept passes for the other vehicle, with the same bytes each time, or a line says why."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flows.cli.main import call
from planners.memory.adaptation import Adaptation, Outcome
from planners.memory.library.plan_library import PlanLibrary
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.families import family
from planners.world.vehicles.vehicle import CAR
from planners.world.workspace import Workspace
from storage.archives.libraries import load_library
from storage.archives.memories import load_memory, save_memory
from storage.vehicles.vehicle_files import read_vehicle
from tasks.requests import adapt_pieces
from tests.planners.memories import memory_of
from tests.worlds import strewn

LARGER = Path("docs/vehicles/benchmarks/car-larger.yaml").absolute()
PLANS = 6


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a library of manoeuvres and a memory, of cars."""
    place = tmp_path_factory.mktemp("adapt")
    asked = ["gather", "perpendicular", "parallel", "--plans", str(PLANS), "--workers", "1"]
    assert call([*asked, "--out", str(place / "library")]) == 0
    save_memory(place / "memory", memory_of(strewn(seed, 10) for seed in range(3)))
    forwards = Path("storage/vehicles/built_in/car.yaml").read_text(encoding="utf-8")
    forwards = forwards.replace("name: car", "name: forwards").replace("speed: [-1, 4]", "speed: [0, 4]")
    (place / "forwards.yaml").write_text(forwards, encoding="utf-8")
    return place


def _library(place: Path) -> PlanLibrary:
    return load_library(place / "library")


def _same_bytes(one: Path, other: Path) -> bool:
    names = sorted(file.name for file in one.iterdir())
    assert names == sorted(file.name for file in other.iterdir())
    return all((one / name).read_bytes() == (other / name).read_bytes() for name in names)


@pytest.mark.parametrize("name", ["library", "memory"])
def test_for_the_same_vehicle_all_plans_are_kept_as_they_are(place: Path, tmp_path: Path, name: str) -> None:
    assert call(["adapt", str(place / name), "--vehicle", "car", "--out", str(tmp_path / "same")]) == 0
    load = load_library if name == "library" else load_memory
    before, after = load(place / name).plans, load(tmp_path / "same").plans
    assert len(after) == len(before)
    for old, new in zip(before, after, strict=True):
        assert new.duration_s == old.duration_s
        assert np.abs(new.states - old.states).max() < 1e-6


def test_what_is_kept_passes_the_authority_for_the_other_vehicle(place: Path) -> None:
    larger = read_vehicle(LARGER)
    library, workspace = _library(place), Workspace()
    outcomes = set()
    for question, stored in zip(library.questions, library.plans, strict=True):
        adapted = Adaptation(CAR, larger).adapted(stored, question, False, workspace)
        outcomes.add(adapted.outcome)
        assert bool(adapted.plans) == (adapted.outcome in (Outcome.WHOLE, Outcome.PART))
        name, difficulty, seed, number = question.split("-")
        drawn = to_canonical(family(name, difficulty, larger).draw(int(seed), int(number)))[0]
        for plan in adapted.plans:
            asked = adapted.question
            assert asked is not None
            assert not faults(asked, plan, larger)
            assert np.array_equal(asked.obstacles.vertices, drawn.obstacles.vertices)
            assert (asked.goal, asked.arrival, asked.bounds) == (drawn.goal, drawn.arrival, drawn.bounds)
    assert Outcome.WHOLE in outcomes


def test_the_same_bytes_after_an_interruption_too(
    place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = ["adapt", str(place / "library"), "--vehicle", str(LARGER), "--workers", "1", "--out"]
    assert call([*asked, str(tmp_path / "one")]) == 0
    monkeypatch.setattr(adapt_pieces, "PIECE", 2)
    drive, done = Adaptation.adapted, []

    def interrupted(*arguments: object) -> object:
        done.append(1)
        if len(done) == 4:
            raise KeyboardInterrupt
        return drive(*arguments)  # type: ignore[arg-type]  # they are passed on

    monkeypatch.setattr(Adaptation, "adapted", interrupted)
    assert call([*asked, str(tmp_path / "two")]) == 130
    assert not (tmp_path / "two").exists()
    assert call([*asked, str(tmp_path / "two")]) == 0
    stored = len(_library(place))
    assert len(done) == 4 + stored - 2  # the first piece was kept
    assert sorted(file.name for file in tmp_path.iterdir()) == ["one", "two"]
    assert _same_bytes(tmp_path / "one", tmp_path / "two")


def test_an_adapted_memory_answers_canonical_problems(place: Path, tmp_path: Path) -> None:
    larger = read_vehicle(LARGER)
    asked = ["adapt", str(place / "memory"), "--vehicle", str(LARGER), "--out", str(tmp_path / "memory")]
    assert call(asked) == 0
    memory = load_memory(tmp_path / "memory", larger)
    assert memory.scales == (larger.scale,)
    for plan in memory.plans:
        assert not faults(replace(strewn(1, 0), scale=larger.scale), plan, larger)


def test_plans_that_the_vehicle_cannot_drive_are_told_in_a_line(
    place: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ["adapt", str(place / "library"), "--vehicle", str(place / "forwards.yaml")]
    backwards = [(plan.states[:, 3] < 0.0).any() for plan in _library(place).plans]
    assert all(backwards)
    assert call([*asked, "--out", str(tmp_path / "none")]) == 1
    told = capsys.readouterr().err.splitlines()[-1]
    assert f"{len(backwards)} " in told
    assert "forwards" in told
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("out", ["thesis", "memory", "library"])
def test_nothing_is_replaced(place: Path, tmp_path: Path, out: str) -> None:
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "page.tex").write_text("words")
    target = tmp_path / out if out == "thesis" else place / out  # of which it is made, or another
    before = sorted(target.rglob("*"))
    assert call(["adapt", str(place / "memory"), "--vehicle", "car", "--out", str(target)]) == 2
    assert sorted(target.rglob("*")) == before
