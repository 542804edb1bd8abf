"""Moving all states at once: the direction is Newton's, and drives become as quick as they can be."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.optimisation.arrival_error import USUAL
from planners.optimisation.gaps import Barrier, circles_around
from planners.optimisation.interior.buffers import allocate_interior, begin_inside
from planners.optimisation.interior.costs import MOTION_OFF, Hold, try_change
from planners.optimisation.interior.drivable import driven as driven_after
from planners.optimisation.interior.drivable import in_asked_motion
from planners.optimisation.interior.newton import direction
from planners.optimisation.interior.retiming import retimed
from planners.optimisation.local_model import allocate_model
from planners.optimisation.polish import polish
from planners.world.arrays import Floats
from planners.world.authority.authority import faults
from planners.world.geometry.collision import scene_of
from planners.world.goal import goal_of, reaches
from planners.world.problem import Arrival, Plan, Problem, start_state
from planners.world.vehicles.dynamics import control_limits, simulate, turn_limit
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, DIFFERENTIAL_DRIVE, Vehicle, trailers_of
from planners.world.workspace import Workspace
from tests.planners.world.motions import KINDS
from tests.worlds import box, problem_of

WORKSPACE = Workspace()
STRENGTH = 3e-3
TRAIN = KINDS["car-first-order-2-trailers"]._replace(trailers=CAR_1_TRAILER.trailers)
FIRST_ORDER: dict[str, Vehicle] = {
    "car": KINDS["car-first-order"],
    "unicycle": KINDS["unicycle-first-order"],
    "train": TRAIN,
}
MORE: dict[str, Vehicle] = FIRST_ORDER | {"differential-drive": DIFFERENTIAL_DRIVE}
HOLD = Hold(Barrier(0.01, 0.3, 0.0, math.inf, 0.003), USUAL, 1.0)


def driven(controls: Floats, *obstacles: np.ndarray, vehicle: Vehicle = CAR) -> tuple[Problem, Plan]:
    """A drive from the middle of the map, and the problem to arrive where it ends, at rest."""
    empty = replace(problem_of(list(obstacles)), start=(25.0, 25.0, 0.0))
    states = simulate(start_state(empty, vehicle), controls, vehicle)
    arrival = Arrival(float(states[-1, 2]), 0.05, 0.0, 0.0)
    problem = replace(empty, goal=(states[-1, 0], states[-1, 1]), goal_radius=0.1, arrival=arrival)
    return problem, Plan(states, controls)


def manoeuvre(turns: int) -> Floats:
    """Forwards, stop, wheels turned at rest, backwards, stop, and forwards again."""
    steer = [(0.0, 1.4)] * turns
    ahead, back = [(1.5, 0.0)] * 8 + [(-1.5, 0.0)] * 8, [(-1.0, 0.0)] * 6 + [(1.0, 0.0)] * 6
    away = [(0.0, -1.4)] * (2 * turns)
    return np.array([*steer, *ahead, *away, *back, *steer, *ahead])


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
    states, guess = retimed(plan.states, CAR)
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
    found = driven_after(model, 8, goal_of(problem, vehicle), vehicle, scene_of(problem))
    assert found is not None
    assert faults(problem, found, vehicle) == []


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
    ended = simulate(start, in_asked_motion(controls, last, goal, vehicle), vehicle)
    assert reaches(tuple(ended[-1]), goal)
