"""A robot beside the route that it drives is led along it at once, through all stops that are left."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
import pytest

from planners.attempt import KEPT, Attempt
from planners.routes.path_ahead import Stop
from planners.routes.route import Route
from planners.routes.router import Router
from planners.search.query import Limits
from planners.solve import solve
from planners.world.authority.authority import faults
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, DIFFERENTIAL_DRIVE, Vehicle, name_of
from tests.planners.maps.samples import town

START = (12.0, 150.0, 2.0)
STOPS = [Stop((90.0, 150.0)), Stop((150.0, 262.0)), Stop((150.0, 262.0))]  # the last one twice


def searched(problem: Problem, limits: Limits, vehicle: Vehicle) -> Attempt:
    return solve(problem, "lattice", limits=limits, vehicle=vehicle)


@cache
def driven(vehicle: Vehicle) -> tuple[Router, Plan, list[int]]:
    """A router, a route through the stops, and the steps at which it stops."""
    router = Router(town(), partial(searched, vehicle=vehicle), vehicle)
    route = router.route(START, STOPS)
    assert isinstance(route, Route)
    ends = np.cumsum([sum(len(leg.controls) for leg in section) for section in route.sections])
    return router, route.plan(vehicle), ends.tolist()


@pytest.mark.parametrize("vehicle", [CAR, DIFFERENTIAL_DRIVE, CAR_1_TRAILER], ids=name_of)
@pytest.mark.parametrize("off", [0.01, 0.05])
def test_a_robot_beside_its_route_goes_on_without_any_time_to_search(vehicle: Vehicle, off: float) -> None:
    router, plan, ends = driven(vehicle)
    rng = np.random.default_rng(1)
    asked, found, later = 0, 0, []
    for at in range(5, ends[-1] - 10, 25):
        state = plan.states[at].copy()
        state[:3] += off * rng.normal(size=3)
        start, motion = tuple(state[:3].tolist()), tuple(state[3:].tolist())
        left = STOPS[sum(end <= at for end in ends) :]
        asked += 1
        route = router.route(start, left, motion, time_limit=1e-9, current=plan)
        if isinstance(route, Route):
            found += 1
            assert route.source == KEPT
            assert faults(route.problem, route.plan(vehicle), vehicle) == []
            assert len(route.problems) == len(left)
            later.append(len(route.plan(vehicle).controls) - (ends[-1] - at))
    assert asked > 10
    assert found >= 0.9 * asked
    assert np.mean(later) <= 3
