"""A problem in arrays is the problem that a file would hold, or is refused in one line."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from motion_memory.array_problems import problem_of_arrays
from planners.world.problem import BOUNDS, Arrival, Problem
from planners.world.vehicles.vehicle import CAR
from storage.exchange.problems import problem_of
from storage.vehicles.vehicle_files import said_vehicle
from tests.worlds import box

ROOT = Path(__file__).parents[2]
START, GOAL = (0.0, 0.0, 0.5), (40.0, 30.0)
CENTRES = st.tuples(st.floats(5.0, 35.0), st.floats(-4.0, -2.5))
OBSTACLES = st.lists(CENTRES, max_size=4).map(lambda centres: [box(x, y, 0.2, 1.0, 1.0) for x, y in centres])


def in_arrays(points: Any, starts: Any, **more: Any) -> Problem:
    asked = {"start": START, "goal": GOAL, "goal_radius": None, "bounds": BOUNDS, "scale": None}
    asked |= {"start_motion": (), "arrival": None, "vehicle": CAR}
    return problem_of_arrays(points=points, polygon_starts=starts, **asked | more)


def as_arrays(polygons: list[Any]) -> tuple[Any, Any]:
    return [corner for polygon in polygons for corner in polygon.tolist()], np.cumsum(
        [0, *map(len, polygons)]
    )


@given(OBSTACLES)
def test_arrays_hold_what_a_file_holds(polygons: list[Any]) -> None:
    fields = {"start": list(START), "goal": list(GOAL), "bounds": list(BOUNDS)}
    filed = problem_of(fields | {"obstacles": [polygon.tolist() for polygon in polygons]}, "problem")
    given = in_arrays(*as_arrays(polygons))
    for one, other in zip(filed.obstacles, given.obstacles, strict=True):
        assert np.array_equal(one, other)


@given(OBSTACLES, st.data())
def test_no_corner_is_left_out_in_silence(polygons: list[Any], data: st.DataObject) -> None:
    points, starts = as_arrays(polygons)
    other = data.draw(st.lists(st.integers(-2, len(points) + 2), max_size=len(starts) + 1))
    owned = [i for begin, end in pairwise(other) for i in range(begin, end)]
    assume(owned != list(range(len(points))))
    with pytest.raises(ValueError, match=f"polygon_starts .* end with {len(points)}") as caught:
        in_arrays(points, other)
    assert "\n" not in str(caught.value)


def test_empty_lists_are_no_obstacles() -> None:
    for points in ([], np.empty((0, 2)), ()):
        for starts in ([], [0], np.zeros(1, np.int32)):
            assert len(in_arrays(points, starts).obstacles.vertices) == 0


@pytest.mark.parametrize(
    ("points", "starts"),
    [
        ([[1, 2, 3]] * 4, [0, 4]),
        ([1, 2, 3, 4, 5, 6], [0, 3]),
        ([[1, 2], [3]], [0, 2]),
        (None, [0]),
        (box(20.0, -3.0, 0.2, 1.0, 1.0), [0.0, 4.0]),
        (box(20.0, -3.0, 0.2, 1.0, 1.0), [[0, 4], [4]]),
        (box(20.0, -3.0, 0.2, 1.0, 1.0), None),
    ],
)
def test_arrays_of_other_shapes_are_refused_in_one_line(points: Any, starts: Any) -> None:
    with pytest.raises(ValueError, match=r"^(points|polygon_starts) ") as caught:
        in_arrays(points, starts)
    assert "\n" not in str(caught.value)


@given(st.tuples(st.floats(20.0, 40.0), st.floats(20.0, 40.0), st.floats(-6.0, 6.0)))
def test_a_goal_of_three_numbers_is_the_pose_that_it_is_in_a_file(goal: tuple[float, float, float]) -> None:
    fields = {"start": list(START), "bounds": list(BOUNDS), "obstacles": []}
    for asked in (goal, goal[:2]):
        filed = problem_of(fields | {"goal": list(asked)}, "problem")
        for either in (asked, list(asked), np.array(asked)):
            arrays = in_arrays([], [], goal=either)
            assert (arrays.goal, arrays.goal_radius) == (filed.goal, filed.goal_radius)
            assert arrays.arrival == filed.arrival


def test_a_pose_is_asked_for_in_one_way() -> None:
    with pytest.raises(ValueError, match=r"goal .* is a pose at rest, and there is an arrival too"):
        in_arrays([], [], goal=(40.0, 30.0, 0.5), arrival=Arrival(0.5, 0.1))
    assert in_arrays([], [], goal=(40.0, 30.0, 0.5), goal_radius=0.3).goal_radius == 0.3


@pytest.mark.parametrize("name", ["start", "goal", "bounds"])
@pytest.mark.parametrize(
    "value", [None, 3.0, (), (1.0,), (1.0, "2", 3.0), np.zeros(5), np.zeros((3, 3)), [[1], [2, 3]]]
)
def test_other_numbers_than_are_expected_are_refused_in_one_line(name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=rf"^{name} is .*; expected ") as caught:
        in_arrays([], [], **{name: value})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("value", [0.5, None, "fast", [[1.0, 0.0]], ["fast"]])
def test_a_motion_that_is_no_list_of_numbers_is_refused_in_one_line(value: Any) -> None:
    with pytest.raises(ValueError, match="start_motion") as refused:
        in_arrays([], [], start_motion=value)
    assert "\n" not in str(refused.value)


def test_of_another_scale_than_the_vehicle_s_it_is_told_what_to_do_in_python() -> None:
    robot = said_vehicle(str(ROOT / "docs" / "vehicles" / "turtlebot.yaml"))
    with pytest.raises(ValueError, match=r"scale is 1, but .*leave the scale out.*in Python vehicle="):
        in_arrays([], [], scale=1.0, vehicle=robot)
