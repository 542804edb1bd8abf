"""Who moves at the start looks for manoeuvres from where it has stopped, too, if nothing else is found."""

from __future__ import annotations

import numpy as np
import pytest

from planners.maps.questions import question_in
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.problem_classes import problem_class
from planners.world.problem import start_state
from planners.world.vehicles.vehicle import VEHICLES


@pytest.mark.parametrize(
    ("name", "world", "number"),
    [("car", "curves", 144), ("car", "random", 423), ("car-2-trailers", "curves", 3)],
)
def test_a_pose_is_reached_that_no_search_reached_on_the_move(name: str, world: str, number: int) -> None:
    vehicle = VEHICLES[name]
    asked = question_in(problem_class(world, vehicle=vehicle).draw(5001, number), 5001, 0, vehicle, pose=True)
    assert asked is not None
    problem, _ = to_canonical(asked)
    start = start_state(problem, vehicle)
    assert start[3] > 0.0
    plan = solve(problem, "lattice", seed=1, vehicle=vehicle, polished=False).plan
    assert plan is not None
    assert faults(problem, plan, vehicle) == []
    assert np.array_equal(plan.states[0], start)
    assert np.any(np.abs(plan.states[:-1, 3]) < 1e-9)  # it stops on the way
