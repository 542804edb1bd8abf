"""Says in one line why a problem makes no sense to a planner."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from planners.world.geometry.collision import CELL_M, REACH_M, count_free_prefix, point_is_free, scene_of
from planners.world.geometry.polygons import LARGEST_COORDINATE_M
from planners.world.problem import CANONICAL_DISTANCE, Problem, start_state
from planners.world.vehicles.vehicle import CAR, Vehicle

WIDEST_BOUNDS_M: Final = 1_000.0  # the cell lists of a scene grow with the area of the bounds
MOST_LISTED: Final = 4_000_000  # entries of these lists, 64 MB; a city map has some thousand


def problem_fault(problem: Problem, vehicle: Vehicle = CAR) -> str | None:
    """Return what is wrong with a problem and what to do about it, or None if it makes sense.

    The obstacles must be well formed. Checked are, in this order: the numbers are finite and not too large,
    the bounds, the goal radius, the distance from start to goal, and whether the footprint at the start (with
    trailers straight behind) and the goal's centre are free.
    """
    numbers = (*problem.start, *problem.goal, problem.goal_radius, *problem.bounds)
    if not all(math.isfinite(number) for number in numbers):
        return "start, goal, goal_radius and bounds must be finite numbers; correct them"
    if max(abs(number) for number in numbers) > LARGEST_COORDINATE_M:
        return (
            f"lies farther than {LARGEST_COORDINATE_M:.0f} m from the origin; move the origin near the start"
        )
    x_min, y_min, x_max, y_max = problem.bounds
    if not (x_min < x_max and y_min < y_max):
        return f"bounds {list(problem.bounds)} are inverted; expected [x_min, y_min, x_max, y_max] in metres"
    if max(x_max - x_min, y_max - y_min) > WIDEST_BOUNDS_M:
        return f"bounds {list(problem.bounds)} are wider than {WIDEST_BOUNDS_M:.0f} m; are they in metres?"
    if problem.goal_radius <= 0.0:
        return f"goal_radius is {problem.goal_radius}; expected a length above 0 m"
    distance = math.dist(problem.start[:2], problem.goal)
    if abs(distance - CANONICAL_DISTANCE) > problem.goal_radius:
        return (
            f"start and goal are {distance:.2f} m apart, expected {CANONICAL_DISTANCE:.2f} m within the "
            f"goal radius {problem.goal_radius:g} m; cut a longer route into local goals"
        )
    if _entries(problem) > MOST_LISTED:
        return "obstacles cover the bounds too many times over; leave out those that others cover"
    scene = scene_of(problem)
    if count_free_prefix(start_state(problem, vehicle)[np.newaxis], vehicle, scene) == 0:
        return f"start footprint at {_point(problem.start)} is not free or leaves the bounds; move the start"
    x, y = problem.goal
    if not point_is_free(x, y, scene):
        return f"goal centre {_point(problem.goal)} lies in an obstacle or out of bounds; move the goal"
    return None


def _entries(problem: Problem) -> float:
    """Estimate how many entries the cell lists of the problem's scene will have."""
    vertices, starts = problem.obstacles.vertices, problem.obstacles.piece_starts[:-1]
    if len(vertices) == 0:
        return 0.0
    low = np.maximum(np.minimum.reduceat(vertices, starts) - REACH_M, problem.bounds[:2])
    high = np.minimum(np.maximum.reduceat(vertices, starts) + REACH_M, problem.bounds[2:])
    return float((np.maximum(high - low, 0.0) / CELL_M + 1.0).prod(axis=1).sum())


def _point(coordinates: tuple[float, ...]) -> str:
    return f"({', '.join(f'{coordinate:g}' for coordinate in coordinates)})"
