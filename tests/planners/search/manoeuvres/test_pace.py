"""Speeds over an arc lead exactly as far as they should, within all limits."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from planners.search.manoeuvres.pace import fill_pace


@given(
    metres=st.floats(0.001, 30.0),
    limits=st.lists(st.floats(0.02, 4.0), min_size=2, max_size=40),
    acceleration=st.floats(0.5, 4.0),
    dt=st.sampled_from([0.02, 0.1, 0.2]),
    gear=st.sampled_from([1.0, -1.0]),
)
def test_speeds_lead_exactly_as_far(
    metres: float, limits: list[float], acceleration: float, dt: float, gear: float
) -> None:
    speeds = np.zeros(20_000)
    steps = fill_pace(speeds, np.array(limits), len(limits) - 1, metres, gear, acceleration, dt)
    assert steps > 0
    driven = gear * speeds[: steps + 1]
    assert driven[0] == driven[-1] == 0.0
    assert np.isclose(dt * 0.5 * (driven[1:] + driven[:-1]).sum(), metres, rtol=1e-9, atol=1e-12)
    assert (driven >= 0.0).all()
    assert np.abs(np.diff(driven)).max() <= acceleration * dt * (1.0 + 1e-9)
    assert driven.max() <= max(limits) + 1e-9


def test_a_narrow_end_is_crept_to_without_creeping_all_the_way() -> None:
    speeds = np.zeros(1000)
    limits = np.array([*np.full(20, 1.0), *np.full(6, 0.05)])
    steps = fill_pace(speeds, limits, 25, 1.0, 1.0, 2.0, 0.1)
    way = np.cumsum(0.1 * 0.5 * (speeds[1 : steps + 1] + speeds[:steps]))
    assert speeds[1 : steps + 1][way > 0.84].max() < 0.06
    assert steps < 70
