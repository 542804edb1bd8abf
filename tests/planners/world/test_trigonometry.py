from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.world import trigonometry
from planners.world.jit import jit

angles = st.floats(-3000.0, 3000.0)
coordinates = st.floats(-100.0, 100.0).map(lambda x: 0.0 if abs(x) < 1e-100 else x)


@jit
def sincos(angle):
    return trigonometry.sincos(angle)


@jit
def turned_by(sin, cos, angle):
    return trigonometry.turned_by(sin, cos, angle)


@jit
def tan(angle):
    return trigonometry.tan(angle)


@jit
def angle_to(x, y):
    return trigonometry.angle_to(x, y)


@jit
def wrapped(angle):
    return trigonometry.wrapped(angle)


@given(angles)
def test_sine_and_cosine_are_the_c_librarys_to_the_last_bits(angle):
    assert sincos(angle) == pytest.approx((math.sin(angle), math.cos(angle)), abs=3e-16, rel=0.0)


@given(st.floats(-20.0, 20.0), st.floats(-3.0, 3.0))
def test_a_turned_direction_is_that_of_the_sum(angle, further):
    expected = (math.sin(angle + further), math.cos(angle + further))
    assert turned_by(math.sin(angle), math.cos(angle), further) == pytest.approx(expected, abs=1e-14)


@given(st.floats(-1.5, 1.5))
def test_the_tangent_is_the_c_librarys(angle):
    assert tan(angle) == pytest.approx(math.tan(angle), rel=1e-14)


@given(coordinates, coordinates)
def test_the_direction_of_a_vector_is_right_to_2e_8(x, y):
    assert abs(math.remainder(angle_to(x, y) - math.atan2(y, x), math.tau)) < 2e-8


@given(angles)
def test_a_wrapped_angle_is_the_same_within_half_a_turn(angle):
    assert abs(wrapped(angle)) <= math.pi + 1e-9
    assert abs(math.remainder(wrapped(angle) - angle, math.tau)) < 1e-9
