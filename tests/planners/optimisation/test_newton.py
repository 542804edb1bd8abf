"""The direction in which a drive is changed is Newton's: it solves his equations, and closes all gaps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.optimisation.arrival_error import USUAL
from planners.optimisation.gaps import Barrier, circles_around
from planners.optimisation.interior.buffers import allocate_interior, begin_inside
from planners.optimisation.interior.costs import MOTION_OFF, Hold, try_change
from planners.optimisation.interior.newton import direction
from planners.optimisation.local_model import allocate_model
from planners.world.arrays import Floats
from planners.world.geometry.collision import scene_of
from planners.world.goal import goal_of
from planners.world.problem import start_state
from planners.world.vehicles.dynamics import control_limits, turn_limit
from planners.world.vehicles.vehicle import CAR, DIFFERENTIAL_DRIVE, Vehicle, trailers_of
from tests.planners.optimisation.drives import FIRST_ORDER, driven
from tests.worlds import box

STRENGTH = 3e-3
HOLD = Hold(Barrier(0.01, 0.3, 0.0, math.inf, 0.003), USUAL, 1.0)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), time_counts=st.sampled_from([0.0, 1.0]))
def test_the_direction_solves_newtons_equations(seed: int, time_counts: float) -> None:
    rng = np.random.default_rng(seed)
    steps, size = 6, 5
    problem, plan = driven(rng.uniform(-1.0, 1.0, (steps, 2)), box(27.0, 26.2, 0.3, 0.5, 0.4))
    goal, scene = goal_of(problem, CAR), scene_of(problem)
    model, interior = allocate_model(steps, size), allocate_interior(steps, size)
    model.states[:] = plan.states + rng.normal(0.0, 0.05, plan.states.shape)
    model.controls[:] = plan.controls
    begin_inside(model, interior, steps, STRENGTH, CAR)
    longer = CAR._replace(dt=CAR.dt * (1.0 + 1e-6))
    damping, longer_s, _, slope, gaps, _ = direction(
        *(model, interior, steps, goal, STRENGTH, time_counts, 0.1, CAR, longer, scene),
        *(circles_around(scene), HOLD),
    )
    change = np.concatenate(
        [interior.change[1:].ravel(), interior.change_controls.ravel(), np.array([longer_s])]
    )
    # the gaps are closed to first order, whatever the cost
    for k in range(steps):
        led_to = model.by_state[k] @ interior.change[k] + model.by_control[k] @ interior.change_controls[k]
        led_to += interior.by_time[k] * longer_s + model.gaps[k]
        np.testing.assert_allclose(interior.change[k + 1], led_to, atol=1e-9)
    assert gaps == pytest.approx(np.abs(model.gaps).sum())
    if time_counts == 0.0:
        assert longer_s == 0.0
    # and no other change that closes them has a smaller cost: the cost's slope vanishes along all of them
    hessian, gradient = cost_model(model, interior, goal, damping, time_counts)
    keeps = closing(model, interior, time_counts)
    at_least = keeps.T @ (gradient + hessian @ change)
    np.testing.assert_allclose(at_least, 0.0, atol=1e-6 * max(1.0, np.abs(gradient).max()))
    assert slope == pytest.approx(gradient @ change, rel=1e-6, abs=1e-9)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), vehicle=st.sampled_from([CAR, DIFFERENTIAL_DRIVE, *FIRST_ORDER.values()]))
def test_controls_that_pass_a_limit_leave_gaps(seed: int, vehicle: Vehicle) -> None:
    """Speed and turn change by the controls, whatever the simulation clamps: a full change closes that."""
    rng = np.random.default_rng(seed)
    steps, size = 6, 5 + len(trailers_of(vehicle))
    problem, _ = driven(np.zeros((steps, 2)), vehicle=vehicle)
    goal, scene = goal_of(problem, vehicle), scene_of(problem)
    model, interior = allocate_model(steps, size), allocate_interior(steps, size)
    model.states[:] = start_state(problem, vehicle)
    most = np.array([vehicle.max_speed, turn_limit(vehicle)])
    model.states[:, 3:5] = rng.uniform(0.9, 1.0, (steps + 1, 2)) * most
    model.controls[:] = rng.uniform(0.5, 1.0, (steps, 2)) * np.array(control_limits(vehicle))
    begin_inside(model, interior, steps, STRENGTH, vehicle)
    around = scene, circles_around(scene), HOLD
    longer = vehicle._replace(dt=vehicle.dt * (1.0 + 1e-6))
    *_, gaps, _ = direction(*(model, interior, steps, goal, STRENGTH, 0.0, 0.1, vehicle, longer), *around)
    led_to = model.states[:-1, 3:5] + vehicle.dt * model.controls
    np.testing.assert_allclose(model.gaps[:, 3:5], led_to - model.states[1:, 3:5], atol=1e-12)
    _, same = try_change(model, interior, steps, 0.0, goal, STRENGTH, 0.0, vehicle, *around)
    assert same == pytest.approx(gaps)


def cost_model(model, interior, goal, damping, time_counts) -> tuple[Floats, Floats]:
    """Hessian and gradient of the cost by all states after the first, all controls, and a step's length."""
    steps, size = len(model.controls), model.states.shape[1]
    number = steps * (size + 2) + 1
    hessian, gradient = np.zeros((number, number)), np.zeros(number)
    limits = np.array([CAR.max_acceleration, CAR.max_steering_rate])
    bends = np.array([100.0, 100.0, 400.0, 2.0 * MOTION_OFF / CAR.max_speed**2, 0.0])
    for k in range(steps):
        at = slice(k * size, (k + 1) * size)
        gradient[at] += model.gradient[k + 1]
        hessian[at, at] += model.curvature[k + 1] + damping * np.eye(size)
        for c, (low, high) in (
            (3, (CAR.min_speed, CAR.max_speed)),
            (4, (-CAR.max_steering, CAR.max_steering)),
        ):
            value = model.states[k + 1, c]
            gradient[k * size + c] += STRENGTH * (1.0 / (high - value) - 1.0 / (value - low))
            pushes = interior.multipliers[k, 2 * (c - 1) : 2 * c]
            hessian[k * size + c, k * size + c] += pushes[0] / (value - low) + pushes[1] / (high - value)
        for c in range(2):
            i = steps * size + 2 * k + c
            value, limit = model.controls[k, c], limits[c]
            effort = 0.01 * (0.1 if c == 0 else 1.0) / limit**2
            gradient[i] = effort * value + STRENGTH * (1.0 / (limit - value) - 1.0 / (limit + value))
            pushes = interior.multipliers[k, 2 * c : 2 * c + 2]
            hessian[i, i] = effort + pushes[0] / (limit + value) + pushes[1] / (limit - value)
            hessian[i, i] += damping / limit**2
    last = slice((steps - 1) * size, steps * size)
    gradient[last] += bends * (model.states[-1] - interior.aim)
    hessian[last, last] += np.diag(bends)
    gradient[-1] = time_counts * steps * CAR.max_speed
    return hessian, gradient


def closing(model, interior, time_counts) -> Floats:
    """A basis of the changes that keep all gaps as they are to first order."""
    steps, size = len(model.controls), model.states.shape[1]
    free = 2 * steps + (1 if time_counts else 0)
    basis = np.zeros((steps * (size + 2) + 1, free))
    for column in range(free):
        controls = np.zeros(2 * steps)
        longer_s = 1.0 if column == 2 * steps else 0.0
        if column < 2 * steps:
            controls[column] = 1.0
        state = np.zeros(size)
        for k in range(steps):
            state = model.by_state[k] @ state + model.by_control[k] @ controls[2 * k : 2 * k + 2]
            state = state + interior.by_time[k] * longer_s
            basis[k * size : (k + 1) * size, column] = state
        basis[steps * size : -1, column] = controls
        basis[-1, column] = longer_s
    return basis
