"""Speeds over an arc lead exactly as far as they should, within all limits."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from planners.search.manoeuvres.pace import fill_pace


@given(
    metres=st.floats(0.01, 30.0),
    limits=st.lists(st.floats(0.1, 4.0), min_size=2, max_size=40),
    acceleration=st.floats(0.5, 4.0),
    dt=st.sampled_from([0.02, 0.1, 0.2]),
    gear=st.sampled_from([1.0, -1.0]),
)
def test_speeds_lead_exactly_as_far(
    metres: float, limits: list[float], acceleration: float, dt: float, gear: float
) -> None:
    speeds = np.zeros(20_000)
    steps = fill_pace(speeds, np.array(limits), len(limits) - 1, metres, gear, acceleration, dt)
    if steps < 0:  # one step at full acceleration leads too far
        assert metres < 4.0 * acceleration * dt * dt or min(limits) < acceleration * dt
        return
    driven = gear * speeds[: steps + 1]
    assert driven[0] == driven[-1] == 0.0
    assert np.isclose(dt * 0.5 * (driven[1:] + driven[:-1]).sum(), metres, rtol=1e-9, atol=1e-12)
    assert (driven >= 0.0).all()
    assert np.abs(np.diff(driven)).max() <= acceleration * dt * (1.0 + 1e-9)
    assert driven.max() <= max(limits) + 1e-9
