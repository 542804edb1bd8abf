"""Who drives forwards only, and even who cannot stand, reaches poses where there is room to turn."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from planners.search.manoeuvres.suitability import suits
from planners.search.manoeuvres.variants import word_radius
from planners.solve import solve
from planners.world.authority.authority import faults
from planners.world.goal import goal_of
from planners.world.problem import Arrival, Problem
from planners.world.vehicles.vehicle import CAR, DIFFERENTIAL_DRIVE, Vehicle
from planners.world.workspace import Workspace
from tests.planners.world.motions import KINDS
from tests.worlds import box, problem_of

WORKSPACE = Workspace()
FORWARDS: dict[str, Vehicle] = {
    "car": CAR._replace(min_speed=0.0),
    "differential-drive": DIFFERENTIAL_DRIVE._replace(min_speed=0.0),
    "car, first order": KINDS["car-first-order"]._replace(min_speed=0.0),
    "unicycle that cannot stand": KINDS["unicycle-first-order"]._replace(min_speed=2.0),
    "car that cannot stand": KINDS["car-first-order"]._replace(min_speed=2.0),
}


def asked(seed: int, vehicle: Vehicle) -> Problem:
    """From a pose to a pose some metres away, among three boxes."""
    rng = np.random.default_rng(seed)
    way, side = rng.uniform(5.0, 14.0), rng.uniform(-math.pi, math.pi)
    boxes = [box(25.0 + x, 25.0 + y, 0.4, 0.6, 0.5) for x, y in rng.uniform(3.0, 9.0, (3, 2))]
    goal = 25.0 - way * abs(math.cos(side)), 25.0 + way * math.sin(side)
    slow = max(vehicle.min_speed, 0.0)
    arrival = Arrival(rng.uniform(-3.0, 3.0), 0.1, slow, vehicle.max_speed if slow > 0.0 else 0.0)
    start = 25.0, 25.0, rng.uniform(-3.0, 3.0)
    return replace(problem_of(boxes), start=start, goal=goal, goal_radius=0.2, arrival=arrival)


def is_driven_forwards(problem: Problem, vehicle: Vehicle) -> None:
    plan = solve(problem, "lattice", vehicle=vehicle, workspace=WORKSPACE).plan
    assert plan is not None
    assert faults(problem, plan, vehicle) == []
    assert plan.states[:, 3].min() >= vehicle.min_speed - 1e-9


@pytest.mark.parametrize("name", FORWARDS)
def test_poses_are_reached_without_reversing(name: str) -> None:
    for seed in range(8):
        is_driven_forwards(asked(seed, FORWARDS[name]), FORWARDS[name])


def ramp_seconds(way: float, top: float, rate: float) -> float:
    """From rest to rest over a ``way`` of metres or radians, as quickly as speed and acceleration allow."""
    return 2.0 * math.sqrt(way / rate) if way <= top * top / rate else way / top + top / rate


@pytest.mark.parametrize("turn_rate", [0.25, 0.5, 2.0, 4.0])
@pytest.mark.parametrize("least", [0.0, -1.0])
def test_who_can_turn_on_the_spot_is_there_nearly_as_soon_as_by_turning_driving_and_turning(
    turn_rate: float, least: float
) -> None:
    """Who could not reverse drove once round a circle as wide as at full speed, to poses beside him."""
    robot = DIFFERENTIAL_DRIVE._replace(max_turn_rate=turn_rate, min_speed=least)
    rng = np.random.default_rng(7)
    for _ in range(12):
        way, towards, turn = rng.uniform(0.5, 5.0), *rng.uniform(-math.pi, math.pi, 2)
        goal = 25.0 + way * math.cos(towards), 25.0 + way * math.sin(towards)
        problem = replace(
            problem_of([]),
            start=(25.0, 25.0, 0.0),
            goal=goal,
            goal_radius=0.05,
            arrival=Arrival(turn, 0.05, 0.0, 0.0),
        )
        plan = solve(problem, "lattice", vehicle=robot, workspace=WORKSPACE).plan
        assert plan is not None
        assert faults(problem, plan, robot) == []
        turns = abs(towards), abs(math.remainder(turn - towards, math.tau))
        seconds = ramp_seconds(way, robot.max_speed, robot.max_acceleration)
        seconds += sum(ramp_seconds(each, turn_rate, robot.max_turn_acceleration) for each in turns)
        assert plan.duration_s <= 1.15 * seconds + 4.0 * robot.dt


def test_who_cannot_stand_is_not_asked_to() -> None:
    unicycle = FORWARDS["unicycle that cannot stand"]
    problem = asked(0, unicycle)
    assert suits(goal_of(problem, unicycle), unicycle)
    at_rest = replace(problem, arrival=Arrival(0.0, 0.1, 0.0, 0.0))
    assert not suits(goal_of(at_rest, unicycle), unicycle)
    assert not suits(goal_of(problem, unicycle), unicycle._replace(first_order=False))


def in_a_dead_end(seed: int, vehicle: Vehicle) -> Problem:
    """From facing the closed end of a lane to facing its open end, with 0.4 m beside a turn on each side."""
    radius = word_radius(vehicle._replace(max_speed=max(vehicle.min_speed, 1.0)))
    half = math.hypot(radius + 0.5 * vehicle.width, vehicle.front) + 0.4
    walls = [box(25.0, 36.0, 0.0, half + 1.0, 1.0)]
    walls += [box(25.0 + side * (half + 1.0), 25.0, 0.0, 1.0, 10.0) for side in (-1.0, 1.0)]
    start = 25.0 + np.random.default_rng(seed).uniform(-0.3, 0.3) * half, 22.0, 0.5 * math.pi
    slow = max(vehicle.min_speed, 0.0)
    arrival = Arrival(-0.5 * math.pi, 0.1, slow, vehicle.max_speed if slow > 0.0 else 0.0)
    return replace(problem_of(walls), start=start, goal=(25.0, 12.0), goal_radius=0.2, arrival=arrival)


@pytest.mark.parametrize("name", FORWARDS)
def test_who_faces_a_dead_end_turns_round(name: str) -> None:
    for seed in range(4):
        is_driven_forwards(in_a_dead_end(seed, FORWARDS[name]), FORWARDS[name])
