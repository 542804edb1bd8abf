from __future__ import annotations

import math

import pytest
from hypothesis import given, settings

from planners.maps.questions import DISTANCES_M, question_in
from planners.world.classes.problem_classes import problem_class
from planners.world.problem_faults import problem_fault
from planners.world.vehicles.vehicle import CAR, VEHICLES, Vehicle
from tests.planners.world.strategies import seeds


@pytest.mark.parametrize(
    "vehicle", [*VEHICLES.values(), CAR._replace(min_speed=0.3)], ids=[*VEHICLES, "always driving"]
)
@settings(max_examples=10)
@given(seed=seeds)
def test_a_question_makes_sense_and_is_always_the_same(vehicle: Vehicle, seed: int) -> None:
    world = problem_class("trap", vehicle=vehicle).draw(seed, 0)
    for pose in (False, True) if vehicle.min_speed <= 0.0 else (False,):
        asked = question_in(world, 7, seed, vehicle, pose)
        again = question_in(world, 7, seed, vehicle, pose)
        assert asked is not None
        assert again is not None
        assert (asked.start, asked.goal, asked.start_motion) == (again.start, again.goal, again.start_motion)
        assert problem_fault(asked, vehicle) is None
        assert DISTANCES_M[0] <= math.dist(asked.start[:2], asked.goal) <= DISTANCES_M[1]
        assert (asked.arrival is not None) == pose


def test_who_cannot_brake_is_asked_nothing() -> None:
    world = problem_class("random").draw(1, 0)
    assert question_in(world, 0, 1, CAR._replace(max_acceleration=1e-9)) is None


def test_who_cannot_stop_is_asked_to_pass_its_poses() -> None:
    vehicle = CAR._replace(min_speed=0.5)
    worlds = problem_class("random", vehicle=vehicle)
    asked = [question_in(worlds.draw(3, number), number, 3, vehicle, True) for number in range(6)]
    arrivals = [each.arrival for each in asked if each is not None]
    assert len(arrivals) > 3
    for arrival in arrivals:
        assert arrival is not None
        assert (arrival.least_speed, arrival.most_speed) == (0.5, vehicle.max_speed)
