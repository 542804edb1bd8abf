"""Who moves at the start looks for manoeuvres from where it has stopped, too, if nothing else is found."""

from __future__ import annotations

import numpy as np
import pytest

from planners.maps.questions import question_in
from planners.search import lattice
from planners.search.manoeuvres.manoeuvring import Manoeuvring
from planners.search.query import Limits, Query
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.arrays import Floats
from planners.world.authority.authority import faults
from planners.world.classes.problem_classes import problem_class
from planners.world.compiling import working_clock
from planners.world.geometry.occupancy import Bits
from planners.world.problem import Problem, start_state
from planners.world.vehicles.vehicle import VEHICLES


def asked_of(name: str, world: str, number: int) -> Problem:
    vehicle = VEHICLES[name]
    asked = question_in(problem_class(world, vehicle=vehicle).draw(5001, number), 5001, 0, vehicle, pose=True)
    assert asked is not None
    return to_canonical(asked)[0]


@pytest.mark.parametrize(
    ("name", "world", "number"),
    [("car", "curves", 144), ("car", "random", 423), ("car-2-trailers", "curves", 3)],
)
def test_a_pose_is_reached_that_no_search_reached_on_the_move(name: str, world: str, number: int) -> None:
    problem, vehicle = asked_of(name, world, number), VEHICLES[name]
    start = start_state(problem, vehicle)
    assert start[3] > 0.0
    plan = solve(problem, "lattice", seed=1, vehicle=vehicle, polished=False).plan
    assert plan is not None
    assert faults(problem, plan, vehicle) == []
    assert np.array_equal(plan.states[0], start)
    assert np.any(np.abs(plan.states[:-1, 3]) < 1e-9)  # it stops on the way


def test_the_search_from_the_stop_has_only_the_time_that_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    limits: list[float] = []

    class Noting(Manoeuvring):
        def __init__(self, query: Query, goal: Floats, occupied: Bits) -> None:
            limits.append(query.limits.seconds)
            super().__init__(query, goal, occupied)

    monkeypatch.setattr(lattice, "Manoeuvring", Noting)
    began = working_clock()
    solve(
        asked_of("car", "random", 423), "lattice", seed=1, limits=Limits(60_000, seconds=20.0), polished=False
    )
    on_the_move, from_the_stop = limits
    assert on_the_move <= 20.0
    assert 20.0 - (working_clock() - began) < from_the_stop < on_the_move
