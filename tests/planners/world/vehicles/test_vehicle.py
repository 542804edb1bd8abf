from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapely

from planners.world.authority.authority_equations import bodies_of
from planners.world.vehicles.vehicle import (
    CAR,
    CAR_1_TRAILER,
    VEHICLES,
    CarWithTrailers,
    Vehicle,
    control_names,
    name_of,
    state_names,
    state_size,
)
from tests.planners.world.motions import placed

TRAILERS = [vehicle for vehicle in VEHICLES.values() if isinstance(vehicle, CarWithTrailers)]


def test_built_in_vehicles_are_called_by_their_names() -> None:
    assert [name_of(vehicle) for vehicle in VEHICLES.values()] == list(VEHICLES)


def test_a_vehicle_with_settings_of_its_own_is_called_by_them() -> None:
    assert "max_speed=9.0" in name_of(CAR._replace(max_speed=9.0))


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
def test_states_begin_with_the_leading_bodys_pose_and_speed(vehicle: Vehicle) -> None:
    assert state_names(vehicle)[:4] == ("x", "y", "heading", "speed")
    assert state_size(vehicle) == len(state_names(vehicle))
    assert control_names(vehicle)[0] == "acceleration"


@pytest.mark.parametrize("vehicle", TRAILERS, ids=name_of)
def test_within_the_largest_hitch_angle_no_two_bodies_touch(vehicle: CarWithTrailers) -> None:
    angles = [np.linspace(-each.max_hitch, each.max_hitch, 41) for each in vehicle.trailers]
    for hitches in itertools.product(*angles):
        state = np.array([[0.0, 0.0, 0.3, 0.0, 0.0, *hitches]])
        polygons = [shapely.Polygon(placed(body)[0]) for body in bodies_of(state, np.empty((0, 2)), vehicle)]
        gaps = [one.distance(other) for one, other in itertools.combinations(polygons, 2)]
        assert min(gaps) > 0.05  # metres; between two states a hitch angle may swing out by a little more


def test_jack_knifed_the_trailer_does_meet_the_car() -> None:
    """So the largest hitch angle is needed."""
    state = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 2.6]])
    car, trailer = (
        shapely.Polygon(placed(body)[0]) for body in bodies_of(state, np.empty((0, 2)), CAR_1_TRAILER)
    )
    assert car.intersects(trailer)
