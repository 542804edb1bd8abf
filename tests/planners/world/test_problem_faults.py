from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.world.classes.problem_classes import problem_class
from planners.world.geometry.collision import count_free_prefix, point_is_free, scene_of
from planners.world.problem import CANONICAL_DISTANCE, Arrival, obstacles_of, start_state
from planners.world.problem_faults import problem_fault
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, Vehicle
from tests.planners.world.strategies import angles, seeds
from tests.worlds import box, problem_of


@pytest.mark.parametrize("vehicle", [CAR, CAR_1_TRAILER])
@given(seed=seeds, heading=angles, towards=angles, x=st.floats(-6.0, 56.0), y=st.floats(-6.0, 56.0))
def test_ends_are_free_where_the_scene_says_so(
    vehicle: Vehicle, seed: int, heading: float, towards: float, x: float, y: float
) -> None:
    goal = (x + CANONICAL_DISTANCE * np.cos(towards), y + CANONICAL_DISTANCE * np.sin(towards))
    problem = replace(problem_class("random").draw(seed, 0), start=(x, y, heading), goal=goal)
    scene = scene_of(problem)
    fault = problem_fault(problem, vehicle)
    if count_free_prefix(start_state(problem, vehicle)[np.newaxis], vehicle, scene) == 0:
        assert fault is not None
        assert fault.startswith("start footprint")
    elif not point_is_free(*goal, scene):
        assert fault is not None
        assert fault.startswith("goal centre")
    else:
        assert fault is None


@pytest.mark.parametrize("end", ["start", "goal"])
@given(heading=st.floats(1e4, 1e300, exclude_min=True), sign=st.sampled_from([-1.0, 1.0]))
def test_a_heading_of_countless_turns_is_told_as_such(end: str, heading: float, sign: float) -> None:
    problem = problem_class("random").draw(0, 0)
    if end == "start":
        problem = replace(problem, start=(*problem.start[:2], sign * heading))
    else:
        problem = replace(problem, arrival=Arrival(heading=sign * heading))
    assert problem_fault(problem) == (
        f"{end} heading is {sign * heading:g} rad; expected an angle of -pi to pi, turns may be added"
    )


@pytest.mark.parametrize(
    ("field", "value", "told"),
    [
        ("start", (10.0, 0.0, 0.0), "(1005, 2000, 0)"),
        ("goal", (100.0, 0.0), "(1050, 2000)"),
        ("start_motion", (9.0,), "4.5 m/s"),
        ("bounds", (20.0, 0.0, 10.0, 1.0), "[1010.0, 2000.0, 1005.0, 2000.5]"),
    ],
)
def test_lengths_are_told_in_real_metres(field: str, value: object, told: str) -> None:
    obstacles = obstacles_of([[box(10.0, 0.0, 0.0, 1.0, 1.0)]])
    problem = replace(problem_of([]), obstacles=obstacles, scale=0.5, offset=(1000.0, 2000.0))
    fault = problem_fault(replace(problem, **{field: value}))  # type: ignore[arg-type]
    assert fault is not None
    assert told in fault


def test_a_heading_without_a_tolerance_is_told_by_both_its_names() -> None:
    fault = problem_fault(replace(problem_of([]), arrival=Arrival(heading=0.0)))
    assert fault is not None
    assert "goal_tolerance" in fault
    assert "heading_tolerance" in fault


@given(speed=st.floats(0.1, 4.0), steering=st.floats(-0.69, 0.69), most=st.floats(0.1, 5.0))
def test_a_start_that_slides_is_told(speed: float, steering: float, most: float) -> None:
    needed = speed**2 * abs(np.tan(steering)) / CAR.wheelbase
    vehicle = CAR._replace(max_lateral_acceleration=most)
    fault = problem_fault(replace(problem_of([]), start_motion=(speed, steering)), vehicle)
    if abs(needed / most - 1.0) > 1e-5:  # nearer, and it is a matter of rounding
        assert (fault is not None) == (needed > most)
    if fault is not None:
        assert f"{needed:g} m/s^2 sideways; the vehicle's lateral_acceleration is {most:g}" in fault


def test_a_start_at_the_limit_is_allowed_however_it_is_rounded() -> None:
    vehicle = CAR._replace(max_lateral_acceleration=2.0)
    for speed in np.linspace(2.0, 4.0, 50).tolist():
        motion = (speed, float(np.arctan(2.0 * CAR.wheelbase / speed**2)))
        assert problem_fault(replace(problem_of([]), start_motion=motion), vehicle) is None
