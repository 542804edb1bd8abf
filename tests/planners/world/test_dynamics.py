from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.integrate import solve_ivp

from planners.world import dynamics
from planners.world.bodies import footprints
from planners.world.dynamics import simulate
from planners.world.problem import Floats
from planners.world.vehicle import CAR
from tests.planners.world.kernels import admissible, step, swept_bodies
from tests.planners.world.strategies import seeds


def random_motion(rng: np.random.Generator) -> tuple[Floats, Floats]:
    """A state ``[5]`` and controls ``[2]`` within the car's limits, often at them."""

    def within(low: float, high: float) -> float:
        return float(np.clip(rng.uniform(1.5 * low, 1.5 * high), low, high))

    state = np.array([
        *rng.uniform(-5.0, 55.0, 2),
        rng.uniform(-math.pi, math.pi),
        within(CAR.min_speed, CAR.max_speed),
        within(-CAR.max_steering, CAR.max_steering),
    ])  # fmt: skip
    controls = np.array([
        within(-CAR.max_acceleration, CAR.max_acceleration),
        within(-CAR.max_steering_rate, CAR.max_steering_rate),
    ])  # fmt: skip
    return state, controls


def exact_motion(state: Floats, controls: Floats, times: Floats) -> Floats:
    """States ``[len(times), 5]`` of the car's differential equations, by SciPy."""

    def slopes(_: float, s: Floats) -> list[float]:
        _, _, heading, speed, steering = s
        turn = speed * math.tan(steering) / CAR.wheelbase
        return [speed * math.cos(heading), speed * math.sin(heading), turn, controls[0], controls[1]]

    solved = solve_ivp(slopes, (0.0, CAR.dt), state, "DOP853", times, rtol=1e-12, atol=1e-12)
    states: Floats = solved.y.T
    return states


@settings(max_examples=200, deadline=None)
@given(seeds)
def test_a_step_follows_the_differential_equations(seed: int) -> None:
    state, controls = random_motion(np.random.default_rng(seed))
    exact = exact_motion(state, controls, np.array([CAR.dt]))[0]
    exact[3] = np.clip(exact[3], CAR.min_speed, CAR.max_speed)
    exact[4] = np.clip(exact[4], -CAR.max_steering, CAR.max_steering)
    assert (
        np.abs(np.array(step(tuple(state), *controls, CAR)) - exact).max() < 5e-5
    )  # m, rad: what one RK4 step may err


@settings(max_examples=300, deadline=None)
@given(seeds)
def test_the_margin_bounds_half_the_way_of_every_body_point(seed: int) -> None:
    state, controls = random_motion(np.random.default_rng(seed))
    controls = np.array(admissible(tuple(state), *controls, CAR))
    end = step(tuple(state), *controls, CAR)
    motion = exact_motion(state, controls, np.linspace(0.0, CAR.dt, 21))
    corners = footprints(motion)[:, 0]
    way = np.linalg.norm(np.diff(corners, axis=0), axis=2).sum(axis=0).max()
    margin = min(box[5] for at in (tuple(state), end) for box in swept_bodies(at, CAR)) - 0.5 * CAR.width
    assert way <= 2.0 * margin + 1e-9


@settings(max_examples=300, deadline=None)
@given(seeds)
def test_admissible_controls_lead_past_no_limit_and_are_otherwise_as_asked(seed: int) -> None:
    state, controls = random_motion(np.random.default_rng(seed))
    acceleration, steering_rate = admissible(tuple(state), *controls, CAR)
    assert CAR.min_speed - 1e-12 <= state[3] + CAR.dt * acceleration <= CAR.max_speed + 1e-12
    assert abs(state[4] + CAR.dt * steering_rate) <= CAR.max_steering + 1e-12
    free = CAR.min_speed <= state[3] + CAR.dt * controls[0] <= CAR.max_speed
    assert not free or acceleration == pytest.approx(controls[0], abs=1e-12)


@settings(max_examples=20, deadline=None)
@given(seeds)
def test_simulating_is_stepping_again_and_again(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start, _ = random_motion(rng)
    controls = np.array([random_motion(rng)[1] for _ in range(10)])
    states = simulate(start, controls, CAR)
    assert states[0] == pytest.approx(start, abs=0.0)
    for before, control, after in zip(states[:-1], controls, states[1:], strict=True):
        assert tuple(after) == step(tuple(before), *control, CAR)


@settings(max_examples=50, deadline=None)
@given(seeds)
def test_kernels_equal_their_python_functions(seed: int) -> None:
    state, controls = random_motion(np.random.default_rng(seed))
    now = tuple(state)
    interpreted = dynamics.step(now, *controls, CAR)
    assert step(now, *controls, CAR) == pytest.approx(interpreted, abs=1e-13)
    assert swept_bodies(now, CAR)[0] == pytest.approx(dynamics.swept_bodies(now, CAR)[0], abs=1e-13)
