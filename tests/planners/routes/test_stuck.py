"""Where no route is found, it is said how far it came, and which door may be too narrow."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from planners.attempt import Attempt
from planners.maps.occupancy_map import OccupancyMap
from planners.routes.path_ahead import Stop
from planners.routes.route import Router
from planners.routes.stuck import Stuck
from planners.search.query import Limits
from planners.solve import solve
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import CAR
from tests.planners.maps.test_widest_way import CELL_M, GOAL, START, walls


def fails(problem: Problem, limits: Limits) -> Attempt:
    return replace(solve(problem, "lattice", limits=limits), plan=None, solved=False)


def stuck_in(world: OccupancyMap) -> Stuck:
    found = Router(world, fails).route((*START, 0.0), [Stop(GOAL)])
    assert isinstance(found, Stuck)
    return found


@pytest.mark.parametrize(("wider", "told"), [(1, True), (20, False)])
def test_a_door_is_named_if_the_vehicle_hardly_fits_through(wider: int, told: bool) -> None:
    cells = round(CAR.width / CELL_M) + wider
    stuck = stuck_in(walls([(70, 70 + cells)]))
    assert (stuck.gap is not None) == told
    if stuck.gap is not None:
        assert abs(stuck.gap.width - CELL_M * cells) <= 0.5 * CELL_M + 1e-9
    assert stuck.to_go is not None
    assert 13.0 < stuck.to_go < 20.0


def test_it_is_told_in_metres_of_the_map() -> None:
    world = walls([(70, 71 + round(CAR.width / CELL_M))])
    stuck = stuck_in(world)
    real = replace(world, resolution=4.0 * CELL_M, origin=(100.0, 0.0, 0.0))

    def numbers(text: str) -> list[float]:
        return [float(each) for each in re.findall(r"[\d.]*\d", text)]

    x, y, to_go, width, gap_x, gap_y, widest = numbers(stuck.told(real, 4.0))
    assert (x, y) == pytest.approx((100.0 + 4.0 * stuck.place[0], 4.0 * stuck.place[1]), abs=0.06)
    assert stuck.to_go is not None
    assert to_go == pytest.approx(4.0 * stuck.to_go, abs=0.6)
    assert stuck.gap is not None
    assert (width, widest) == pytest.approx((4.0 * stuck.gap.width, 4.0 * CAR.width), abs=0.006)
    assert gap_x == pytest.approx(100.0 + 4.0 * stuck.gap.place[0], abs=0.06)
    assert gap_y == pytest.approx(4.0 * stuck.gap.place[1], abs=0.06)
