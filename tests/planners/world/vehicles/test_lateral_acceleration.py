"""A limit of lateral acceleration: no control leads past it, and braking is preferred to turning less."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.world.arrays import Floats
from planners.world.vehicles.dynamics import curvature_of, tightest_bend, top_speed, turning_speed
from planners.world.vehicles.vehicle import DifferentialDrive, Vehicle
from tests.planners.world.kernels import admissible, lateral_acceleration, slides
from tests.planners.world.motions import KINDS, exact_motion, often_at, random_state, turning_limits
from tests.planners.world.strategies import seeds

each_vehicle = pytest.mark.parametrize("vehicle", KINDS.values(), ids=KINDS)
limits = st.floats(0.05, 20.0)


def held_state(rng: np.random.Generator, vehicle: Vehicle) -> Floats:
    """A state that does not slide, often at the limit."""
    state = random_state(rng, vehicle)
    lateral = abs(lateral_acceleration(tuple(state), vehicle)[0])
    if lateral > vehicle.max_lateral_acceleration:
        share = vehicle.max_lateral_acceleration / lateral
        state[3] *= (1.0 - 1e-9) * (share if isinstance(vehicle, DifferentialDrive) else math.sqrt(share))
    return state


@each_vehicle
@settings(max_examples=40, deadline=None)
@given(seed=seeds)
def test_it_is_the_speed_times_the_turn_rate_of_the_exact_motion(vehicle: Vehicle, seed: int) -> None:
    state = random_state(np.random.default_rng(seed), vehicle)
    found, by_speed, by_turn = lateral_acceleration(tuple(state), vehicle)
    h = 1e-4
    held = exact_motion(state, np.zeros(2), np.array([h]), vehicle)[0]
    assert found == pytest.approx(state[3] * (held[2] - state[2]) / h, abs=1e-5)
    for number, slope in ((3, by_speed), (4, by_turn)):
        more, less = (state + sign * h * (np.arange(len(state)) == number) for sign in (1.0, -1.0))
        change = lateral_acceleration(tuple(more), vehicle)[0] - lateral_acceleration(tuple(less), vehicle)[0]
        assert slope == pytest.approx(change / (2.0 * h), abs=1e-4)


@each_vehicle
@settings(max_examples=80, deadline=None)
@given(seed=seeds, most=limits)
def test_admissible_controls_never_lead_into_a_slide(vehicle: Vehicle, seed: int, most: float) -> None:
    vehicle = vehicle._replace(max_lateral_acceleration=most)
    rng = np.random.default_rng(seed)
    state = held_state(rng, vehicle)
    change = turning_limits(vehicle)[1]
    asked = (
        often_at(rng, -vehicle.max_acceleration, vehicle.max_acceleration),
        often_at(rng, -change, change),
    )
    first, second = admissible(tuple(state), *asked, vehicle)
    assert abs(first) <= vehicle.max_acceleration + 1e-6
    assert abs(second) <= change + 1e-6
    after = state.copy()
    after[3:5] += vehicle.dt * np.array([first, second])
    assert abs(after[4]) <= turning_limits(vehicle)[0] + 1e-9
    assert vehicle.min_speed - 1e-9 <= after[3] <= vehicle.max_speed + 1e-9
    assert not slides(tuple(after), vehicle)
    free = admissible(tuple(state), *asked, vehicle._replace(max_lateral_acceleration=math.inf))
    unlimited = state.copy()
    unlimited[3:5] += vehicle.dt * np.array(free)
    if not slides(tuple(unlimited), vehicle):
        assert (first, second) == pytest.approx(free, rel=1e-5, abs=1e-4)
    elif abs(second - free[1]) > 1e-3:  # it turns less than asked only after it has braked as hard as it can
        slowed = abs(state[3]) - vehicle.dt * vehicle.max_acceleration
        assert abs(after[3]) <= max(slowed, 0.0) + 1e-9


@each_vehicle
@given(most=limits, share=st.floats(0.01, 1.0))
def test_bends_and_speeds_belong_together(vehicle: Vehicle, most: float, share: float) -> None:
    vehicle = vehicle._replace(max_lateral_acceleration=most)
    speed = share * vehicle.max_speed
    bend = tightest_bend(speed, vehicle)
    assert speed**2 * curvature_of(bend, vehicle) <= most * (1.0 + 1e-9)
    assert top_speed(1.0, bend, vehicle) >= speed * (1.0 - 1e-9)
    assert tightest_bend(0.5 * speed, vehicle) >= bend
    assert (
        turning_speed(vehicle._replace(min_speed=speed)) >= speed
    )  # who cannot stop goes on so fast at least
    full = turning_speed(vehicle)
    assert full <= vehicle.max_speed
    assert full**2 * curvature_of(tightest_bend(full, vehicle), vehicle) <= most * (1.0 + 1e-9)
