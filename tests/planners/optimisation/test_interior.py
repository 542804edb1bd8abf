"""Moving all states at once: drives become as quick as they can be, and stay within all limits."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.optimisation.interior.drivable import end_in_asked_motion, is_drivable
from planners.optimisation.interior.retiming import retimed
from planners.optimisation.local_model import allocate_model
from planners.optimisation.polish import polish
from planners.world.authority.authority import faults
from planners.world.geometry.collision import scene_of
from planners.world.goal import goal_of, reaches
from planners.world.problem import Plan, start_state
from planners.world.vehicles.dynamics import control_limits, simulate
from planners.world.vehicles.vehicle import CAR, DIFFERENTIAL_DRIVE, Vehicle
from planners.world.workspace import Workspace
from tests.planners.optimisation.drives import FIRST_ORDER, MORE, driven, manoeuvre

WORKSPACE = Workspace()


@settings(max_examples=8, deadline=None)
@given(
    metres=st.floats(1.0, 12.0),
    waits=st.integers(0, 30),
    slowly=st.floats(0.3, 1.0),
    most=st.floats(0.1, 2.0),
)
def test_straight_ahead_it_takes_the_least_time_that_there_is(
    metres: float, waits: int, slowly: float, most: float
) -> None:
    vehicle = CAR._replace(max_acceleration=most)  # a bus brakes for ten seconds
    count = max(math.ceil(math.sqrt(metres / (slowly * most)) / CAR.dt), 2)
    first = metres / (count * CAR.dt) ** 2
    controls = np.array([*[(first, 0.0)] * count, *[(0.0, 0.0)] * waits, *[(-first, 0.0)] * count])
    controls = np.concatenate([controls[:count], controls[count + waits :], np.zeros((waits, 2))])
    problem, plan = driven(controls, vehicle=vehicle)
    top = CAR.max_speed
    way = math.dist(problem.start[:2], problem.goal) - problem.goal_radius
    least = 2.0 * math.sqrt(way / most) if way * most < top**2 else way / top + top / most
    better = polish(problem, plan, vehicle, scene_of(problem), WORKSPACE).plan
    assert better is not None
    assert faults(problem, better, vehicle) == []
    assert better.duration_s <= least + 2.5 * CAR.dt


@settings(max_examples=6, deadline=None)
@given(
    name=st.sampled_from(list(FIRST_ORDER)),
    metres=st.floats(1.0, 12.0),
    slowly=st.floats(0.1, 1.0),
    waits=st.integers(0, 10),
)
def test_of_first_order_it_takes_only_the_steps_at_full_speed_and_one_to_stand(
    name: str, metres: float, slowly: float, waits: int
) -> None:
    vehicle = FIRST_ORDER[name]
    step_m = slowly * vehicle.max_speed * vehicle.dt
    speeds = np.array([*[slowly * vehicle.max_speed] * math.ceil(metres / step_m), *[0.0] * (1 + waits)])
    rates = np.diff(speeds, prepend=0.0) / vehicle.dt
    problem, plan = driven(np.column_stack([rates, np.zeros_like(rates)]), vehicle=vehicle)
    better = polish(problem, plan, vehicle, scene_of(problem), WORKSPACE).plan
    assert better is not None
    assert faults(problem, better, vehicle) == []
    way = math.dist(problem.start[:2], problem.goal) - problem.goal_radius
    assert len(better.controls) <= math.ceil(way / (vehicle.max_speed * vehicle.dt)) + 2


@settings(max_examples=6, deadline=None)
@given(name=st.sampled_from(list(MORE)), turns=st.integers(1, 4))
def test_whoever_drives_it_a_manoeuvre_becomes_quicker_and_stays_right(name: str, turns: int) -> None:
    vehicle = MORE[name]
    problem, plan = driven(manoeuvre(turns), vehicle=vehicle)
    better = polish(problem, plan, vehicle, scene_of(problem), WORKSPACE).plan
    assert better is not None
    assert faults(problem, better, vehicle) == []
    assert better.duration_s < 0.9 * plan.duration_s


@pytest.mark.parametrize("most", [0.1, 0.15, 0.3, 1.0])
def test_who_brakes_slowly_stands_at_the_goal_as_soon_as_it_can(most: float) -> None:
    vehicle = CAR._replace(max_acceleration=most)
    steer, steps = [(0.0, 1.4)] * 4, round(10.0 / math.sqrt(most))
    there, back = [(most, 0.0)] * steps, [(-most, 0.0)] * steps
    problem, plan = driven(
        np.array([*steer, *there, *back, *[(0.0, -1.4)] * 8, *back, *there]), vehicle=vehicle
    )
    better = polish(problem, plan, vehicle, scene_of(problem), WORKSPACE)
    assert better.plan is not None
    assert faults(problem, better.plan, vehicle) == []
    assert better.plan.duration_s < 0.9 * plan.duration_s
    assert better.iterations < 100  # hundreds if it does not stand, and is pressed instead


@pytest.mark.parametrize("turns", [2, 4, 5])
def test_a_mirrored_drive_becomes_as_quick(turns: int) -> None:
    found = []
    for side in (1.0, -1.0):
        problem, plan = driven(manoeuvre(turns) * np.array([1.0, side]))
        better = polish(problem, plan, CAR, scene_of(problem), WORKSPACE).plan
        assert better is not None
        assert faults(problem, better) == []
        assert better.duration_s < 0.8 * plan.duration_s
        found.append(better.duration_s)
    assert found[0] == pytest.approx(found[1], abs=1.1 * CAR.dt)


@settings(max_examples=20, deadline=None)
@given(turns=st.integers(1, 5), waits=st.integers(0, 20), backwards=st.booleans())
def test_a_retimed_drive_goes_the_same_way_within_all_limits(turns: int, waits: int, backwards: bool) -> None:
    controls = np.concatenate([manoeuvre(turns), np.zeros((waits, 2)), manoeuvre(turns)])
    _, plan = driven(controls * np.array([0.5 if backwards else 1.0, 1.0]))
    found = retimed(plan.states, CAR)
    states, guess = found.states, found.controls
    assert len(guess) <= len(plan.controls)
    np.testing.assert_array_equal(states[0], plan.states[0])
    np.testing.assert_allclose(states[-1, :3], plan.states[-1, :3], atol=1e-5)
    assert (np.abs(guess) <= (CAR.max_acceleration, CAR.max_steering_rate)).all()
    assert (states[:, 3] <= CAR.max_speed).all()
    assert (states[:, 3] >= CAR.min_speed).all()
    apart = np.hypot(*(states[:, None, :2] - plan.states[None, :, :2]).transpose(2, 0, 1)).min(axis=1)
    assert apart.max() <= CAR.dt * CAR.max_speed


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 10**6), off=st.floats(0.0, 0.3), vehicle=st.sampled_from([CAR, *MORE.values()]))
def test_feedback_keeps_a_drive_within_all_limits(seed: int, off: float, vehicle: Vehicle) -> None:
    rng = np.random.default_rng(seed)
    controls = rng.uniform(-1.0, 1.0, (8, 2)) * np.array(control_limits(vehicle))
    problem, plan = driven(np.zeros((8, 2)), vehicle=vehicle)
    problem = replace(problem, goal_radius=20.0, arrival=None)
    model = allocate_model(8, plan.states.shape[1])
    model.states[:] = simulate(start_state(problem, vehicle), controls, vehicle)
    model.states[1:] += rng.normal(0.0, off, model.states[1:].shape)
    model.controls[:] = controls
    model.feedback[:] = rng.normal(0.0, 20.0, model.feedback.shape)
    assert is_drivable(model, 8, goal_of(problem, vehicle), vehicle, scene_of(problem))
    assert faults(problem, Plan(model.tried_states, model.tried_controls, vehicle.dt), vehicle) == []


@settings(max_examples=50, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    left=st.tuples(st.floats(-0.01, 0.01), st.floats(-0.01, 0.01)),
    vehicle=st.sampled_from([CAR, DIFFERENTIAL_DRIVE]),
)
def test_what_rounding_leaves_of_a_motion_does_not_count(
    seed: int, left: tuple[float, float], vehicle: Vehicle
) -> None:
    rng = np.random.default_rng(seed)
    controls = np.concatenate([manoeuvre(2), rng.normal(0.0, 1e-3, (3, 2))])
    problem, plan = driven(controls, vehicle=vehicle)
    controls[-1] += (left - plan.states[-1, 3:5]) / vehicle.dt
    start, goal = start_state(problem, vehicle), goal_of(problem, vehicle)
    last = simulate(start, controls, vehicle)[-1]
    end_in_asked_motion(controls, len(controls), last, goal, vehicle)
    assert reaches(tuple(simulate(start, controls, vehicle)[-1]), goal)
