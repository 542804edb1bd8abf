"""Connections: drives to a goal pose that do not look at obstacles."""

from __future__ import annotations

import math

import numpy as np
import pytest

from planners.search.connection.candidates import list_connections, next_word
from planners.search.connection.connect import connect
from planners.search.connection.connection import allocate_connection
from planners.world.arrays import Floats
from planners.world.authority.authority_equations import limits_of, simulate_again
from planners.world.goal import MOST_TURN, SLACK, goal_of_pose, reaches
from planners.world.vehicles.dynamics import load, turn_limit_at, turning_speed
from planners.world.vehicles.vehicle import CAR, CAR_2_TRAILERS, DIFFERENTIAL_DRIVE, Vehicle, state_size

VEHICLES = {
    "car": CAR,
    "differential-drive": DIFFERENTIAL_DRIVE,
    "car-2-trailers": CAR_2_TRAILERS,
    "limited-car": CAR._replace(max_lateral_acceleration=1.0),
    "limited-differential-drive": DIFFERENTIAL_DRIVE._replace(max_lateral_acceleration=1.0),
}
UNEVEN = {
    "turned-within-a-step": CAR._replace(max_steering_rate=20.0),
    "turned-slowly-for-its-speed": DIFFERENTIAL_DRIVE._replace(
        max_speed=1.8, min_speed=-1.8, max_acceleration=20.0, max_turn_rate=2.8, max_turn_acceleration=3.2
    ),
}
Drive = tuple[Floats, Floats]


def connection(start: Floats, goal: Floats, vehicle: Vehicle, top: float) -> Drive | None:
    """States ``[T, S]`` and controls of the first of the three quickest words that leads to the goal."""
    buffers = allocate_connection(state_size(vehicle))
    buffers.states[0] = start
    count = list_connections(buffers, 0.0, goal, top, vehicle)
    for _ in range(3):
        word = next_word(buffers, count, math.inf)
        steps = connect(buffers, word, goal, top, vehicle) if word >= 0 else 0
        if steps > 0:
            return buffers.states[: steps + 1].copy(), buffers.controls[:steps].copy()
    return None


def questions(vehicle: Vehicle, moving: bool, count: int, seed: int) -> list[tuple[Floats, Floats]]:
    rng = np.random.default_rng(seed)
    drawn = []
    for _ in range(count):
        start = np.zeros(state_size(vehicle))
        start[2] = rng.uniform(-math.pi, math.pi)
        if moving:
            start[3:5] = rng.uniform(0.0, vehicle.max_speed), rng.uniform(-0.5, 0.5)
            most = (1.0 - 1e-9) * turn_limit_at(start[3], vehicle)
            start[4] = np.clip(start[4], -most, most)
        bearing, metres = rng.uniform(-math.pi, math.pi), rng.uniform(2.0, 30.0)
        heading = rng.uniform(-math.pi, math.pi)
        drawn.append((start, goal_of_pose(metres * math.cos(bearing), metres * math.sin(bearing), heading)))
    return drawn


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
@pytest.mark.parametrize("moving", [False, True], ids=["from-rest", "moving"])
def test_connections_are_lawful_drives_to_the_goal_and_nearly_always_there(
    vehicle: Vehicle, moving: bool
) -> None:
    asked = questions(vehicle, moving, 60, 1)
    closed = 0
    for start, goal in asked:
        drive = connection(start, goal, vehicle, turning_speed(vehicle))
        if drive is None:
            continue
        closed += 1
        states, controls = drive
        assert np.abs(simulate_again(start, controls, vehicle) - states).max() < 1e-6
        assert reaches(load(states, len(states) - 1, vehicle), goal)
        for limit in limits_of(states, controls, vehicle):
            if not limit.name.lower().startswith("hitch"):
                assert limit.values.min() >= limit.low - 1e-9
                assert limit.values.max() <= limit.high + 1e-9
    assert closed >= (0.8 if moving else 0.98) * len(asked)


