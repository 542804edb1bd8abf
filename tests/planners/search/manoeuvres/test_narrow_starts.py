"""Narrow places are left as they are entered: by time reversed, each is as hard as the other."""

from __future__ import annotations

import math

import numpy as np
import pytest

from planners.search.connection.connection import radius_at
from planners.search.query import Limits
from planners.search.registry import plan
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.families import family
from planners.world.problem import Arrival, Problem, obstacles_of
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, DIFFERENTIAL_DRIVE, Vehicle

UNICYCLE = DIFFERENTIAL_DRIVE._replace(first_order=True, max_acceleration=50.0, max_turn_acceleration=40.0)
AT_REST = Arrival(0.0, 0.05, 0.0, 0.0)


def box(x_min: float, y_min: float, x_max: float, y_max: float) -> list[np.ndarray]:
    return [np.array([[x_min, y_min], [x_max, y_min], [x_max, y_max], [x_min, y_max]])]


def slot_at_a_kerb(vehicle: Vehicle, share: float) -> Problem:
    """Out of a slot that is ``share`` of the vehicle's length long, to a place in the street behind it."""
    length, width = vehicle.front + vehicle.rear, vehicle.width
    half, deep = 0.5 * share * length, 1.25 * width
    cars = [
        box(-half - length, -deep, -half, -0.1 * width),
        box(half, -deep, half + length, -0.1 * width),
        box(-9.0 * length, -deep - 1.0, 9.0 * length, -deep),
    ]
    behind = 0.5 * (vehicle.front - vehicle.rear)
    start, goal = (-behind, -0.55 * deep, 0.0), (-3.0 * length, 1.2 * width)
    bounds = (-9.0 * length, -deep - 1.0, 9.0 * length, 5.0 * width)
    return Problem("out", "slots", start, goal, 0.1, bounds, obstacles_of(cars), arrival=AT_REST)


@pytest.mark.parametrize("vehicle", [CAR, DIFFERENTIAL_DRIVE, UNICYCLE], ids=["car", "drive", "unicycle"])
@pytest.mark.parametrize("share", [1.3, 1.5])
def test_a_slot_is_left(vehicle: Vehicle, share: float) -> None:
    asked = to_canonical(slot_at_a_kerb(vehicle, share))[0]
    found = plan("lattice", asked, generator(0), vehicle=vehicle).plan
    assert found is not None
    assert faults(asked, found, vehicle) == []


@pytest.mark.parametrize("name", ["parallel", "perpendicular", "angled"])
def test_slots_are_left_to_where_they_are_entered_from(name: str) -> None:
    for number in range(4):
        into = family(name, "hard").draw(3, number)
        assert into.arrival is not None
        assert into.arrival.heading is not None
        out = Problem(
            *("out", name, (*into.goal, into.arrival.heading), (into.start[0], into.start[1]), 0.1),
            *(into.bounds, into.obstacles),
            arrival=AT_REST._replace(heading=into.start[2]),
        )
        asked = to_canonical(out)[0]
        found = plan("lattice", asked, generator(0)).plan
        assert found is not None
        assert faults(asked, found) == []


@pytest.mark.parametrize("vehicle", [DIFFERENTIAL_DRIVE, UNICYCLE], ids=["drive", "unicycle"])
def test_who_can_turn_on_the_spot_does_so_where_no_turn_of_full_speed_has_room(vehicle: Vehicle) -> None:
    side = 1.3 * math.hypot(vehicle.front + vehicle.rear, vehicle.width)  # it turns in there, and no more
    assert side < radius_at(vehicle.max_speed, vehicle)
    bounds = (-0.5 * side, -0.5 * side, 0.5 * side, 0.5 * side)
    asked = Problem(
        *("turn", "rooms", (0.0, 0.0, 0.0), (0.05, 0.05), 0.1, bounds, obstacles_of([])),
        arrival=AT_REST._replace(heading=math.pi / 2),
    )
    canonical = to_canonical(asked)[0]
    found = plan("lattice", canonical, generator(0), vehicle=vehicle, limits=Limits(expansions=6000)).plan
    assert found is not None
    assert faults(canonical, found, vehicle) == []
