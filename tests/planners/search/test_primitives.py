"""Motion primitives: how sharply they turn."""

from __future__ import annotations

from pathlib import Path

import pytest

from planners.search.lattice import LatticeSettings
from planners.search.primitives import SHARES, controls_of, paced
from planners.world.vehicles.dynamics import step
from planners.world.vehicles.vehicle import VEHICLES, Vehicle, state_size
from storage.vehicles.vehicle_files import read_vehicle

FILES = (
    "create3",
    "hunter",
    "jackal",
    "race-car",
    "tugger-train",
    "turtlebot",
    "benchmarks/dynobench-unicycle1-v2",
)
ALL = {**VEHICLES, **{name: read_vehicle(Path(f"docs/vehicles/{name}.yaml")) for name in FILES}}
LEVEL = LatticeSettings().anywhere[0]
SHARPEST = SHARES.index(1.0)  # the primitive that turns fully, forwards


def turned(vehicle: Vehicle, sharpest: float) -> float:
    """Radians by which the sharpest primitive turns at full speed."""
    lattice = paced(LEVEL, vehicle, sharpest)
    state = (0.0, 0.0, 0.0, vehicle.max_speed, 0.0, *(0.0,) * (state_size(vehicle) - 5))
    for _ in range(lattice.steps):
        state = step(state, *controls_of(state, SHARPEST, lattice, vehicle), vehicle)
    return float(abs(state[2]))


@pytest.mark.parametrize("vehicle", ALL.values(), ids=ALL)
def test_nobody_turns_back_within_a_primitive_nor_drives_straight_on(vehicle: Vehicle) -> None:
    assert 0.4 < turned(vehicle, LatticeSettings().sharpest) < 0.6 * 3.14


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
def test_built_in_vehicles_turn_as_sharply_as_they_can(vehicle: Vehicle) -> None:
    assert turned(vehicle, LatticeSettings().sharpest) == turned(vehicle, 10.0)
