"""Where the lattice finds nothing, or its way winds through doors, another planner is asked as well."""

from __future__ import annotations

import math
from unittest.mock import patch

import numpy as np
import pytest

from planners.search import search_and_polish as searching
from planners.search.search_and_polish import SECOND
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.arrays import Point, Pose
from planners.world.authority.authority import faults
from planners.world.problem import Problem, obstacles_of
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, Vehicle
from tests.speed.one_version import through_doors
from tests.worlds import box

DOOR_M = 1.6
HIGH_M = 21.0


def rooms(doors: tuple[float, float], start: Pose, goal: Point) -> Problem:
    """Three rooms in a row, with doors between them that begin at two heights (m)."""
    walls = []
    for x, low in zip((10.0, 19.9), doors, strict=True):
        high = low + DOOR_M
        walls.append([box(x, 0.5 * low, 0.0, 0.1, 0.5 * low)])
        walls.append([box(x, 0.5 * (high + HIGH_M), 0.0, 0.1, 0.5 * (HIGH_M - high))])
    problem = Problem("rooms", "rooms", start, goal, 0.5, (0.0, 0.0, 30.0, HIGH_M), obstacles_of(walls))
    return to_canonical(problem)[0]


# found among 300 that were drawn at random
@pytest.mark.parametrize(
    ("doors", "start", "goal"),
    [
        ((6.6, 14.9), (5.1, 7.2, -2.0), (24.9, 8.3)),
        ((4.5, 10.4), (7.6, 2.8, 2.2), (27.8, 10.9)),
        ((9.3, 5.4), (7.1, 16.2, 0.3), (26.4, 13.1)),
        ((11.4, 15.3), (7.1, 11.3, 2.5), (27.5, 14.5)),
    ],
)
def test_a_car_gets_through_doors_that_the_lattice_alone_does_not_find(
    doors: tuple[float, float], start: Pose, goal: Point
) -> None:
    problem = rooms(doors, start, goal)
    with patch.dict(SECOND, clear=True):
        assert solve(problem, "lattice").plan is None
    answer = solve(problem, "lattice")
    assert answer.plan is not None
    assert faults(problem, answer.plan) == []


# found among a hundred of seed 303 that were drawn at random
@pytest.mark.parametrize("number", [1, 13])
def test_a_pose_behind_doors_is_reached_by_way_of_its_place(number: int) -> None:
    problem = to_canonical(through_doors(np.random.default_rng([303, number]), CAR, pose=True))[0]
    with patch.dict(SECOND, clear=True):
        assert solve(problem, "lattice").plan is None
    answer = solve(problem, "lattice")
    assert answer.plan is not None
    assert faults(problem, answer.plan) == []


@pytest.mark.parametrize("vehicle", [CAR, CAR_1_TRAILER])
def test_poses_behind_doors_are_reached_sooner_so(vehicle: Vehicle) -> None:
    """Planning and driving together; and all that are reached otherwise are reached."""
    alone, both = [], []
    for number in range(8):
        problem = to_canonical(through_doors(np.random.default_rng([304, number]), vehicle, pose=True))[0]
        answer = solve(problem, "lattice", vehicle=vehicle)
        with patch.object(searching, "FAR_M", math.inf):
            other = solve(problem, "lattice", vehicle=vehicle)
        assert answer.plan is not None or other.plan is None
        if answer.plan is not None and other.plan is not None:
            assert faults(problem, answer.plan, vehicle) == []
            both.append(answer.plan.duration_s)
            alone.append(other.plan.duration_s)
    assert sum(both) <= sum(alone)
