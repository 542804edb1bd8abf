"""The vehicles in CasADi are those of the kernels."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from planners.optimisation.equations import discs_of, limits_of, step_of
from planners.world.arrays import Floats
from planners.world.vehicles.bodies import body_count, swept_boxes
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import Vehicle
from tests.planners.world.motions import KINDS
from tests.planners.world.strategies import box_corners

names = st.sampled_from(list(KINDS))
seeds = st.integers(0, 2**32 - 1)
STEPS = {name: step_of(vehicle) for name, vehicle in KINDS.items()}
DISCS = {name: discs_of(vehicle, 3) for name, vehicle in KINDS.items()}


def state_within(rng: np.random.Generator, vehicle: Vehicle) -> Floats:
    """A state ``[S]`` within the limits, so far that a step of controls does not pass them."""
    limits = limits_of(vehicle)
    state = np.concatenate((rng.uniform(-5.0, 55.0, 2), rng.uniform(-math.pi, math.pi, 1)))
    change = 0.0 if vehicle.first_order else vehicle.dt  # those of first order reach any speed in a step
    reserve = change * np.append(limits.control_high, np.zeros(len(limits.state_low) - 5))
    return np.append(state, rng.uniform(limits.state_low[3:] + reserve, limits.state_high[3:] - reserve))


@given(names, seeds)
def test_a_symbolic_step_is_the_kernels_step(name: str, seed: int) -> None:
    rng, vehicle = np.random.default_rng(seed), KINDS[name]
    state, limits = state_within(rng, vehicle), limits_of(vehicle)
    controls = rng.uniform(limits.control_low, limits.control_high)
    low, high = ((limit[3:5] - state[3:5]) / vehicle.dt for limit in (limits.state_low, limits.state_high))
    controls = np.clip(controls, low, high)
    expected = simulate(state, controls[None], vehicle)[1]
    found = np.array(STEPS[name](state, controls, vehicle.dt)).ravel()
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9)


@given(names, seeds)
def test_discs_cover_the_boxes_that_the_kernels_check(name: str, seed: int) -> None:
    vehicle = KINDS[name]
    state = state_within(np.random.default_rng(seed), vehicle)
    centres, radii = (np.array(part) for part in DISCS[name](state))
    discs = shapely.union_all(shapely.buffer(shapely.points(centres.T), radii.ravel(), quad_segs=64))
    for x, y, cos, sin, half_length, half_width in swept_boxes(state[None], vehicle):
        box = shapely.Polygon(box_corners(x, y, math.atan2(sin, cos), half_length, half_width))
        assert box.difference(discs).area < 1e-3  # m^2: the discs are polygons of 256 corners here


@pytest.mark.parametrize("name", KINDS)
def test_there_are_as_many_discs_as_asked_for_on_each_body(name: str) -> None:
    centres, radii = discs_of(KINDS[name], 2)(np.zeros(len(limits_of(KINDS[name]).state_low)))
    assert centres.shape == (2, 2 * body_count(KINDS[name]))
    assert radii.shape == (1, centres.shape[1])
