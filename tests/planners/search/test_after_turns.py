"""Turns with which a drive may begin, and searches that go on from them."""

from __future__ import annotations

import math
from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.search import search_and_polish as searching
from planners.search.first_turns import ANGLES, first_turns
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.geometry.collision import scene_of
from planners.world.problem import Problem, obstacles_of, start_state
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, DIFFERENTIAL_DRIVE, Vehicle
from tests.speed.one_version import through_doors
from tests.worlds import box

FORWARD_CAR = CAR._replace(min_speed=0.0)
GRIPPING_CAR = CAR._replace(max_lateral_acceleration=2.0)
VEHICLES = (CAR, FORWARD_CAR, GRIPPING_CAR, DIFFERENTIAL_DRIVE, CAR_1_TRAILER)


def standing(x: float, y: float, heading: float, walls: list[list[np.ndarray]]) -> Problem:
    bounds = (-20.0, -20.0, 20.0, 20.0)
    return Problem("turns", "turns", (x, y, heading), (15.0, 0.0), 0.5, bounds, obstacles_of(walls))


def ending_at(problem: Problem, x: float, y: float) -> Problem:
    return replace(problem, goal=(x, y), goal_radius=0.1)


@pytest.mark.parametrize("vehicle", [each for each in VEHICLES if each is not CAR_1_TRAILER])
def test_in_the_open_each_turn_reaches_its_angle_within_all_limits(vehicle: Vehicle) -> None:
    problem = standing(0.0, 0.0, 0.3, [])
    turns = first_turns(problem, vehicle, scene_of(problem))
    gears = {math.copysign(1.0, turn.states[-1, 3]) for turn in turns}
    assert gears == ({1.0, -1.0} if vehicle.min_speed < 0.0 else {1.0})
    assert len(turns) == 2 * len(ANGLES) * len(gears)
    for turn in turns:
        x, y, *_ = turn.states[-1]
        assert faults(ending_at(problem, float(x), float(y)), turn, vehicle) == []
    turned = sorted(abs(turn.states[-1, 2] - 0.3) for turn in turns)
    one_step = max(np.abs(np.diff(turn.states[:, 2])).max() for turn in turns)
    for angle, reached in zip(np.sort(np.tile(ANGLES, 2 * len(gears))), turned, strict=True):
        assert angle <= reached <= angle + one_step


@given(
    st.sampled_from(VEHICLES),
    st.floats(-5.0, 5.0),
    st.floats(-5.0, 5.0),
    st.floats(-math.pi, math.pi),
    st.floats(2.0, 6.0),
)
def test_turns_are_drives_from_the_start_that_touch_nothing(
    vehicle: Vehicle, x: float, y: float, heading: float, far: float
) -> None:
    walls = [[box(x + far, y, 0.0, 0.2, 6.0)], [box(x, y - far, heading, 5.0, 0.2)]]
    problem = standing(x, y, heading, walls)
    for turn in first_turns(problem, vehicle, scene_of(problem)):
        assert np.array_equal(turn.states[0], start_state(problem, vehicle))
        assert np.allclose(turn.states, simulate(turn.states[0], turn.controls, vehicle))
        end_x, end_y = turn.states[-1, :2].tolist()
        assert faults(ending_at(problem, end_x, end_y), turn, vehicle) == []


def test_a_vehicle_between_walls_turns_nowhere() -> None:
    walls = [[box(0.0, side, 0.0, 6.0, 0.1)] for side in (-0.7, 0.7)]
    problem = standing(0.0, 0.0, 0.0, walls)
    assert first_turns(problem, CAR, scene_of(problem)) == []


# found among a hundred of seed 601
@pytest.mark.parametrize(("number", "seconds"), [(9, 1.0), (29, 0.5)])
def test_a_car_that_looks_away_from_its_way_turns_round_first_where_that_is_quicker(
    number: int, seconds: float
) -> None:
    problem = to_canonical(through_doors(np.random.default_rng([601, number]), CAR, pose=False))[0]
    with patch.object(searching, "AFTER_TURN", 0):
        without = solve(problem, "lattice")
    answer = solve(problem, "lattice")
    assert answer.plan is not None
    assert without.plan is not None
    assert faults(problem, answer.plan) == []
    assert answer.plan.duration_s <= without.plan.duration_s - seconds


@pytest.mark.parametrize("vehicle", [CAR, CAR_1_TRAILER])
def test_drives_to_places_are_no_longer_by_mean_for_it(vehicle: Vehicle) -> None:
    """A single one may be: the improvement that follows has less work where turns have helped."""
    without, answers = [], []
    for number in range(8):
        drawn = through_doors(np.random.default_rng([603, number]), vehicle, pose=False)
        problem = to_canonical(drawn)[0]
        with patch.object(searching, "AFTER_TURN", 0):
            other = solve(problem, "lattice", vehicle=vehicle)
        answer = solve(problem, "lattice", vehicle=vehicle)
        assert (answer.plan is None) == (other.plan is None)
        if answer.plan is not None and other.plan is not None:
            without.append(other.plan.duration_s)
            answers.append(answer.plan.duration_s)
    assert sum(answers) <= sum(without)
