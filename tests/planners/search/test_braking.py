from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import event, example, given, settings
from hypothesis import strategies as st

from planners.search.braking import braking, is_free_closely, is_free_drive, stopping
from planners.world.arrays import Floats
from planners.world.authority.authority_equations import limits_of
from planners.world.authority.authority_sweeps import sweep_faults
from planners.world.geometry.collision import scene_of
from planners.world.problem import Plan, start_state
from planners.world.vehicles.dynamics import control_limits, simulate
from planners.world.vehicles.vehicle import CAR, VEHICLES, Vehicle
from tests.worlds import box, problem_of

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
@example(speed=0.0, aside=0.16 * (1.0 + 9e-10))  # one step at full rate, and a little more
def test_braking_ends_at_rest_all_straight(name: str, speed: float, aside: float) -> None:
    vehicle = VEHICLES[name]
    state = at_rest(*MIDDLE, vehicle)
    state[3:5] = speed, aside
    controls = braking(state, vehicle)
    states = simulate(state, controls, vehicle)
    assert rests(states[-1])
    assert within_limits(states, controls, vehicle)
    assert len(controls) <= 20  # 4 m/s at 2 m/s^2


@pytest.mark.parametrize("name", VEHICLES)
@given(speed=st.floats(0.1, 4.0), metres=st.floats(0.1, 12.0))
def test_who_moves_stops_before_a_wall_or_is_told_that_it_cannot(
    name: str, speed: float, metres: float
) -> None:
    vehicle = VEHICLES[name]
    ahead = 10.0 + vehicle.front + metres
    wall = box(ahead + 0.5, 25.0, 0.0, 0.5, 20.0)
    problem = replace(problem_of([wall]), start=(10.0, 25.0, 0.0), start_motion=(speed,))
    stop = stopping(problem, vehicle, scene_of(problem))
    needed = 0.5 * speed * speed / vehicle.max_acceleration
    if metres > needed + 0.5 * speed * vehicle.dt + 0.1:
        assert stop is not None
        assert np.array_equal(stop.states[0], start_state(problem, vehicle))
        assert rests(stop.states[-1])
    if metres < needed:
        assert stop is None


@pytest.mark.parametrize("name", VEHICLES)
def test_who_stands_has_nothing_to_stop(name: str) -> None:
    problem = problem_of([])
    assert stopping(problem, VEHICLES[name], scene_of(problem)) is None


@settings(max_examples=60)
@given(
    name=st.sampled_from(list(VEHICLES)),
    speed=st.floats(-1.0, 4.0),
    controls=st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), min_size=1, max_size=12),
    ahead=st.floats(-3.0, 4.0),
    gap=st.floats(-0.05, 0.15),
    angle=st.floats(-0.5, 0.5),
)
def test_what_is_free_closely_is_free_to_the_judge(
    name: str,
    speed: float,
    controls: list[tuple[float, float]],
    ahead: float,
    gap: float,
    angle: float,
) -> None:
    vehicle = VEHICLES[name]
    x, y, heading = MIDDLE
    aside = 0.5 * vehicle.width + 0.2 + gap
    post = box(
        x + ahead * np.cos(heading) - aside * np.sin(heading),
        y + ahead * np.sin(heading) + aside * np.cos(heading),
        heading + angle,
        0.2,
        0.2,
    )
    problem = replace(problem_of([post]), start=MIDDLE, start_motion=(speed,))
    scene, state = scene_of(problem), start_state(problem, vehicle)
    states, driven = [state], []
    for control in np.array(controls) * control_limits(vehicle):  # reduced where a limit is reached
        for share in (1.0, 0.0):
            after = simulate(states[-1], share * control[np.newaxis], vehicle)[-1]
            if within_limits(np.array([states[-1], after]), share * control[np.newaxis], vehicle):
                states.append(after)
                driven.append(share * control)
                break
    plan = Plan(np.array(states), np.array(driven).reshape(-1, 2), vehicle.dt)
    is_free = is_free_closely(plan, vehicle, scene)
    assert is_free or not is_free_drive(plan.states, vehicle, scene)
    assert not is_free or sweep_faults(problem, plan.states, plan.controls, vehicle) == []
    event(f"{is_free} {is_free_drive(plan.states, vehicle, scene)}")
