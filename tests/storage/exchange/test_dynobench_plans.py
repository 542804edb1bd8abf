from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from planners.world.problem import Plan
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR_2_TRAILERS, Vehicle
from storage.errors import StorageError
from storage.exchange.dynobench_plans import export_plan
from storage.exchange.plans import PlanRecord, write_plan
from storage.vehicles.vehicle_files import read_vehicle
from tests.storage.samples import quick

MODELS = [read_vehicle(path) for path in sorted(Path("docs/vehicles/benchmarks").glob("dynobench-*.yaml"))]


def slopes(state: np.ndarray, action: np.ndarray, vehicle: Vehicle) -> np.ndarray:
    """Dynobench's equations, in real metres."""
    heading, is_car = state[2], "car" in vehicle.about.name.decode()
    speed, turn = (action if vehicle.first_order else state[3:5]).tolist()
    turn = speed / 0.25 * np.tan(turn) if is_car else turn
    more = action.tolist()
    if vehicle.first_order:
        more = [speed / 0.5 * np.sin(heading - state[3])] if is_car else []
    return np.array([speed * np.cos(heading), speed * np.sin(heading), turn, *more])


@pytest.mark.parametrize("vehicle", MODELS, ids=lambda vehicle: vehicle.about.name.decode())
@quick
@given(st.integers(0, 2**32 - 1))
def test_what_is_written_obeys_dynobenchs_own_equations(
    vehicle: Vehicle, tmp_path_factory: pytest.TempPathFactory, seed: int
) -> None:
    folder, rng = tmp_path_factory.mktemp("plans"), np.random.default_rng(seed)
    size = 6 if "car1" in vehicle.about.name.decode() else 5
    start = np.zeros(size)
    start[:3] = rng.uniform(-3.0, 3.0, 3)
    start[3] = max(vehicle.min_speed, 0.0)
    most = np.array([0.3, 0.3])
    controls = rng.uniform(-most, most, (12, 2))
    states = simulate(start, controls, vehicle)
    plan = Plan(states, controls, vehicle.dt)
    record = PlanRecord("p", "solved", "searched", "lattice", "none", 0.1, plan, vehicle, vehicle.scale)
    write_plan(folder / "plan.json", record)
    export_plan(folder / "plan.json", folder / "out.yaml")
    written = yaml.safe_load((folder / "out.yaml").read_text())
    rows, actions = np.array(written["states"]), np.array(written["actions"])
    assert (len(rows), len(actions)) == (written["num_states"], written["num_actions"]) == (13, 12)
    assert written["cost"] == pytest.approx(1.2)
    for before, action, after in zip(rows[:-1], actions, rows[1:], strict=True):
        euler = before + vehicle.dt * slopes(before, action, vehicle)
        assert np.abs(euler - after).max() < 0.01  # what dynobench allows a step to jump


def test_two_trailers_are_refused(tmp_path: Path) -> None:
    plan = Plan(np.zeros((2, 7)), np.zeros((1, 2)))
    record = PlanRecord("p", "solved", "searched", "lattice", "none", 0.1, plan, CAR_2_TRAILERS)
    write_plan(tmp_path / "plan.json", record)
    with pytest.raises(StorageError, match="more than one trailer"):
        export_plan(tmp_path / "plan.json", tmp_path / "out.yaml")
    assert not (tmp_path / "out.yaml").exists()
