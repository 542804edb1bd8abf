"""Makes a checked problem of a caller's own arrays, which may be anything."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from planners.world.arrays import Bounds, Floats, Indices, Integers, Point, Pose
from planners.world.checked_problem import checked_problem
from planners.world.problem import Arrival, Problem
from planners.world.vehicles.vehicle import Vehicle
from storage.exchange.question_fields import Goal, goal_of, numbers_of
from storage.fields import short
from storage.vehicles.vehicle_files import scale_for_vehicle


def problem_of_arrays(
    start: Pose,
    goal: Point | Pose,
    points: Floats,
    polygon_starts: Indices | Integers,
    goal_radius: float | None,
    bounds: Bounds,
    scale: float | None,
    start_motion: tuple[float, ...],
    arrival: Arrival | None,
    vehicle: Vehicle,
    driving: bool = False,
) -> Problem:
    """Make a problem of what ``Memory.plan_arrays`` is given.

    Args:
        start: x, y in metres, heading in radians.
        goal: x, y in metres: a place; or x, y, heading: a pose at rest.
        points: ``[m, 2]`` metres: the corners of all obstacles, one after another.
        polygon_starts: ``[n + 1]``: where each obstacle begins in ``points``, and at last ``m``.
        goal_radius: metres: how far from the goal a plan may end; None: the usual, as in files.
        bounds: x_min, y_min, x_max, y_max in metres.
        scale: metres of these lengths in one metre of the memory's problems; None: that of the vehicle.
        start_motion: the entries of the start state after the pose.
        arrival: what the goal asks for besides the place.
        vehicle: the vehicle that drives.
        driving: whether it drives along a plan: as of ``problem_fault``.

    Raises:
        ValueError: an array has another shape, the goal is a pose and there is an arrival too, or the problem
            is impossible.
    """
    x, y, heading = numbers_given("start", start, "x, y, heading")
    x_min, y_min, x_max, y_max = numbers_given("bounds", bounds, "x_min, y_min, x_max, y_max")
    asked = _goal(goal, goal_radius, arrival)
    corners = _points(points)
    return checked_problem(
        (x, y, heading),
        *(asked.place, asked.radius, (x_min, y_min, x_max, y_max)),
        *(corners, _starts(polygon_starts, len(corners))),
        vehicle=vehicle,
        scale=scale_for_vehicle(scale, vehicle),
        start_motion=motion_given("start_motion", start_motion),
        arrival=asked.arrival,
        driving=driving,
    )


def numbers_given(name: str, given: Sequence[float], *meanings: str) -> list[float]:
    """The numbers that a caller gave, as many as one of the ``meanings`` lists, such as "x, y".

    Raises ValueError if there are more or fewer, or something else is given.
    """
    for meaning in meanings:
        with suppress(ValueError):
            return numbers_of({name: np.asarray(given).tolist()}, name, meaning.count(",") + 1)
    raise ValueError(f"{name} is {short(given)}; expected {' or '.join(meanings)}")


def motion_given(
    name: str, given: Sequence[float] | str, meaning: str = "speed, steering or turn rate, hitch angles"
) -> tuple[float, ...]:
    """As many numbers of motion as a caller gave. Raises ValueError if it is no list of numbers."""
    try:
        if isinstance(given, str):
            raise TypeError
        return tuple(float(number) for number in given)
    except (TypeError, ValueError):
        raise ValueError(f"{name} is {short(given)}; expected a list of numbers: {meaning}") from None


def _goal(given: Point | Pose, radius: float | None, arrival: Arrival | None) -> Goal:
    """What is asked at the goal: of three numbers what a file with them asks, a pose at rest.

    Raises ValueError if there are fewer or more, or three and an ``arrival``.
    """
    numbers = numbers_given("goal", given, "x, y", "x, y, heading")
    usual = goal_of({"goal": numbers})
    if len(numbers) == 3 and arrival is not None:
        raise ValueError(
            f"goal {short(numbers)} is a pose at rest, and there is an arrival too; give a goal of x, y, and "
            "the heading in the arrival"
        )
    return Goal(usual.place, usual.radius if radius is None else radius, arrival or usual.arrival)


def _points(given: Floats | Sequence[Sequence[float]]) -> Floats:
    """The corners ``[m, 2]``; of an empty list none. Raises ValueError if they have another shape."""
    try:
        points = np.asarray(given, np.float64)
    except (TypeError, ValueError):
        raise ValueError("points must be an array [m, 2] of numbers in metres; correct it") from None
    if points.size == 0:
        return np.empty((0, 2))
    if points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(f"points has the shape {list(points.shape)}; expected [m, 2], x and y in metres")
    return points


def _starts(given: Indices | Integers | Sequence[int], count: int) -> Indices:
    """Where obstacles begin and end among ``count`` corners; of an empty list none do.

    Raises ValueError unless the first begins with the first corner, the last ends with the last one, and none
    ends before it begins.
    """
    try:
        starts = np.asarray(given)
    except ValueError:  # lists of different lengths
        starts = np.empty(0)
    if starts.size == 0 and count == 0:
        return np.zeros(1, np.int64)
    if (
        starts.ndim != 1
        or not np.issubdtype(starts.dtype, np.integer)
        or starts[0] != 0
        or starts[-1] != count
        or (starts[1:] < starts[:-1]).any()
    ):
        raise ValueError(
            f"polygon_starts {short(starts.tolist())} must be whole numbers that begin with 0, do not "
            f"decrease and end with {count}, the number of points"
        )
    return starts.astype(np.int64, copy=False)
