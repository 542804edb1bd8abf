from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from planners.routes.manoeuvres import FACING, bearing, braking, is_free_drive, rolling, turn_towards
from planners.world.arrays import Floats
from planners.world.authority.authority_equations import limits_of
from planners.world.geometry.collision import Scene, scene_of
from planners.world.problem import start_state
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, DIFFERENTIAL_DRIVE, VEHICLES, Vehicle
from tests.worlds import box, problem_of


@cache
def open_scene() -> Scene:
    return scene_of(problem_of([]))


MIDDLE = (25.0, 25.0, 0.3)


def at_rest(x: float, y: float, heading: float, vehicle: Vehicle = CAR) -> Floats:
    state = start_state(problem_of([]), vehicle)
    state[:3] = x, y, heading
    return state


def rests(state: Floats) -> bool:
    return bool(np.abs(state[3:5]).max() < 1e-12)


def within_limits(states: Floats, controls: Floats, vehicle: Vehicle) -> bool:
    return all(
        low - 1e-9 <= values.min() and values.max() <= high + 1e-9
        for _, values, low, high, _ in limits_of(states, controls, vehicle)
        if len(values)
    )


@pytest.mark.parametrize("name", VEHICLES)
@given(speed=st.floats(-1.0, 4.0), aside=st.floats(-0.69, 0.69))
@example(speed=0.0, aside=1e-12)
def test_braking_ends_at_rest_all_straight(name: str, speed: float, aside: float) -> None:
    vehicle = VEHICLES[name]
    state = at_rest(*MIDDLE, vehicle)
    state[3:5] = speed, aside
    controls = braking(state, vehicle)
    states = simulate(state, controls, vehicle)
    assert rests(states[-1])
    assert within_limits(states, controls, vehicle)
    assert len(controls) <= 20  # 4 m/s at 2 m/s^2


@given(metres=st.floats(-5.0, 5.0))
def test_rolling_goes_straight_by_so_many_metres(metres: float) -> None:
    controls = rolling(metres, CAR)
    states = simulate(at_rest(0.0, 0.0, 0.0), controls, CAR)
    np.testing.assert_allclose(states[-1], [metres, 0.0, 0.0, 0.0, 0.0], atol=1e-9)
    assert within_limits(states, controls, CAR)


@pytest.mark.parametrize("vehicle", [CAR, DIFFERENTIAL_DRIVE])
@settings(max_examples=25)
@given(towards=st.floats(-math.pi, math.pi))
@example(towards=0.25)  # a turn so small that fewer steps would do
def test_where_there_is_room_a_vehicle_turns_to_anywhere(vehicle: Vehicle, towards: float) -> None:
    place = (25.0 + 70.0 * math.cos(towards), 25.0 + 70.0 * math.sin(towards))
    state = at_rest(*MIDDLE, vehicle)
    controls = turn_towards(state, place, vehicle, open_scene())
    assert controls is not None
    states = simulate(state, controls, vehicle)
    assert abs(bearing(states[-1], place)) <= FACING
    assert rests(states[-1])
    assert within_limits(states, controls, vehicle)
    assert np.hypot(*(states[-1, :2] - state[:2])) < 6.0


def test_in_a_lane_the_car_turns_round_in_several_arcs_without_touching_the_walls() -> None:
    lane = scene_of(problem_of([box(25, 29.0, 0.0, 30, 1.0), box(25, 21.0, 0.0, 30, 1.0)]))
    state = at_rest(25.0, 25.0, 0.0)
    controls = turn_towards(state, (-40.0, 25.0), CAR, lane)
    assert controls is not None
    states = simulate(state, controls, CAR)
    assert is_free_drive(states, CAR, lane)
    assert abs(bearing(states[-1], (-40.0, 25.0))) <= FACING
    assert states[:, 3].max() > 0.1
    assert states[:, 3].min() < -0.1


def test_where_there_is_no_room_no_turn_is_found() -> None:
    walls = [box(25, 26.0, 0.0, 30, 0.5), box(25, 24.0, 0.0, 30, 0.5)]
    scene = scene_of(problem_of(walls))
    assert turn_towards(at_rest(25.0, 25.0, 0.0), (-40.0, 25.0), CAR, scene) is None


def test_a_trailer_never_jack_knifes_in_a_turn() -> None:
    state = at_rest(*MIDDLE, CAR_1_TRAILER)
    controls = turn_towards(state, (25.0, 95.0), CAR_1_TRAILER, open_scene())
    if controls is not None:
        states = simulate(state, controls, CAR_1_TRAILER)
        assert np.abs(states[:, 5]).max() <= CAR_1_TRAILER.trailers[0].max_hitch + 1e-9
