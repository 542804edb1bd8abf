"""Whether a problem makes sense to a planner, said in one line where it does not."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from planners.world.geometry.collision import CELL_M, REACH_M, box_is_free, count_free_prefix, scene_of
from planners.world.geometry.polygons import LARGEST_COORDINATE_M
from planners.world.problem import CANONICAL_DISTANCE, Problem, start_state
from planners.world.vehicles.vehicle import CAR, Vehicle

WIDEST_BOUNDS_M: Final = 1_000.0  # the cell look-up of collision checks grows with the bounds' area
MOST_LISTED: Final = 4_000_000  # pieces in cells of that look-up, 64 MB; city maps have some thousand


def problem_fault(problem: Problem, vehicle: Vehicle = CAR) -> str | None:
    """What is wrong with a problem whose obstacles are well formed and what to do, or None.

    In this order: numbers finite and near, bounds, goal radius, distance, start footprint (trailers straight
    behind), goal centre.
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
        return (
            f"bounds {list(problem.bounds)} are inverted; wanted was [x_min, y_min, x_max, y_max] in metres"
        )
    if max(x_max - x_min, y_max - y_min) > WIDEST_BOUNDS_M:
        return f"bounds {list(problem.bounds)} are wider than {WIDEST_BOUNDS_M:.0f} m; are they in metres?"
    if problem.goal_radius <= 0.0:
        return f"goal_radius is {problem.goal_radius}; wanted was a length above 0 m"
    distance = math.dist(problem.start[:2], problem.goal)
    if abs(distance - CANONICAL_DISTANCE) > problem.goal_radius:
        return (
            f"start and goal are {distance:.2f} m apart, wanted was {CANONICAL_DISTANCE:.2f} m within the "
            f"goal radius {problem.goal_radius:g} m; cut a longer route into local goals"
        )
    if _listed(problem) > MOST_LISTED:
        return "obstacles cover the bounds too many times over; leave out those that others cover"
    scene = scene_of(problem)
    if count_free_prefix(start_state(problem, vehicle)[np.newaxis], vehicle, scene) == 0:
        return f"start footprint at {_place(problem.start)} is not free or leaves the bounds; move the start"
    x, y = problem.goal
    if not box_is_free(x, y, 1.0, 0.0, 0.0, 0.0, scene):
        return f"goal centre {_place(problem.goal)} lies in an obstacle or out of bounds; move the goal"
    return None


def _listed(problem: Problem) -> float:
    """In about how many cells of the look-up pieces will be listed, all together."""
    vertices, starts = problem.obstacles.vertices, problem.obstacles.piece_starts[:-1]
    if len(vertices) == 0:
        return 0.0
    low = np.maximum(np.minimum.reduceat(vertices, starts) - REACH_M, problem.bounds[:2])
    high = np.minimum(np.maximum.reduceat(vertices, starts) + REACH_M, problem.bounds[2:])
    return float((np.maximum(high - low, 0.0) / CELL_M + 1.0).prod(axis=1).sum())


def _place(coordinates: tuple[float, ...]) -> str:
    return f"({', '.join(f'{coordinate:g}' for coordinate in coordinates)})"
