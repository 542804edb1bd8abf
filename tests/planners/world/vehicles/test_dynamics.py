from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings

from planners.world.arrays import Box, Floats
from planners.world.vehicles import dynamics
from planners.world.vehicles.bodies import footprints
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import Vehicle, state_size, trailers_of
from tests.planners.world.kernels import admissible, is_folded, step, swept_bodies
from tests.planners.world.motions import (
    KINDS,
    SECOND_ORDER,
    exact_motion,
    gentle_controls,
    often_at,
    random_controls,
    random_state,
    turning_limits,
)
from tests.planners.world.strategies import seeds

PULLING = {name: vehicle for name, vehicle in KINDS.items() if trailers_of(vehicle)}
each_vehicle = pytest.mark.parametrize("vehicle", KINDS.values(), ids=KINDS)


@each_vehicle
@settings(max_examples=40, deadline=None)
@given(seed=seeds)
def test_a_step_follows_the_differential_equations(vehicle: Vehicle, seed: int) -> None:
    rng = np.random.default_rng(seed)
    state = random_state(rng, vehicle)
    controls = random_controls(rng, state, vehicle)
    exact = exact_motion(state, controls, np.array([vehicle.dt]), vehicle)[0]
    assert (
        np.abs(np.array(step(tuple(state), *controls, vehicle)) - exact).max() < 1e-4
    )  # m, rad: RK4's error


@each_vehicle
def test_many_steps_stay_with_the_differential_equations(vehicle: Vehicle) -> None:
    state = np.zeros(state_size(vehicle))
    controls = gentle_controls(np.random.default_rng(1), 200, vehicle)
    states = simulate(state, controls, vehicle)
    for i, control in enumerate(controls):
        state = exact_motion(state, control, np.array([vehicle.dt]), vehicle)[0]
        assert np.abs(states[i + 1] - state).max() < 1e-5
    assert math.hypot(*state[:2]) > 20.0


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
        errors.append(np.abs(simulate(state, np.tile(controls, (steps, 1)), finer)[-1] - exact).max())
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([4.0, 4.0], abs=0.35)


@each_vehicle
@settings(max_examples=60, deadline=None)
@given(seed=seeds)
def test_boxes_cover_the_bodies_in_the_halves_of_a_step_or_in_all_of_it(vehicle: Vehicle, seed: int) -> None:
    rng = np.random.default_rng(seed)
    state = random_state(rng, vehicle)
    controls = random_controls(rng, state, vehicle)
    end = step(tuple(state), *controls, vehicle)
    motion = exact_motion(state, controls, np.linspace(0.0, vehicle.dt, 21), vehicle)
    corners = footprints(motion, vehicle)  # [21, B, 4, 2]
    covered = ((tuple(state), corners[:11]), (end, corners[10:]))
    if vehicle.first_order:
        covered = ((end, corners),)  # whose speed and steering are those of the whole step
    for at, half in covered:
        for number, box in enumerate(swept_bodies(at, vehicle)):
            ahead, left = _in_frame_of(box, half[:, number])
            assert np.abs(ahead).max() <= box[4] + 1e-9
            assert np.abs(left).max() <= box[5] + 1e-9


@each_vehicle
@settings(max_examples=40, deadline=None)
@given(seed=seeds)
def test_swept_bodies_lie_around_the_footprints(vehicle: Vehicle, seed: int) -> None:
    state = random_state(np.random.default_rng(seed), vehicle)
    middle, exact = state, 1e-9
    if vehicle.first_order:  # that of the step into the state, to the error of a Runge-Kutta step
        exact = 1e-5
        middle = exact_motion(state, np.zeros(2), np.array([-0.5 * vehicle.dt]), vehicle)[0]
    for box, corners in zip(
        swept_bodies(tuple(state), vehicle), footprints(middle[np.newaxis], vehicle)[0], strict=True
    ):
        assert box[:2] == pytest.approx(corners.mean(axis=0), abs=exact)
        along = (corners[1] - corners[0]) / np.linalg.norm(corners[1] - corners[0])
        assert box[2:4] == pytest.approx(along, abs=exact)
        ahead, left = _in_frame_of(box, corners)
        assert np.abs(ahead).max() <= box[4] + exact  # who stands needs no margin
        assert np.abs(left).max() <= box[5] + exact


