"""Scales: the ends of an axis are its ends, equal ratios are equally far apart, and ticks lie on it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dashboards.web.svg import LogScale

ratios = st.floats(0.01, 1000.0)


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
