from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.world.checked_problem import FARTHEST_M, checked_problem
from planners.world.problem import Arrival, Problem
from tests.worlds import box

POINTS = np.concatenate([box(20.0, 21.0, 0.3, 2.0, 1.0), box(8.0, 14.0, 1.2, 1.5, 1.5)])
STARTS = np.array([0, 4, 8])

whole = st.integers(1_001, 5_000_000_000)
signs = st.sampled_from([-1.0, 1.0])


def asked(x: float, y: float) -> Problem:
    """A problem whose coordinates are multiples of a power of two, so that moving it rounds nothing."""
    grid = 2.0**-18
    points = grid * np.round(POINTS / grid) + (x, y)
    return checked_problem(
        (x, y, 0.5),
        (30.0 + x, 25.0 + y),
        0.5,
        (x - 10.0, y - 10.0, x + 40.0, y + 40.0),
        points,
        STARTS,
        arrival=Arrival(0.25, 0.1, 0.0, 0.0),
    )


@given(whole, whole, signs, signs)
def test_a_problem_far_away_is_the_same_problem_with_an_offset(
    x: int, y: int, left: float, down: float
) -> None:
    here, there = asked(0.0, 0.0), asked(left * x, down * y)
    assert there.offset == (left * x, down * y)
    assert here.offset == (0.0, 0.0)
    assert (there.start, there.goal, there.bounds) == (here.start, here.goal, here.bounds)
    assert (there.obstacles.vertices == here.obstacles.vertices).all()


def test_near_the_origin_nothing_is_moved() -> None:
    problem = asked(900.0, -900.0)
    assert problem.offset == (0.0, 0.0)
    assert problem.start == (900.0, -900.0, 0.5)


def test_beyond_what_float64_can_say_is_refused_in_one_line() -> None:
    with pytest.raises(ValueError, match="move the origin near the start") as caught:
        asked(2.0 * FARTHEST_M, 0.0)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("scale", [2.0**-6, 1.0])
def test_a_corner_that_overflows_is_refused_without_a_warning(scale: float) -> None:
    points = np.array([[1.0, 1.0], [1e308, 1.0], [1.0, 2.0]])
    with pytest.raises(ValueError) as caught:  # noqa: PT011 the words do not matter
        checked_problem((0, 0, 0), (5, 5), 1.0, (-9, -9, 9, 9), points, np.array([0, 3]), scale=scale)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0])
@given(k=st.floats(20.0, 1e4))
def test_of_a_problem_in_millimetres_the_bounds_are_told_not_the_origin(scale: float, k: float) -> None:
    large = k * scale
    goal, bounds = (30.0 * large, 25.0 * large), (-10.0 * large, -10.0 * large, 90.0 * large, 90.0 * large)
    with pytest.raises(ValueError, match=rf"^bounds .* than {1000.0 * scale:g} m; are they in metres\?$"):
        checked_problem((0.0, 0.0, 0.5), goal, 2.0, bounds, large * POINTS, STARTS, scale=scale)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"goal": (2e4, 0.0)}, "goal (20000, 0) lies more than 10000 m from the start"),
        ({"bounds": (2e4, 0.0, 2e4 + 50.0, 9.0)}, "lie more than 10000 m from the start; are they in its"),
        ({"goal_radius": 2e4}, "goal_radius is 20000; expected a length above 0 m, up to 10000 m"),
        ({"points": POINTS + 2e4}, "obstacle 1 reaches farther from the start than 10000 m times the scale"),
    ],
)
def test_what_lies_far_from_a_start_near_the_origin_is_named(wrong: dict[str, Any], told: str) -> None:
    sound = {"start": (0.0, 0.0, 0.5), "goal": (30.0, 25.0), "goal_radius": 2.0, "points": POINTS}
    sound |= {"bounds": (-10.0, -10.0, 60.0, 60.0), "polygon_starts": STARTS}
    with pytest.raises(ValueError) as caught:  # noqa: PT011 the line is compared below
        checked_problem(**sound | wrong)
    assert told in str(caught.value)
    assert "origin" not in str(caught.value)
