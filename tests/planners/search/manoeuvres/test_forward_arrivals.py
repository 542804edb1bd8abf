"""Trains arrive forwards where a loop costs less than to back in."""

from __future__ import annotations

import math
from dataclasses import replace
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.search import search_and_polish
from planners.search.manoeuvres import forward_arrivals
from planners.search.manoeuvres.forward_arrivals import arrive_forwards
from planners.search.query import Query
from planners.solve import solve
from planners.world.arrays import Floats
from planners.world.authority.authority import faults
from planners.world.compiling import working_clock
from planners.world.driving_cost import cost_of, metres_backwards
from planners.world.geometry.collision import scene_of
from planners.world.problem import Arrival, Plan, Problem, obstacles_of
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, Vehicle
from planners.world.workspace import Workspace
from tests.worlds import box

START = (35.0, 35.0, 0.0)
# to the left of the start: a train that drives past them backs in over metres
BESIDE = [(33.0, 41.0, 0.7), (33.0, 40.7, 0.8), (33.6, 40.7, 0.65), (33.08, 41.45, 0.89)]


def asked(goal: tuple[float, float, float], *obstacles: Floats) -> Problem:
    x, y, heading = goal
    arrival = Arrival(heading, 0.05, 0.0, 0.0, (0.0,), (0.05,))
    around = obstacles_of([[polygon] for polygon in obstacles])
    return Problem("yard", "test", START, (x, y), 0.1, (0.0, 0.0, 70.0, 70.0), around, arrival=arrival)


def backed(problem: Problem, vehicle: Vehicle = CAR_1_TRAILER) -> Plan:
    """What is planned without loops at last."""
    with mock.patch.object(search_and_polish, "arrive_forwards", return_value=None):
        plan = solve(problem, "lattice", vehicle=vehicle).plan
    assert plan is not None
    return plan


def forwards(
    problem: Problem, plan: Plan, vehicle: Vehicle = CAR_1_TRAILER, seconds: float = 30.0
) -> Plan | None:
    query = Query(problem, generator(0), scene_of(problem), Workspace(), vehicle=vehicle)
    return arrive_forwards(query, plan, working_clock() + seconds)


def test_a_train_swings_out_and_drives_straight_in() -> None:
    saved_s = 0.0
    for goal in BESIDE:
        problem = asked(goal)
        before, after = backed(problem), solve(problem, "lattice", vehicle=CAR_1_TRAILER).plan
        assert after is not None
        assert faults(problem, after, CAR_1_TRAILER) == []
        assert after.duration_s <= before.duration_s
        saved_s += before.duration_s - after.duration_s
        if after.duration_s < before.duration_s:
            assert metres_backwards(after, CAR_1_TRAILER) < metres_backwards(before, CAR_1_TRAILER)
    assert saved_s > 2.0


@settings(max_examples=8, deadline=None)
@given(away=st.floats(2.0, 12.0), bearing=st.floats(-math.pi, math.pi), heading=st.floats(-math.pi, math.pi))
def test_what_arrives_forwards_is_a_cheaper_plan(away: float, bearing: float, heading: float) -> None:
    goal = START[0] + away * math.cos(bearing), START[1] + away * math.sin(bearing), heading
    problem = asked(goal, box(38.0, 39.0, 0.3, 1.0, 1.0), box(31.0, 33.0, 1.0, 1.0, 0.5))
    plan = solve(problem, "lattice", vehicle=CAR_1_TRAILER, polished=False).plan
    if plan is None:  # the goal is blocked
        return
    better = forwards(problem, plan)
    if better is not None:
        assert faults(problem, better, CAR_1_TRAILER) == []
        assert cost_of(better, CAR_1_TRAILER) < cost_of(plan, CAR_1_TRAILER)


@pytest.mark.parametrize(
    ("goal", "speed"),
    [((35.78, 29.6, -2.846), 0.52), ((29.41, 38.68, 0.661), 1.59), ((28.22, 33.27, 1.424), 0.76)],
)
def test_a_loop_from_the_start_begins_as_the_train_moves(
    goal: tuple[float, float, float], speed: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It began at rest, wherever the train was in motion."""
    problem = replace(asked(goal), start_motion=(speed,))
    plan = solve(problem, "lattice", vehicle=CAR_1_TRAILER, polished=False).plan
    assert plan is not None
    monkeypatch.setattr(forward_arrivals, "_beginnings", lambda *_: [0])
    monkeypatch.setattr(forward_arrivals, "_backs_in", lambda *_: True)
    better = forwards(problem, plan)
    assert better is not None
    assert faults(problem, better, CAR_1_TRAILER) == []


def test_loops_are_laid_only_where_a_train_backs_in_and_could_drive_in(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    laid = []
    monkeypatch.setattr(
        forward_arrivals, "list_loops", lambda found, *_: laid.append(found.blocked.fill(1.0))
    )
    x, y, heading = BESIDE[0]
    plan = backed(asked(BESIDE[0]))
    behind = box(x - 2.0 * math.cos(heading), y - 2.0 * math.sin(heading), heading, 0.3, 1.0)
    turned = Plan(plan.states[::-1], plan.controls[::-1], plan.dt)
    quick = CAR_1_TRAILER._replace(max_speed=0.5 * -CAR_1_TRAILER.min_speed)
    for problem, drive, vehicle, seconds, lays in (
        (asked(BESIDE[0]), plan, CAR_1_TRAILER, 30.0, True),
        (asked(BESIDE[0]), plan, CAR_1_TRAILER, 0.0, False),  # no time is left
        (asked(BESIDE[0], behind), plan, CAR_1_TRAILER, 30.0, False),
        (asked(BESIDE[0]), turned, CAR_1_TRAILER, 30.0, False),  # it ends as the other begins, forwards
        (asked(BESIDE[0]), plan, quick, 30.0, False),
    ):
        laid.clear()
        assert forwards(problem, drive, vehicle, seconds) is None
        assert bool(laid) == lays
    place = Problem("place", "test", START, (x, y), 2.0, (0.0, 0.0, 70.0, 70.0), obstacles_of([]))
    car = Plan(np.zeros((2, 5)), np.zeros((1, 2)), CAR.dt)
    assert forwards(place, plan) is None
    assert forwards(place, car, CAR) is None
    assert not laid
