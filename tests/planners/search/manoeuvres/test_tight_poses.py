"""Tight poses: slots among parked vehicles are reached exactly, judged by the authority."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from planners.search.manoeuvres import suitability
from planners.search.manoeuvres.arcs import LEAST, STRIDE, stride_of
from planners.search.outcome import Status
from planners.search.query import Limits
from planners.search.registry import plan
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.arrays import Floats
from planners.world.authority.authority import faults
from planners.world.classes.families import Family, family
from planners.world.problem import Arrival, Plan, Problem, obstacles_of
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER
from storage.vehicles.vehicle_files import said_vehicle
from tests.worlds import strewn

LIMITS = Limits(expansions=6000)


def slot(source: Family, number: int) -> Problem:
    return to_canonical(source.draw(3, number))[0]


def solved(problem: Problem) -> Plan:
    found = plan("lattice", problem, generator(0), limits=LIMITS, vehicle=CAR).plan
    assert found is not None
    return found


@pytest.mark.parametrize("name", ["parallel", "perpendicular", "angled"])
def test_slots_are_reached_exactly(name: str) -> None:
    for number in range(12):
        problem = slot(family(name, "standard"), number)
        assert faults(problem, solved(problem)) == []


HARD = [("angled", 53), ("angled", 71), ("angled", 97), ("perpendicular", 26), ("lot", 2), ("lot", 43)]


@pytest.mark.parametrize(("name", "number"), HARD)
def test_the_narrowest_slots_are_reached_too(name: str, number: int) -> None:
    problem = to_canonical(family(name, "hard").draw(900, number))[0]
    assert faults(problem, solved(problem)) == []


@pytest.mark.parametrize(("name", "number"), [("forklift", 0), ("forklift", 2), ("bus", 4), ("bus", 12)])
def test_a_body_that_swings_out_behind_leaves_a_kerb_degree_by_degree(name: str, number: int) -> None:
    vehicle = said_vehicle(f"docs/vehicles/{name}.yaml")
    problem = to_canonical(family("parallel", "standard", vehicle).draw(91, number))[0]
    found = plan("lattice", problem, generator(0), limits=Limits(expansions=12_000), vehicle=vehicle).plan
    assert found is not None
    assert faults(problem, found, vehicle) == []


@pytest.mark.parametrize(
    ("name", "difficulty", "seed", "number", "seconds"),
    [
        *(("jackal", "standard", 5, number, 5.0) for number in (2, 43, 47)),  # 18 to 21 without both ways
        ("jackal", "hard", 93, 4, 10.0),  # 34 where it fits in half steps only
        *(("turtlebot", "hard", 92, number, 15.0) for number in (5, 17, 19)),  # 42 to 56 at full speed
    ],
)
def test_a_small_robot_does_not_creep_into_a_slot_where_a_drive_nearly_fits(
    name: str, difficulty: str, seed: int, number: int, seconds: float
) -> None:
    vehicle = said_vehicle(f"docs/vehicles/{name}.yaml")
    problem = to_canonical(family("parallel", difficulty, vehicle).draw(seed, number))[0]
    found = solve(problem, "lattice", vehicle=vehicle).plan
    assert found is not None
    assert faults(problem, found, vehicle) == []
    assert found.duration_s < seconds


@pytest.mark.parametrize(("number", "seconds"), [(4, 30.0), (28, 23.0)])  # 46 and 28 in steps at full speed
def test_a_drive_that_could_be_much_quicker_is_made_so_though_not_as_quick(
    number: int, seconds: float
) -> None:
    problem = to_canonical(family("yard", "hard", CAR_1_TRAILER).draw(6, number))[0]
    found = solve(problem, "lattice", vehicle=CAR_1_TRAILER).plan
    assert found is not None
    assert faults(problem, found, CAR_1_TRAILER) == []
    assert found.duration_s < seconds


def test_the_same_question_has_the_same_answer() -> None:
    problem = slot(family("parallel", "hard"), 0)
    first, second = solved(problem), solved(problem)
    assert np.array_equal(first.states, second.states)
    assert np.array_equal(first.controls, second.controls)


def test_manoeuvres_solve_what_the_lattice_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    problems = [slot(family("parallel"), number) for number in range(10)]
    ask = partial(plan, "lattice", limits=Limits(expansions=500), vehicle=CAR)
    monkeypatch.setattr("planners.search.lattice.suits", lambda _goal, _vehicle: False)
    alone = sum(ask(problem, generator(0)).plan is not None for problem in problems)
    monkeypatch.setattr("planners.search.lattice.suits", suitability.suits)
    together = sum(ask(problem, generator(0)).plan is not None for problem in problems)
    assert together >= 8 > 4 >= alone


def test_a_trailer_is_backed_to_a_dock() -> None:
    for number in range(2):
        problem = slot(family("dock", "easy", CAR_1_TRAILER), number)
        found = plan("lattice", problem, generator(0), limits=LIMITS, vehicle=CAR_1_TRAILER).plan
        assert found is not None
        assert faults(problem, found, CAR_1_TRAILER) == []


def at_the_kerb(length: float) -> Problem:
    """Into a slot of a ``length`` between two vehicles, 0.3 m deeper than the car is wide."""
    kerb, deep = obstacle(0, -1, 50, 0), CAR.width + 0.3
    row = obstacle(0, 0, 20, deep), obstacle(20 + length, 0, 50, deep), obstacle(0, deep + 4, 50, deep + 5)
    middle = 20 + 0.5 * length - 0.5 * (CAR.front - CAR.rear)
    goal, inside = (middle, 0.15 + 0.5 * CAR.width), Arrival(0.0, 0.05, 0.0, 0.0)
    bounds = (-10.0, -10.0, 60.0, 20.0)
    obstacles = obstacles_of([[each] for each in (kerb, *row)])
    return Problem("kerb", "kerb", (8.0, deep + 2.0, 0.0), goal, 0.1, bounds, obstacles, arrival=inside)


def obstacle(left: float, low: float, right: float, high: float) -> Floats:
    return np.array([[left, low], [right, low], [right, high], [left, high]], float)


@pytest.mark.parametrize(("room", "fits"), [(0.1, False), (0.4, True)])
def test_who_cannot_get_into_a_slot_is_told_that_nobody_gets_out_of_it(room: float, fits: bool) -> None:
    inwards = at_the_kerb(CAR.front + CAR.rear + room)
    x, y, heading = inwards.start
    outwards = replace(
        inwards, start=(*inwards.goal, 0.0), goal=(x, y), arrival=Arrival(heading, 0.05, 0.0, 0.0)
    )
    into, out = (solve(to_canonical(each)[0], "lattice") for each in (inwards, outwards))
    assert into.status == (Status.SOLVED if fits else Status.GOAL_ENCLOSED)
    assert out.solved == fits
    assert out.status != Status.GOAL_ENCLOSED  # there is room in the street


def test_a_goal_in_a_lane_that_leads_out_of_sight_is_not_called_enclosed() -> None:
    """The start lies behind a wall, and the lane of the goal ends beyond the bounds."""
    lane = obstacle(20, 0, 60, 1), obstacle(20, 2.4, 60, 3.4), obstacle(20, 1, 21, 2.4)
    bounds = (-10.0, -20.0, 60.0, 20.0)
    problem = Problem(
        *("lane", "lane", (8.0, 2.0, 0.0), (30.0, 1.7), 0.1, bounds, obstacles_of([[each] for each in lane])),
        arrival=Arrival(0.0, 0.05, 0.0, 0.0),
    )
    found = solve(to_canonical(problem)[0], "lattice", limits=Limits(expansions=20_000))
    assert not found.solved
    assert found.status != Status.GOAL_ENCLOSED


def across_open_ground() -> Problem:
    return replace(strewn(0, 0), goal=(14.0, 12.0), goal_radius=0.1, arrival=Arrival(0.8, 0.05, 0.0, 0.0))


@pytest.mark.parametrize("squeezed", [False, True])
def test_a_search_for_something_better_is_not_ended_as_if_there_were_nothing(squeezed: bool) -> None:
    """All that it finds costs more, or it finds nothing, since it does not squeeze."""
    problem = at_the_kerb(CAR.front + CAR.rear + 0.3) if squeezed else across_open_ground()
    problem = to_canonical(problem)[0]
    quick = solve(problem, "lattice").duration_s
    assert quick is not None
    limits = Limits(expansions=3_000, bound_s=0.9 * quick)
    found = plan("lattice", problem, generator(0), limits=limits)
    assert (found.plan, found.status) == (None, Status.BUDGET_SPENT)


@pytest.mark.parametrize("backwards", [0.0, -1e-6, -0.5, -4.0])
def test_strides_are_at_most_a_step_or_a_small_share_of_the_length(backwards: float) -> None:
    vehicle, length = CAR._replace(min_speed=backwards), CAR.front + CAR.rear
    assert stride_of(1.0, vehicle) == min(STRIDE * length, vehicle.max_speed * vehicle.dt)
    stride, step = stride_of(-1.0, vehicle), -backwards * vehicle.dt
    assert (stride == 0.0) == (backwards == 0.0)
    assert min(step, LEAST * length) <= stride <= max(step, LEAST * length)


def test_a_vehicle_that_hardly_drives_backwards_is_not_looked_at_for_ever() -> None:
    problem = to_canonical(at_the_kerb(CAR.front + CAR.rear + 3.0))[0]
    usual, hardly = (
        solve(problem, "lattice", limits=Limits(expansions=500), vehicle=CAR._replace(min_speed=least))
        for least in (-2.0, -1e-6)
    )
    assert hardly.collision_checks < 100 * usual.collision_checks
