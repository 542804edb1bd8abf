"""The ends of an axis are its ends, equal ratios are equally far apart, ticks lie on it, axes are alike."""

from __future__ import annotations

import re
from itertools import pairwise

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dashboards.web.charts import Dot, dots, stacks
from dashboards.web.svg import LogScale, Scale, WideScale

ratios = st.floats(0.01, 1000.0)
percents = st.floats(-1e6, 1e6)


@given(ratios, st.floats(1.5, 1000.0), ratios, ratios)
def test_equal_ratios_are_equally_far_apart(low: float, times: float, one: float, other: float) -> None:
    scale = LogScale(low, low * times, 10.0, 300.0)
    assert (scale.at(scale.low), scale.at(scale.high)) == (10.0, 300.0)
    places = [scale.at(each) for each in (one, 2.0 * one, other, 2.0 * other)]
    if all(10.0 < place < 300.0 for place in places):
        assert places[1] - places[0] == pytest.approx(places[3] - places[2], abs=1e-6)


@given(ratios, st.floats(1.5, 1000.0), st.integers(2, 8))
def test_ticks_are_round_and_on_the_axis(low: float, times: float, about: int) -> None:
    scale = LogScale(low, low * times, 10.0, 300.0)
    ticks = scale.ticks(about)
    assert all(0.99 * scale.low <= tick <= 1.01 * scale.high for tick in ticks)
    assert all(f"{tick:e}"[0] in "125" for tick in ticks)
    assert len(ticks) <= max(about, 8)


@given(percents, st.floats(1e-3, 1e6), st.integers(2, 8))
@example(-42.5, 85.0, 4)  # a steering angle, in degrees
def test_about_as_many_ticks_as_wanted_are_on_an_even_axis(low: float, length: float, about: int) -> None:
    ticks = Scale(low, low + length, 10.0, 300.0).ticks(about)
    assert 0.6 * about - 1.0 <= len(ticks) <= 1.5 * about + 1.0


@given(st.floats(-1e6, 0.0), st.floats(100.0, 1e6), percents, percents)
def test_a_wide_axis_keeps_the_order_of_per_cents(low: float, high: float, one: float, other: float) -> None:
    scale = WideScale(low, high, 10.0, 300.0)
    assert (scale.at(low), scale.at(high)) == pytest.approx((10.0, 300.0))
    if one < other:
        assert scale.at(one) <= scale.at(other)
    hundred = scale.at(100.0) - scale.at(0.0)
    assert scale.at(50.0) - scale.at(0.0) == pytest.approx(0.5 * hundred)  # even so far
    if high > 4e4:
        assert scale.at(4e4) - scale.at(2e4) == pytest.approx(
            scale.at(400.0) - scale.at(200.0)
        )  # equal ratios


@given(st.floats(-1e6, -1.0), st.floats(1.0, 1e6), st.integers(2, 8))
def test_ticks_of_a_wide_axis_stand_apart_around_0(low: float, high: float, about: int) -> None:
    scale = WideScale(low, high, 10.0, 300.0)
    ticks = scale.ticks(about)
    assert 0.0 in ticks
    assert all(low <= tick <= high for tick in ticks)
    places = [scale.at(tick) for tick in ticks]
    assert all(after - before >= 0.6 * 290.0 / about - 1e-9 for before, after in pairwise(places))


def test_the_axes_of_a_chart_are_equally_long_whatever_stands_beside_them() -> None:
    labels = ("none", "repair 5 exhaustive polished")
    of_dots = dots([(label, [Dot(label, (1.0, 0.0, 2.0), "red", "")]) for label in labels], "s", (0.0, 2.0))
    of_stacks = stacks({label: {label: [("search", 1.0)]} for label in labels}, {"search": "red"}, "s", "s")
    for drawings in (of_dots, of_stacks):
        axes = {
            re.findall(r'<line x1="([^"]*)" x2="([^"]*)"[^>]*class="axis"', each.body)[0] for each in drawings
        }
        assert len(drawings) == 2
        assert len(axes) == 1
