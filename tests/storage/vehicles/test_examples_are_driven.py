"""Vehicles in docs/vehicles are planned for as the built-in ones are, and nothing is compiled for them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from planners.search.primitives import grow_lattice
from planners.solve import solve
from planners.world.authority.authority import faults
from planners.world.classes.problem_classes import problem_class
from planners.world.geometry.collision import count_free_prefix
from planners.world.problem import obstacles_of
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR, Vehicle, trailers_of
from storage.vehicles.definitions import definition_of, vehicle_of
from storage.vehicles.vehicle_files import read_vehicle

EXAMPLES = sorted((Path(__file__).parents[3] / "docs" / "vehicles").glob("*.yaml"))
# kernels for three trailers are compiled when they are first used
EACH = [
    pytest.param(path, marks=[pytest.mark.slow] if len(trailers_of(read_vehicle(path))) > 2 else [])
    for path in EXAMPLES
]


@pytest.mark.parametrize("path", EACH, ids=lambda path: path.stem)
@pytest.mark.parametrize("planner", ["lattice", "gust"])
def test_a_plan_is_found_in_an_empty_and_in_a_cluttered_world(path: Path, planner: str) -> None:
    vehicle = read_vehicle(path)
    cluttered = problem_class("random", vehicle=vehicle).draw(7, 1)
    for problem in (replace(cluttered, obstacles=obstacles_of([])), cluttered):
        plan = solve(problem, planner, vehicle=vehicle, seed=1).plan
        assert plan is not None
        assert faults(problem, plan, vehicle) == []
        assert problem.scale == vehicle.scale


def test_nothing_is_compiled_for_another_car() -> None:
    kernels: list[Any] = [grow_lattice, count_free_prefix, simulate]

    def compiled_for(vehicle: Vehicle) -> list[int]:
        assert (
            solve(problem_class("random", vehicle=vehicle).draw(7, 1), "lattice", vehicle=vehicle).plan
            is not None
        )
        return [len(kernel.signatures) for kernel in kernels]

    cars = [each for each in map(read_vehicle, EXAMPLES) if type(each) is type(CAR)]
    assert len(cars) > 3
    before = compiled_for(CAR)
    assert all(compiled_for(car) == before for car in cars)


def test_a_car_that_cannot_stand_still_begins_with_its_least_speed() -> None:
    fields = definition_of(CAR)
    vehicle = vehicle_of(fields | {"name": "dubins", "limits": fields["limits"] | {"speed": [1.5, 4]}})
    for planner in ("lattice", "gust"):
        problem = problem_class("random", vehicle=vehicle).draw(7, 1)
        plan = solve(problem, planner, vehicle=vehicle, seed=1).plan
        assert plan is not None
        assert faults(problem, plan, vehicle) == []
        assert plan.states[:, 3].min() == plan.states[0, 3] == 1.5
