"""What drives cost: what is told of one step and another adds up, and time alone counts unless said."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.search.manoeuvres.variants import time_reversed
from planners.world.driving_cost import cost_of, cusps_of, extra_along, extra_steps, gears_of
from planners.world.jit import jit
from planners.world.problem import Plan
from planners.world.vehicles.vehicle import CAR, Costs

UNEVEN = CAR._replace(first_order=True, costs=Costs(1.5, 1.25, 2.0))
drives = st.lists(st.sampled_from([-1.0, -0.3, 0.0, 1e-9, 0.5, 4.0]), min_size=1, max_size=30)


def drive_at(speeds: list[float]) -> Plan:
    """A drive whose steps end at these speeds."""
    states = np.zeros((len(speeds), 5))
    states[:, 3] = speeds
    return Plan(states, np.zeros((len(speeds) - 1, 2)))


@given(speeds=drives)
def test_a_drive_costs_what_its_seconds_and_changes_count_as(speeds: list[float]) -> None:
    plan = drive_at([0.0, *speeds])
    gears = [round(np.sign(speed)) * (abs(speed) > 1e-6) for speed in speeds]
    moving = [gear for gear in gears if gear]
    changes = sum(a != b for a, b in itertools.pairwise(moving))
    assert len(cusps_of(plan, UNEVEN)) == changes
    expected = 1.5 * changes + plan.dt * sum({1: 1.25, -1: 2.0, 0: 1.0}[gear] for gear in gears)
    assert cost_of(plan, UNEVEN) == pytest.approx(expected)
    assert cost_of(plan, UNEVEN._replace(costs=Costs())) == plan.duration_s
    assert plan.dt * extra_steps(plan, UNEVEN) == pytest.approx(expected - plan.duration_s, abs=plan.dt)


@jit
def _along(states, vehicle):  # type: ignore[no-untyped-def]
    return extra_along(states, 0.0, vehicle)


@given(speeds=st.lists(st.sampled_from([-1.0, 0.5]), min_size=1, max_size=30))
@settings(deadline=None)
def test_searches_count_as_plans_are_compared(speeds: list[float]) -> None:
    plan = drive_at([0.0, *speeds])
    assert _along(plan.states, UNEVEN) == pytest.approx(cost_of(plan, UNEVEN) - plan.duration_s)


@given(speeds=drives)
def test_a_drive_costs_as_much_with_time_reversed(speeds: list[float]) -> None:
    vehicle = UNEVEN._replace(first_order=False)
    back = drive_at([-speed for speed in speeds[::-1]])
    assert cost_of(back, time_reversed(vehicle)) == pytest.approx(cost_of(drive_at(speeds), vehicle))
    gears = gears_of(back, vehicle)
    assert set(gears.tolist()) <= {1, -1}
