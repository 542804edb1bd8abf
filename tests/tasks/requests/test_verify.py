"""``verify`` of one memory or library: each plan is judged, and what its vehicle cannot drive is a fault."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flows.cli.main import call
from planners.memory.library.plan_library import gathered_library
from planners.world.problem import Plan
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR
from storage.archives.libraries import save_library
from tests.tasks.served import write_memory


def _driven(acceleration: float, steps: int = 40) -> Plan:
    controls = np.tile([acceleration, 0.0], (steps, 1))
    return Plan(simulate(np.zeros(5), controls, CAR), controls, CAR.dt)


def test_the_plans_of_a_memory_and_of_a_library_are_judged(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_memory(tmp_path / "memory", plans=4)
    assert call(["verify", str(tmp_path / "memory")]) == 0
    assert "4 plans" in capsys.readouterr().out
    slow, fast = _driven(0.5 * CAR.max_acceleration, 10), _driven(2.0 * CAR.max_acceleration)
    save_library(tmp_path / "library", gathered_library("general", CAR, [("slow", slow)]))
    assert call(["verify", str(tmp_path / "library")]) == 0
    save_library(tmp_path / "library", gathered_library("general", CAR, [("slow", slow), ("fast", fast)]))
    assert call(["verify", str(tmp_path / "library")]) == 1
    told = capsys.readouterr().err
    assert "plan 1" in told
    assert "plan 0" not in told


def test_a_folder_of_something_else_is_refused_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(["verify", str(tmp_path)]) == 1
    assert capsys.readouterr().err.count("\n") == 1
