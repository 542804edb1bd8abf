from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings

from planners.world.arrays import Floats
from planners.world.authority.authority_equations import Body, bodies_of, simulate_again
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import Vehicle, state_size
from tests.planners.world.motions import (
    KINDS,
    SECOND_ORDER,
    exact_motion,
    gentle_controls,
    placed,
    random_controls,
    random_state,
)
from tests.planners.world.strategies import seeds

each_vehicle = pytest.mark.parametrize("vehicle", KINDS.values(), ids=KINDS)


@each_vehicle
@settings(max_examples=40, deadline=None)
@given(seed=seeds)
def test_a_step_follows_the_differential_equations(vehicle: Vehicle, seed: int) -> None:
    rng = np.random.default_rng(seed)
    state = random_state(rng, vehicle)
    controls = random_controls(rng, state, vehicle)
    exact = exact_motion(state, controls, np.array([vehicle.dt]), vehicle)[0]
    again = simulate_again(state, controls[np.newaxis], vehicle)
    assert again.shape == (2, state_size(vehicle))
    assert np.abs(again[1] - exact).max() < 1e-4  # m, rad: what one RK4 step may err


@each_vehicle
@settings(max_examples=20, deadline=None)
@given(seed=seeds)
def test_simulating_again_is_what_the_planners_simulate(vehicle: Vehicle, seed: int) -> None:
    rng = np.random.default_rng(seed)
    controls = gentle_controls(rng, 300, vehicle)
    start = np.zeros(state_size(vehicle))
    start[:3] = rng.uniform(-3.0, 3.0, 3)
    assert np.abs(simulate_again(start, controls, vehicle) - simulate(start, controls, vehicle)).max() < 1e-9


@each_vehicle
def test_many_steps_stay_with_the_differential_equations(vehicle: Vehicle) -> None:
    start = np.zeros(state_size(vehicle))
    controls = gentle_controls(np.random.default_rng(1), 200, vehicle)
    again = simulate_again(start, controls, vehicle)
    state = start
    for i, control in enumerate(controls):
        state = exact_motion(state, control, np.array([vehicle.dt]), vehicle)[0]
        assert np.abs(again[i + 1] - state).max() < 1e-5
    assert math.dist(state[:2], start[:2]) > 20.0


@pytest.mark.parametrize("vehicle", SECOND_ORDER.values(), ids=SECOND_ORDER)
def test_the_error_falls_with_the_fourth_power_of_the_time_step(vehicle: Vehicle) -> None:
    state = np.zeros(state_size(vehicle))
    state[3:5] = 1.0, 0.2
    state[5:] = 0.3
    controls = np.array([0.7, 0.3])
    exact = exact_motion(state, controls, np.array([0.8]), vehicle)[0]
    errors = []
    for steps in (4, 8, 16):
        finer = vehicle._replace(dt=0.8 / steps)
        errors.append(np.abs(simulate_again(state, np.tile(controls, (steps, 1)), finer)[-1] - exact).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx([4.0, 4.0], abs=0.35)


@each_vehicle
@settings(max_examples=30, deadline=None)
@given(seed=seeds)
def test_between_two_states_no_body_point_leaves_the_arc_by_more_than_the_bend(
    vehicle: Vehicle, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    state = random_state(rng, vehicle)
    controls = random_controls(rng, state, vehicle)
    times = np.linspace(0.0, vehicle.dt, 21)
    motion = exact_motion(state, controls, times, vehicle)
    bounds = bodies_of(motion[[0, -1]], controls[np.newaxis], vehicle)
    truth = bodies_of(motion, np.tile(controls, (20, 1)), vehicle)
    for bound, body in zip(bounds, truth, strict=True):
        on_arc = _arc(body, times / vehicle.dt)
        assert np.linalg.norm(placed(body) - on_arc, axis=2).max() <= bound.bend[0] + 1e-12


def _arc(body: Body, shares: Floats) -> Floats:
    """Corners ``[len(shares), n, 2]`` on the arcs, at even pace, that lead the first pose to the last."""
    (begin, end), (first, last) = body.centres[[0, -1]], body.along[[0, -1]]
    turn = math.atan2(first[0] * last[1] - first[1] * last[0], first @ last)
    if abs(turn) < 1e-9:
        return placed(body)[0] + shares[:, None, None] * (end - begin)
    way = end - begin
    centre = 0.5 * (begin + end) + np.array([-way[1], way[0]]) / (2.0 * math.tan(0.5 * turn))
    cos, sin = np.cos(shares * turn), np.sin(shares * turn)
    rotations = np.stack([np.stack([cos, sin], axis=-1), np.stack([-sin, cos], axis=-1)], axis=1)
    return (placed(body)[0] - centre) @ rotations + centre
