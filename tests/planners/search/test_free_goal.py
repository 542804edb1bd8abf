"""A goal pose beside an obstacle: what is tolerated is made use of."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.attempt import DRIVES
from planners.explanation import drive_found
from planners.memory.library.plan_library import gathered_library
from planners.search.free_goal import has_free_goal, with_free_goal
from planners.search.outcome import MEANINGS, Status
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.geometry.collision import scene_of
from planners.world.problem import Arrival, Problem
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, DIFFERENTIAL_DRIVE, Vehicle
from tests.worlds import box, problem_of

WALL_X = 30.0  # metres: the face that looks to the left
RADIUS, TURN = 0.3, 0.1


def beside_a_wall(gap: float, vehicle: Vehicle, heading: float = 0.5 * math.pi) -> Problem:
    """To a pose along a wall whose side is ``gap`` metres from it, below 0 inside."""
    return replace(
        problem_of([box(WALL_X + 1.0, 25.0, 0.0, 1.0, 10.0)]),
        start=(12.0, 12.0, 0.0),
        goal=(WALL_X - 0.5 * vehicle.width - gap, 25.0),
        goal_radius=RADIUS,
        arrival=Arrival(heading, TURN, 0.0, 0.0),
    )


@given(
    gap=st.floats(-0.5, 0.5),
    turned=st.floats(-0.2, 0.2),
    vehicle=st.sampled_from([CAR, DIFFERENTIAL_DRIVE, CAR_1_TRAILER]),
)
def test_what_is_aimed_at_lies_within_what_is_tolerated(gap: float, turned: float, vehicle: Vehicle) -> None:
    asked = beside_a_wall(gap, vehicle, 0.5 * math.pi + turned)
    aimed = with_free_goal(asked, vehicle, scene_of(asked))
    assert asked.arrival is not None
    assert aimed.arrival is not None
    assert math.dist(aimed.goal, asked.goal) + aimed.goal_radius <= RADIUS + 1e-9
    off = abs(aimed.arrival.heading - asked.arrival.heading)
    assert off + aimed.arrival.heading_tolerance <= TURN + 1e-9
    if aimed is not asked:
        assert with_free_goal(aimed, vehicle, scene_of(aimed)) is aimed


@pytest.mark.parametrize("vehicle", [CAR, DIFFERENTIAL_DRIVE], ids=["car", "drive"])
@pytest.mark.parametrize("gap", [0.2, 0.005, 0.0, -0.1, -0.2])
def test_a_pose_beside_a_wall_is_reached_within_its_tolerance(gap: float, vehicle: Vehicle) -> None:
    asked = to_canonical(beside_a_wall(gap, vehicle))[0]
    found = solve(asked, "lattice", vehicle=vehicle, polished=False).plan
    assert found is not None
    assert faults(asked, found, vehicle) == []


def test_the_drive_that_was_moved_to_a_pose_beside_a_wall_is_found_again() -> None:
    asked = to_canonical(beside_a_wall(-0.1, CAR))[0]
    stored = solve(asked, "lattice").plan
    assert stored is not None
    library = gathered_library("walls", CAR, [("wall", stored)])
    attempt = solve(asked, "lattice", "repair", memory=library)
    assert attempt.recall == DRIVES
    found = drive_found(asked, attempt, library, CAR)
    assert found is not None
    assert found.answer.plan is not None
    assert attempt.plan is not None
    assert np.array_equal(found.answer.plan.states, attempt.plan.states)


def test_a_pose_within_a_wall_stays_as_it_is() -> None:
    asked = beside_a_wall(-0.9, CAR)
    assert with_free_goal(asked, CAR, scene_of(asked)) is asked


def test_whether_a_goal_has_room_is_known_once_it_is_aimed_at() -> None:
    for gap, has_room in ((0.2, True), (-0.1, True), (-0.9, False)):
        asked = beside_a_wall(gap, CAR)
        scene = scene_of(asked)
        assert has_free_goal(with_free_goal(asked, CAR, scene), CAR, scene) == has_room
    anywhere = replace(asked, arrival=None)
    assert has_free_goal(anywhere, CAR, scene)


def test_every_way_to_end_without_a_plan_has_a_meaning() -> None:
    assert set(MEANINGS) == set(Status) - {Status.SOLVED}
