"""A goal pose beside an obstacle: what is tolerated is made use of."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from dashboards.world_outlines import outlines
from planners.attempt import DRIVES
from planners.explanation import drive_found
from planners.memory.library.plan_library import gathered_library
from planners.search.free_goal import lacks_room, with_free_goal
from planners.search.outcome import MEANINGS, Status
from planners.search.query import Limits
from planners.search.registry import PLANNERS, plan
from planners.solve import improved, solve
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.geometry.collision import scene_of
from planners.world.problem import Arrival, Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import (
    CAR,
    CAR_1_TRAILER,
    CAR_2_TRAILERS,
    DIFFERENTIAL_DRIVE,
    Vehicle,
    state_size,
    trailers_of,
)
from storage.vehicles.vehicle_files import read_vehicle
from tests.planners.world.strategies import seeds
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


def test_improving_looks_for_the_pose_that_was_aimed_at_too() -> None:
    asked = to_canonical(beside_a_wall(-0.1, CAR))[0]
    attempt = solve(asked, "lattice", limits=Limits(expansions=1))
    assert attempt.plan is None
    found = improved(attempt, asked, 2.0).plan
    assert found is not None
    assert faults(asked, found) == []


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


def test_every_way_to_end_without_a_plan_has_a_meaning() -> None:
    assert set(MEANINGS) == set(Status) - {Status.SOLVED}


TRAINS = {
    "car": CAR,
    "one trailer": CAR_1_TRAILER,
    "two trailers": CAR_2_TRAILERS,
    "forklift": read_vehicle(Path("docs/vehicles/forklift.yaml")),
    "create3": read_vehicle(Path("docs/vehicles/create3.yaml")),
}


@given(
    x=st.floats(18.0, 34.0),
    y=st.floats(18.0, 34.0),
    turned=st.floats(-math.pi, math.pi),
    gap=st.floats(0.3, 3.0),
    tolerance=st.floats(0.0, 0.4),
    train=st.sampled_from(list(TRAINS)),
    seed=seeds,
)
def test_who_is_said_to_have_no_room_is_in_an_obstacle_however_it_is_folded(
    x: float, y: float, turned: float, gap: float, tolerance: float, train: str, seed: int
) -> None:
    vehicle = TRAINS[train]
    walls = [box(25.0, 25.0 + sign * (1.5 + 0.5 * gap), 0.3, 6.0, 1.5) for sign in (-1.0, 1.0)]
    asked = replace(
        problem_of(walls),
        goal=(x, y),
        goal_radius=0.5 * tolerance,
        arrival=Arrival(turned, tolerance, 0.0, 0.0),
    )
    if not lacks_room(asked, vehicle, scene_of(asked)):
        return
    rng = generator(seed)
    states = np.zeros((200, state_size(vehicle)))
    angle, off = rng.uniform(0.0, math.tau, 200), asked.goal_radius * np.sqrt(rng.uniform(0.0, 1.0, 200))
    states[:, 0], states[:, 1] = x + off * np.cos(angle), y + off * np.sin(angle)
    states[:, 2] = turned + rng.uniform(-tolerance, tolerance, 200)
    for i, trailer in enumerate(trailers_of(vehicle)):
        states[:, 5 + i] = rng.uniform(-trailer.max_hitch, trailer.max_hitch, 200)
    obstacles = shapely.union_all([shapely.Polygon(wall) for wall in walls])
    parts, _ = outlines(states, vehicle)
    polygons = np.array([shapely.Polygon(part) for part in parts]).reshape(200, -1)
    bodies = shapely.union_all(polygons, axis=1)
    inside = shapely.covers(shapely.box(*asked.bounds), bodies)
    assert not (inside & ~shapely.intersects(bodies, obstacles)).any()


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize("train", ["car", "one trailer", "two trailers"])
def test_where_trailers_have_no_room_nothing_is_searched(train: str, planner: str) -> None:
    vehicle = TRAINS[train]
    behind = vehicle.rear + 0.5 if train != "car" else 0.0
    asked = replace(
        problem_of([box(25.0 - behind - 2.0, 25.0, 0.0, 2.0, 4.0)]),
        start=(40.0, 10.0, 0.0),
        goal=(25.0, 25.0),
        goal_radius=0.05,
        arrival=Arrival(0.0, 0.02, 0.0, 0.0),
    )
    outcome = plan(planner, to_canonical(asked)[0], generator(1), vehicle=vehicle)
    assert outcome.status is Status.GOAL_BLOCKED
    assert outcome.expansions == 0


def test_a_folded_trailer_may_have_room_where_the_angle_asked_for_has_not() -> None:
    post = box(23.1, 25.0, 0.0, 0.3, 0.3)
    asked = replace(
        problem_of([post]),
        goal=(25.0, 25.0),
        goal_radius=0.1,
        arrival=Arrival(0.0, 0.6, 0.0, 0.0, (0.0,), (0.6,)),
    )
    scene = scene_of(asked)
    assert with_free_goal(asked, CAR_1_TRAILER, scene) is asked  # no pose that is looked at is free
    assert not lacks_room(asked, CAR_1_TRAILER, scene)


def test_a_wall_through_a_body_of_several_parts_is_seen() -> None:
    forklift = TRAINS["forklift"]
    for x in (-0.5, 0.5):  # through its forks, and through its body
        asked = replace(
            problem_of([box(25.0 + x, 25.0, 0.0, 0.1, 6.0)]),
            goal=(25.0, 25.0),
            goal_radius=0.01,
            arrival=Arrival(0.0, 0.01, 0.0, 0.0),
        )
        assert lacks_room(asked, forklift, scene_of(asked))


def test_a_body_that_does_not_fill_its_box_may_have_room_beside_an_obstacle() -> None:
    wedge = (((-0.5, 0.0), (1.2, -0.4), (1.2, 0.4)),)
    behind = CAR_1_TRAILER.trailers[0]._replace(about=CAR_1_TRAILER.trailers[0].about._replace(outline=wedge))
    posts = [box(21.9, y, 0.0, 0.2, 0.2) for y in (24.7, 25.3)]
    asked = replace(
        problem_of(posts),
        goal=(24.0, 25.0),
        goal_radius=0.01,
        arrival=Arrival(0.0, 0.01, 0.0, 0.0, (0.0,), (0.01,)),
    )
    assert lacks_room(asked, CAR_1_TRAILER, scene_of(asked))
    assert not lacks_room(asked, CAR_1_TRAILER._replace(trailers=(behind,)), scene_of(asked))
