"""What a plan says of itself."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.world.problem import Plan


@given(
    speed=st.floats(-5.0, 5.0),
    radius=st.floats(1.0, 50.0),
    side=st.sampled_from([1.0, -1.0]),
    heading=st.floats(-4.0, 4.0),
    steps=st.integers(1, 50),
)
def test_in_a_circle_the_lateral_acceleration_is_that_of_physics(
    speed: float, radius: float, side: float, heading: float, steps: int
) -> None:
    dt = 0.01
    headings = heading + side * speed / radius * dt * np.arange(steps + 1)
    x, y = side * radius * np.sin(headings), -side * radius * np.cos(headings)
    wrapped = np.arctan2(np.sin(headings), np.cos(headings))
    states = np.stack([x, y, wrapped, np.full(steps + 1, speed), np.zeros(steps + 1)], axis=1)
    found = Plan(states, np.zeros((steps, 2)), dt).lateral_acceleration
    assert found == pytest.approx(speed**2 / radius, rel=1e-3, abs=1e-9)


def test_who_turns_on_the_spot_or_stands_is_not_pressed_aside() -> None:
    states = np.zeros((5, 5))
    states[:, 2] = np.linspace(0.0, math.pi, 5)
    assert Plan(states, np.zeros((4, 2)), 0.1).lateral_acceleration == 0.0
    assert Plan(states[:1], np.zeros((0, 2)), 0.1).lateral_acceleration == 0.0
