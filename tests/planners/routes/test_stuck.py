"""Where no route is found, it is said how far it came, and which door may be too narrow."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from planners.attempt import Attempt
from planners.maps.global_path import passable
from planners.maps.occupancy_map import OccupancyMap
from planners.maps.surroundings import surroundings_of
from planners.routes.doors import DOOR_POSES
from planners.routes.leg_search import LegSearch
from planners.routes.legs import Leg
from planners.routes.path_ahead import PathAhead, Stop
from planners.routes.route import Route
from planners.routes.router import Router
from planners.routes.stuck import Stuck
from planners.search.outcome import Status
from planners.search.query import Limits
from planners.solve import solve
from planners.world.arrays import Floats
from planners.world.authority.authority import faults
from planners.world.geometry.collision import scene_of
from planners.world.problem import Arrival, Problem, obstacles_of, start_state
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, Vehicle
from tests.planners.maps.test_widest_way import CELL_M, GOAL, START, walls


def solves(problem: Problem, limits: Limits) -> Attempt:
    return solve(problem, "lattice", limits=limits)


def fails(problem: Problem, limits: Limits) -> Attempt:
    return replace(solves(problem, limits), plan=None, solved=False)


def stuck_in(world: OccupancyMap) -> Stuck:
    found = Router(world, fails).route((*START, 0.0), [Stop(GOAL)])
    assert isinstance(found, Stuck)
    return found


@pytest.mark.parametrize(("more", "told", "narrow"), [(-1, True, True), (1, True, False), (20, False, False)])
def test_a_door_is_named_if_the_vehicle_hardly_fits_through(more: int, told: bool, narrow: bool) -> None:
    cells = round(CAR.width / CELL_M) + more
    stuck = stuck_in(walls([(70, 70 + cells)]))
    assert (stuck.gap is not None) == told
    may_be_wider = cells % 2 == 1  # by a cell, as far as is known
    assert stuck.is_too_narrow == (narrow and not may_be_wider)
    if stuck.gap is not None:
        assert CELL_M * cells - 1e-9 <= stuck.gap.width <= CELL_M * (cells + 1) + 1e-9
        assert 8.0 <= stuck.gap.place[0] <= 8.3
    assert (stuck.to_go is None) == narrow  # no way leads there
    assert stuck.to_go is None or 13.0 < stuck.to_go < 20.0


def test_a_narrower_door_that_is_nearer_leads_nobody_astray() -> None:
    """Ways led through a door of 0.8 m in cells of 0.2 m, and a route through one of 1 m was not found."""
    occupied = np.zeros((80, 100), bool)
    occupied[:, 50] = True
    occupied[20:24, 50] = occupied[60:66, 50] = False
    found = Router(OccupancyMap("two", occupied, 0.2), solves).route((3.0, 4.0, 0.0), [Stop((17.0, 4.0))])
    assert isinstance(found, Route)
    assert faults(found.problem, found.plan(CAR)) == []


@pytest.mark.parametrize("vehicle", [CAR, CAR_1_TRAILER])
@pytest.mark.parametrize("resolution", [0.2, 0.25, 0.5, 1.0])
def test_a_door_hardly_wider_than_the_vehicle_is_driven_through(resolution: float, vehicle: Vehicle) -> None:
    """A search for places behind the door seldom finds the way."""
    occupied = np.zeros((round(20.0 / resolution), round(30.0 / resolution)), bool)
    column = round(15.0 / resolution)
    occupied[:, column] = True
    occupied[round(15.0 / resolution) : round(16.0 / resolution), column] = False
    world = OccupancyMap("door", occupied, resolution)

    def solver(problem: Problem, limits: Limits) -> Attempt:
        return solve(problem, "lattice", limits=limits, vehicle=vehicle)

    found = Router(world, solver, vehicle).route((6.0, 4.0, 0.0), [Stop((26.0, 5.0))])
    assert isinstance(found, Route)
    assert faults(found.problem, found.plan(vehicle), vehicle) == []


def asked_for_poses(problem: Problem, limits: Limits) -> Attempt:
    """Solves what asks for a pose, as if every place were out of reach."""
    is_pose = problem.arrival is not None and problem.arrival.heading is not None
    return (solves if is_pose else fails)(problem, limits)


def doors_at(*columns: int, size: tuple[int, int]) -> OccupancyMap:
    """A map ``size`` (rows, columns) of 0.2 m with walls, each of which has a door 1.1 m wide."""
    occupied = np.zeros(size, bool)
    occupied[:, columns] = True
    occupied[size[0] // 2 : size[0] // 2 + 5, columns] = False
    return OccupancyMap("doors", occupied, 0.2)


def test_who_stands_in_a_door_is_led_through_the_next_one() -> None:
    """The door in which the vehicle stands is as narrow, and nearer."""
    world = doors_at(50, 100, 150, size=(60, 200))
    goal = Stop((37.0, 6.5), 0.1, Arrival(0.0, 0.05, 0.0, 0.0))
    asked: list[Problem] = []

    def solver(problem: Problem, limits: Limits) -> Attempt:
        asked.append(problem)
        return asked_for_poses(problem, limits)

    found = Router(world, solver).route((4.0, 6.5, 0.0), [goal])
    assert isinstance(found, Route)
    assert faults(found.problem, found.plan(CAR)) == []
    assert len(asked) <= 40


def test_a_goal_that_is_enclosed_behind_a_door_ends_the_search() -> None:
    def solver(problem: Problem, limits: Limits) -> Attempt:
        attempt = asked_for_poses(problem, limits)
        asks_for_goal = problem.arrival is not None and problem.arrival.heading_tolerance < 0.01
        if asks_for_goal:
            return replace(attempt, plan=None, solved=False, status=Status.GOAL_ENCLOSED)
        return attempt

    world = doors_at(300, size=(60, 400))
    goal = Stop((75.0, 6.5), 0.1, Arrival(0.0, 0.005, 0.0, 0.0))
    stuck = Router(world, solver).route((8.0, 6.5, 0.0), [goal])
    assert isinstance(stuck, Stuck)
    assert stuck.is_enclosed
    assert stuck.attempts <= 60


def test_where_no_way_leads_nothing_is_searched() -> None:
    world = doors_at(50, size=(60, 100))
    world.occupied[:, 50] = True
    problem = Problem("p", "p", (3.0, 3.0, 0.0), (15.0, 6.0), 2.0, (0.0, 0.0, 20.0, 12.0), obstacles_of([]))
    around, scene, state = surroundings_of(world, 1.0, 0.0), scene_of(problem), start_state(problem)
    search = LegSearch(around, scene, solves, CAR, "walled")
    ahead = PathAhead(passable(world, CAR.width, 1.0), Stop(problem.goal), scene, state)
    stuck = search.legs_to(ahead, state)
    assert isinstance(stuck, Stuck)
    assert stuck.to_go is None
    assert search.attempts == 0


def test_it_is_told_in_metres_of_the_map() -> None:
    stuck = stuck_in(walls([(70, 71 + round(CAR.width / CELL_M))]))
    real = OccupancyMap("real", np.zeros((1, 1), bool), 1.0, (100.0, 0.0, 0.0))
    told = stuck.told(real, 4.0)
    assert stuck.to_go is not None
    assert stuck.gap is not None
    for x, y in (stuck.place, stuck.gap.place):
        assert f"({100.0 + 4.0 * x:.2f}, {4.0 * y:.2f})" in told
    for metres in (f"{4.0 * stuck.to_go:.0f}", f"{4.0 * stuck.gap.width:.2f}", f"{4.0 * CAR.width:.2f}"):
        assert f" {metres} m" in told


def test_a_slot_that_nobody_gets_out_of_is_asked_for_once() -> None:
    """A slot at the kerb of a street, 0.1 m longer than the car."""
    occupied = np.zeros((150, 400), bool)
    occupied[:22] = occupied[-10:] = True
    occupied[10:22, 200:221] = False
    goal = Stop((20.25, 1.62), 0.1, Arrival(0.0, 0.05, 0.0, 0.0))
    kerb = Router(OccupancyMap("kerb", occupied, 0.1), solves)
    stuck = kerb.route((8.0, 8.0, 0.0), [goal])
    assert isinstance(stuck, Stuck)
    assert (stuck.is_enclosed, stuck.attempts, stuck.place) == (True, 1, goal.place)


def test_who_gets_into_doors_and_no_farther_soon_gives_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """In mazes of coarse cells it was tried for up to half a minute, in the same doors again and again."""
    world = doors_at(*range(20, 180, 12), size=(60, 200))
    tried = []
    legs_to = LegSearch.legs_to

    def only_into_doors(
        search: LegSearch, ahead: PathAhead, state: Floats, attempts: int = 30
    ) -> list[Leg] | Stuck:
        legs = legs_to(search, ahead, state, attempts)
        tried.append((ahead.briefly, ahead.stop.place))
        return legs if ahead.briefly else Stuck(ahead.stop.place, "no", 1, 1.0)

    monkeypatch.setattr(LegSearch, "legs_to", only_into_doors)
    assert isinstance(Router(world, solves).route((2.0, 6.0, 0.0), [Stop((38.0, 6.0))]), Stuck)
    into = [place for briefly, place in tried if briefly]
    assert 0 < len(into) <= DOOR_POSES


def test_who_stands_a_little_in_a_wall_is_told_where_it_would_be_free() -> None:
    """And is refused there no more, as a start or as a goal."""
    world = walls([(40, 120)])
    router, told = Router(world, solves), 0
    for x, y, heading in np.random.default_rng(4).uniform((0.0, 0.0, -3.0), (20.0, 16.0, 3.0), (200, 3)):
        start = router.refusal((x, y, heading), [])
        if start is None:
            continue
        assert start.attempts == 0
        if start.free is None:
            continue
        told += 1
        assert math.dist((x, y), start.free) <= 0.52 * CAR.width
        assert router.refusal((*start.free, heading), []) is None
        line = start.told(world, 1.0)
        told_x, told_y = (float(each) for each in re.findall(r"away, at \((\S+), (\S+)\)", line)[0])
        assert router.refusal((told_x, told_y, heading), []) is None
        free_pose = Stop(start.free, 1e-3, Arrival(heading, 1e-3, 0.0, 0.0))
        assert router.refusal((*START, 0.0), [free_pose]) is None
        goal = router.refusal((*START, 0.0), [Stop((x, y), 1e-3, Arrival(heading, 1e-3, 0.0, 0.0))])
        if goal is not None and "lies" not in goal.why:  # a millimetre may be enough
            assert goal.free == start.free
    assert told > 10
