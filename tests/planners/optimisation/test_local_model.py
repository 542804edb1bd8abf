"""The gradient of nearness is that of its cost, by central differences."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.optimisation.gaps import Barrier, circles_around
from planners.optimisation.local_model import (
    NearnessModel,
    allocate_model,
    differentiate_nearness,
    nearness_cost,
)
from planners.world.geometry.collision import scene_of
from planners.world.vehicles.dynamics import turn_limit
from planners.world.vehicles.vehicle import state_size
from tests.planners.world.motions import KINDS
from tests.worlds import box, problem_of

SCENE = scene_of(
    replace(
        problem_of([box(8.0, 5.0, 0.4, 0.6, 0.3), box(4.0, 8.5, 0.7, 0.4, 1.0)]),
        bounds=(0.0, 0.0, 60.0, 60.0),
    )
)
BARRIER = Barrier(0.01, 6.0, 0.0, 1.2, 0.003)  # of a range that always sees something
STEP = 1e-5


@pytest.mark.parametrize("lateral", [math.inf, 0.5])
@pytest.mark.parametrize(
    "name", ["car", "car-first-order", "differential-drive", "car-2-trailers", "car-3-trailers"]
)
@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_the_gradient_of_nearness_is_that_of_its_cost(name: str, lateral: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    vehicle, size = KINDS[name]._replace(max_lateral_acceleration=lateral), state_size(KINDS[name])
    model, circles = allocate_model(1, size), circles_around(SCENE)
    state = rng.uniform(0.2, 0.9, size) * rng.choice([-1.0, 1.0], size)
    state[:3] = *rng.uniform(2.0, 9.0, 2), rng.uniform(-3.0, 3.0)
    state[4] *= turn_limit(vehicle)
    model.states[1] = state
    scratch = model.vectors[0], model.nudged, model.box_slopes
    near = NearnessModel(model.states, model.gradient, model.curvature, *scratch)
    at_once = differentiate_nearness(near, 1, vehicle, SCENE, circles, BARRIER)
    assert at_once == nearness_cost(model.states, 1, vehicle, SCENE, circles, BARRIER)

    def cost(number: int, more: float) -> float:
        moved = state.copy()
        moved[number] += more
        return nearness_cost(moved[np.newaxis], 0, vehicle, SCENE, circles, BARRIER)

    slopes = [(cost(c, STEP) - cost(c, -STEP)) / (2.0 * STEP) for c in range(size)]
    assert np.any(np.abs(slopes) > 0.0)
    np.testing.assert_allclose(model.gradient[1], slopes, rtol=1e-2, atol=1e-3 * np.abs(slopes).max())
