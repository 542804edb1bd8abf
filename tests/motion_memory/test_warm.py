"""A memory that is loaded is ready: no question waits for a compiler."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from motion_memory import load
from planners.memory.library.plan_library import gathered_library
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.classes.families import families_of, family
from planners.world.vehicles.vehicle import CAR, VEHICLES, About
from storage.archives.libraries import save_library
from tasks.attempts.compile_assists import EMPTY

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", ["car", pytest.param("car-1-trailer", marks=pytest.mark.slow)])
def test_no_question_needs_a_kernel_that_loading_did_not(name: str, tmp_path: Path) -> None:
    vehicle = VEHICLES[name]
    slot = to_canonical(family(families_of(vehicle)[0], "easy", vehicle).draw(1, 0))[0]
    answered = []
    for problem in (EMPTY, slot):
        plan = solve(problem, "lattice", vehicle=vehicle).plan
        assert plan is not None
        answered.append((problem.id, plan))
    library = tmp_path / "library"
    save_library(library, gathered_library("some", vehicle, answered))
    said = subprocess.run(
        [sys.executable, "-m", "tests.motion_memory.kernels_after_load", str(library)],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert said.returncode == 0, said.stderr
    first, *rest = said.stdout.splitlines()
    assert int(first.split()[0]) > 0
    assert rest == []


def test_a_library_of_a_vehicle_that_cannot_drive_backwards_is_loaded_too(tmp_path: Path) -> None:
    vehicle = CAR._replace(min_speed=0.0, about=About(b"forwards"))
    plan = solve(EMPTY, "lattice", vehicle=vehicle).plan
    assert plan is not None
    save_library(tmp_path / "library", gathered_library("some", vehicle, [("empty", plan)]))
    answer = load(tmp_path / "library").plan(EMPTY)
    assert answer.plan is not None