def _in_frame_of(box: Box, points: Floats) -> tuple[Floats, Floats]:
    """How far ``points [..., 2]`` lie ahead of a box's centre and to its left, in metres."""
    off = points - box[:2]
    along = np.array(box[2:4])
    return off @ along, off @ np.array([-along[1], along[0]])


@each_vehicle
@settings(max_examples=40, deadline=None)
@given(seed=seeds)
def test_admissible_controls_lead_past_no_limit_and_are_otherwise_as_asked(
    vehicle: Vehicle, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    state = random_state(rng, vehicle)
    most, change = turning_limits(vehicle)
    asked = often_at(rng, -vehicle.max_acceleration, vehicle.max_acceleration), often_at(rng, -change, change)
    first, second = admissible(tuple(state), *asked, vehicle)
    speed, turning = state[3:5] + vehicle.dt * np.array([first, second])
    assert vehicle.min_speed - 1e-12 <= speed <= vehicle.max_speed + 1e-12
    assert abs(turning) <= most + 1e-12
    if vehicle.min_speed <= state[3] + vehicle.dt * asked[0] <= vehicle.max_speed:
        assert first == pytest.approx(asked[0], abs=1e-12)
    if abs(state[4] + vehicle.dt * asked[1]) <= most:
        assert second == pytest.approx(asked[1], abs=1e-12)


@each_vehicle
def test_simulating_is_stepping_again_and_again(vehicle: Vehicle) -> None:
    rng = np.random.default_rng(7)
    start = random_state(rng, vehicle)
    controls = np.array([random_controls(rng, start, vehicle) for _ in range(10)])
    states = simulate(start, controls, vehicle)
    assert states[0] == pytest.approx(start, abs=0.0)
    for before, control, after in zip(states[:-1], controls, states[1:], strict=True):
        assert tuple(after) == step(tuple(before), *control, vehicle)


@each_vehicle
@settings(max_examples=30, deadline=None)
@given(seed=seeds)
def test_kernels_equal_their_python_functions(vehicle: Vehicle, seed: int) -> None:
    rng = np.random.default_rng(seed)
    state = random_state(rng, vehicle)
    controls = random_controls(rng, state, vehicle)
    now = tuple(state)
    assert step(now, *controls, vehicle) == pytest.approx(dynamics.step(now, *controls, vehicle), abs=1e-13)
    for ours, theirs in zip(swept_bodies(now, vehicle), dynamics.swept_bodies(now, vehicle), strict=True):
        assert ours == pytest.approx(theirs, abs=1e-13)


@pytest.mark.parametrize("vehicle", PULLING.values(), ids=PULLING)
def test_no_hitch_passes_its_limit_between_two_states_that_are_not_folded(vehicle: Vehicle) -> None:
    rng = np.random.default_rng(0)
    most = np.array([trailer.max_hitch for trailer in trailers_of(vehicle)])
    passed = 0
    for _ in range(8_000):
        state = random_state(rng, vehicle)
        state[5:] = rng.choice([-1.0, 1.0], len(most)) * (most - rng.exponential(0.01, len(most)))
        controls = random_controls(rng, state, vehicle)
        finer = vehicle._replace(dt=0.1 * vehicle.dt, first_order=False)
        after = step(tuple(state), *controls, vehicle)
        if (np.abs(after[5:]) > most).any() or state[3] == 0.0 or after[3] == 0.0:
            continue
        begun = state
        if vehicle.first_order:
            begun = state.copy()
            begun[3:5] += vehicle.dt * controls
            controls = np.zeros(2)
        middle = simulate(begun, np.tile(controls, (9, 1)), finer)
        beyond = (np.abs(middle[:, 5:]) > most + 1e-6).any()
        if beyond:
            passed += 1
            assert is_folded(tuple(state), vehicle) or is_folded(tuple(after), vehicle)
    assert passed > 3
