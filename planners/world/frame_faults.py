"""Says in one line why the numbers of a problem make no sense, whatever its obstacles and its vehicle."""

from __future__ import annotations

import math
from typing import Final

from planners.world.arrays import Point
from planners.world.geometry.polygons import LARGEST_COORDINATE_M
from planners.world.problem import Problem

WIDEST_BOUNDS_M: Final = 1_000.0  # the cell lists of a scene grow with the area of the bounds
LARGEST_HEADING: Final = 10_000.0  # radians; of more turns the last digits are lost


def frame_fault(problem: Problem) -> str | None:
    """Return what is wrong with the numbers of a problem, told in real metres, or None.

    Args:
        problem: only its start, goal, goal radius and bounds are looked at. A start far from the origin has
            been moved there (``checked_problem``) unless it lies too far away for that.
    """
    scale = problem.scale
    heading = None if problem.arrival is None else problem.arrival.heading
    headings = {"start": problem.start[2], "goal": heading or 0.0}
    numbers = (*problem.start[:2], *problem.goal, problem.goal_radius, *problem.bounds)
    if not all(math.isfinite(number) for number in (*numbers, *headings.values())):
        return "start, goal, goal_radius and bounds must be finite numbers; correct them"
    for end, angle in headings.items():
        if abs(angle) > LARGEST_HEADING:
            return f"{end} heading is {angle:g} rad; expected an angle of -pi to pi, turns may be added"
    if _is_far(problem.start[:2]):
        told = point_outside(problem, problem.start)
        return f"start {told} lies too far from the origin; move the origin near the start"
    x_min, y_min, x_max, y_max = problem.bounds
    told = str(bounds_outside(problem))
    if not (x_min < x_max and y_min < y_max):
        return f"bounds {told} are inverted; expected [x_min, y_min, x_max, y_max] in metres"
    if max(x_max - x_min, y_max - y_min) > WIDEST_BOUNDS_M:
        return f"bounds {told} are wider or higher than {scale * WIDEST_BOUNDS_M:g} m; are they in metres?"
    most = f"{scale * LARGEST_COORDINATE_M:g} m"
    if _is_far(problem.bounds):
        return f"bounds {told} lie more than {most} from the start; are they in its frame?"
    if _is_far(problem.goal):
        return f"goal {point_outside(problem, problem.goal)} lies more than {most} from the start; move it"
    if not 0.0 < problem.goal_radius <= LARGEST_COORDINATE_M:
        name = "goal_radius" if heading is None else "goal_tolerance"
        return f"{name} is {scale * problem.goal_radius:g}; expected a length above 0 m, up to {most}"
    return None


def outside(problem: Problem, x: float, y: float) -> Point:
    """A point of the problem in real metres, where the problem comes from."""
    return problem.scale * x + problem.offset[0], problem.scale * y + problem.offset[1]


def bounds_outside(problem: Problem) -> list[float]:
    """The bounds in real metres, where the problem comes from."""
    x_min, y_min, x_max, y_max = problem.bounds
    return [*outside(problem, x_min, y_min), *outside(problem, x_max, y_max)]


def point_outside(problem: Problem, place: tuple[float, ...]) -> str:
    """A place in words: x, y in real metres, and the heading if it has one."""
    told = (*outside(problem, *place[:2]), *place[2:])
    return f"({', '.join(f'{coordinate:.10g}' for coordinate in told)})"


def _is_far(coordinates: tuple[float, ...]) -> bool:
    return max(abs(coordinate) for coordinate in coordinates) > LARGEST_COORDINATE_M
