from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.world.classes.problem_classes import problem_class
from planners.world.geometry.collision import count_free_prefix, point_is_free, scene_of
from planners.world.problem import CANONICAL_DISTANCE, Arrival, start_state
from planners.world.problem_faults import problem_fault
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, Vehicle
from tests.planners.world.strategies import angles, seeds


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
