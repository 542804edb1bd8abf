"""Routes within a limit of time: the usual one or none, soon after it, with the reason that counts."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from planners.attempt import Attempt
from planners.maps.global_path import GlobalPaths
from planners.maps.occupancy_map import OccupancyMap
from planners.routes import leg_search, router
from planners.routes.path_ahead import Stop
from planners.routes.router import Router
from planners.routes.stuck import Stuck
from planners.search.outcome import Status
from planners.search.query import Limits
from planners.world.problem import POSE_RADIUS, POSE_TOLERANCE, Arrival, Problem
from planners.world.vehicles.vehicle import CAR
from tests.planners.maps.samples import town
from tests.planners.routes.test_route import GOALS, START, check, searched


class _Ticks:
    """A clock by which each look takes a second, and nothing else does."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        self.now += 1.0
        return self.now


def test_whenever_the_time_is_up_there_is_the_usual_route_or_none(monkeypatch: pytest.MonkeyPatch) -> None:
    over = Router(town(), searched, polishes=False)
    usual = check(over.route(START, GOALS)).plan(CAR)
    nearest, late = math.inf, 0
    for ticks in (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 1000.0):
        clock = _Ticks()
        for each in (leg_search, router):
            monkeypatch.setattr(each, "working_clock", clock)
        found = over.route(START, GOALS, time_limit=ticks)
        if isinstance(found, Stuck):
            assert found.is_late
            assert found.to_go is not None
            late += 1
            assert clock.now <= ticks + 20.0  # it does not go on for long
            if "goal 1" in found.why:
                assert found.to_go <= nearest
                nearest = found.to_go
        else:
            assert np.array_equal(check(found).plan(CAR).states, usual.states)
    assert 3 < late < 8


OPEN = OccupancyMap("open", np.zeros((60, 60), bool), 1.0)
POSE = Stop((40.0, 30.0), POSE_RADIUS, Arrival(0.5, POSE_TOLERANCE, 0.0, 0.0))


def _in_vain(monkeypatch: pytest.MonkeyPatch, status: Status) -> Router:
    """A router whose local problems have no plan, each of which takes 100 s."""
    clock = _Ticks()
    for each in (leg_search, router):
        monkeypatch.setattr(each, "working_clock", clock)

    def solve_in_vain(problem: Problem, limits: Limits) -> Attempt:
        clock.now += 100.0
        return replace(searched(problem, replace(limits, expansions=1)), plan=None, status=status)

    return Router(OPEN, solve_in_vain)


def test_an_enclosed_goal_is_told_though_the_time_is_up(monkeypatch: pytest.MonkeyPatch) -> None:
    found = _in_vain(monkeypatch, Status.GOAL_ENCLOSED).route((10.0, 30.0, 0.0), [POSE], time_limit=350.0)
    assert isinstance(found, Stuck)
    assert (found.is_enclosed, found.is_late) == (True, False)


@pytest.mark.parametrize("time_limit", [None, 150.0])
def test_no_other_way_is_looked_for_once_the_time_is_up(
    monkeypatch: pytest.MonkeyPatch, time_limit: float | None
) -> None:
    over = _in_vain(monkeypatch, Status.BUDGET_SPENT)
    looked: list[int] = []

    def looking(way: Callable[[], GlobalPaths]) -> GlobalPaths:
        looked.append(1)
        return way()

    monkeypatch.setattr(over, "_wider", [partial(looking, way) for way in over._wider])
    found = over.route((10.0, 30.0, 0.0), [POSE], time_limit=time_limit)
    assert isinstance(found, Stuck)
    assert found.is_late == (time_limit is not None)
    assert bool(looked) == (time_limit is None)
