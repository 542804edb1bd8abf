from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from planners.routes.braking import braking
from planners.world.arrays import Floats
from planners.world.authority.authority_equations import limits_of
from planners.world.problem import start_state
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR, VEHICLES, Vehicle
from tests.worlds import problem_of

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
