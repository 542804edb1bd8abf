"""The derivatives of a step are those of the simulation, by central differences, for every vehicle."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.optimisation.local_model import allocate_model, differentiate_steps
from planners.world.vehicles.dynamics import control_limits, simulate, turn_limit
from planners.world.vehicles.vehicle import state_size
from tests.planners.world.motions import KINDS

STEP = 1e-5


@pytest.mark.parametrize("name", KINDS)
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_the_derivatives_of_a_step_are_those_of_the_simulation(name: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    vehicle, size = KINDS[name], state_size(KINDS[name])
    state = rng.uniform(-1.0, 1.0, size)
    state[:3] *= 10.0
    state[3] = rng.uniform(0.5 * vehicle.min_speed, 0.5 * vehicle.max_speed)
    state[4] *= 0.5 * turn_limit(vehicle)
    controls = rng.uniform(-0.1, 0.1, 2) * control_limits(vehicle)  # so small that no limit clamps
    model = allocate_model(1, size)
    model.states[0], model.controls[0] = state, controls
    differentiate_steps(model, 1, vehicle)

    def after(values: np.ndarray) -> np.ndarray:
        return simulate(values[:size], values[size:][np.newaxis], vehicle)[-1]

    values, slopes = np.concatenate([state, controls]), []
    for more in STEP * np.eye(size + 2):
        slopes.append((after(values + more) - after(values - more)) / (2.0 * STEP))
    np.testing.assert_allclose(
        np.hstack([model.by_state[0], model.by_control[0]]), np.transpose(slopes), atol=1e-8
    )