@pytest.mark.parametrize("vehicle", UNEVEN.values(), ids=UNEVEN)
def test_bends_that_come_at_once_or_slowly_are_driven_as_well(vehicle: Vehicle) -> None:
    for moving, least in ((False, 0.9), (True, 0.7)):
        asked = questions(vehicle, moving, 100, 1)
        closed = [connection(start, goal, vehicle, turning_speed(vehicle)) for start, goal in asked]
        assert sum(drive is not None for drive in closed) >= least * len(asked)


@pytest.mark.parametrize("vehicle", [CAR, DIFFERENTIAL_DRIVE, *UNEVEN.values()])
def test_a_goal_straight_ahead_but_for_a_little_is_driven_to_forwards(vehicle: Vehicle) -> None:
    for aside in (0.05, 0.5, 2.0):
        for heading in (0.0, 0.2, 1.5):
            start = np.zeros(state_size(vehicle))
            drive = connection(start, goal_of_pose(40.0, aside, heading), vehicle, turning_speed(vehicle))
            assert drive is not None
            assert drive[0][:, 3].min() >= -1e-9


@pytest.mark.parametrize("vehicle", [CAR, DIFFERENTIAL_DRIVE], ids=["car", "differential-drive"])
def test_only_arcs_are_driven_slowly_where_lateral_acceleration_is_limited(vehicle: Vehicle) -> None:
    """Nothing is gained by braking where the way is straight."""
    limited = vehicle._replace(max_lateral_acceleration=0.5)
    turning = turning_speed(limited)
    assert turning < 0.3 * vehicle.max_speed
    start, goal = np.zeros(state_size(limited)), goal_of_pose(30.0, 10.0, 0.5 * math.pi)
    drive = connection(start, goal, limited, turning)
    assert drive is not None
    speeds, lateral = drive[0][:, 3], limits_of(*drive, limited)[-1].values
    assert speeds.max() > 0.9 * vehicle.max_speed
    assert np.abs(lateral).max() > 0.9 * limited.max_lateral_acceleration


@pytest.mark.parametrize("turn_acceleration", [0.5, 1.5, 4.0])
def test_a_differential_drive_stands_still_at_the_end_however_slowly_its_turn_ends(
    turn_acceleration: float,
) -> None:
    brisk = DIFFERENTIAL_DRIVE._replace(max_acceleration=20.0, max_turn_acceleration=turn_acceleration)
    closed = []
    for most_turn in (math.inf, SLACK):
        closed.append(0)
        for start, goal in questions(brisk, False, 60, 4):
            goal[MOST_TURN] = most_turn
            drive = connection(start, goal, brisk, brisk.max_speed)
            closed[-1] += drive is not None
            assert drive is None or abs(drive[0][-1, 4]) <= most_turn
    assert closed[1] >= 0.95 * closed[0] > 0.0  # to stand is hardly harder


@pytest.mark.parametrize("vehicle", [CAR, DIFFERENTIAL_DRIVE], ids=["car", "differential-drive"])
def test_a_mirrored_question_has_the_mirrored_drive(vehicle: Vehicle) -> None:
    for start, goal in questions(vehicle, True, 30, 2):
        across = np.array([1.0, -1.0, -1.0, 1.0, -1.0])
        other = goal.copy()
        other[[1, 3]] *= -1.0
        one, two = (connection(*each, vehicle, 4.0) for each in ((start, goal), (start * across, other)))
        assert (one is None) == (two is None)
        if one is not None and two is not None:
            assert np.abs(one[0] * across - two[0]).max() < 1e-6


def test_tight_tolerances_and_speeds_at_the_goal_are_kept() -> None:
    closed = 0
    for start, goal in questions(CAR, False, 60, 3):
        goal[2], goal[4] = 0.01, 0.002
        goal[5:7] = 0.5, 1.5
        drive = connection(start, goal, CAR, 4.0)
        closed += drive is not None
        assert drive is None or reaches(load(drive[0], len(drive[0]) - 1, CAR), goal)
    assert closed >= 55


def test_a_vehicle_that_cannot_drive_backwards_is_given_no_gears() -> None:
    forwards = CAR._replace(min_speed=0.0)
    for start, goal in questions(forwards, False, 20, 4):
        drive = connection(start, goal, forwards, 4.0)
        assert drive is None or drive[0][:, 3].min() >= 0.0
