"""Makes a problem of polygons of any kind, ready for planners and checked."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from planners.world.arrays import Bounds, Floats, Indices, Integers, Point, Pose
from planners.world.frame_faults import frame_fault
from planners.world.geometry.polygons import cut_polygons
from planners.world.problem import Arrival, Problem, obstacles_of
from planners.world.problem_faults import problem_fault
from planners.world.vehicles.vehicle import CAR, Vehicle

NO_OBSTACLES: Final = obstacles_of([])
FAR_M: Final = 1_000.0  # from here on frames are moved to the start: obstacles are kept in float32
FARTHEST_M: Final = 1e10  # up to here float64 is exact to a micrometre, as plans are


def checked_problem(
    start: Pose,
    goal: Point,
    goal_radius: float,
    bounds: Bounds,
    points: Floats,
    polygon_starts: Indices | Integers,
    *,
    vehicle: Vehicle = CAR,
    problem_id: str = "problem",
    class_name: str = "unknown",
    scale: float = 1.0,
    groups: list[int] | None = None,
    start_motion: tuple[float, ...] = (),
    arrival: Arrival | None = None,
    driving: bool = False,
) -> Problem:
    """Make a problem in any frame, with obstacles of polygons that lie end to end in one array.

    If the start lies far from the origin, whole metres are taken off all coordinates before anything is
    rounded; the problem's ``offset`` says how many.

    Args:
        start: x, y in metres, heading in radians.
        goal: x, y in metres.
        goal_radius: metres: how far from the goal a drive may end.
        bounds: x_min, y_min, x_max, y_max in metres.
        points: ``[m, 2]`` metres, the corners of all polygons, each in any orientation.
        polygon_starts: ``[n + 1]`` polygon i owns ``points[polygon_starts[i] : polygon_starts[i + 1]]``.
        vehicle: what has to have room at the start.
        problem_id: the id of the problem.
        class_name: the class that it belongs to.
        scale: metres of the lengths here in one metre of the problem.
        groups: how many polygons belong to each obstacle; by default one.
        start_motion: speed (m/s) at the start, then what else the vehicle's state has, such as the steering
            angle and the hitch angles; what is missing is 0.
        arrival: what is asked at the goal besides the place.
        driving: whether the vehicle drives along a plan: as of ``problem_fault``.

    Raises:
        ValueError: A polygon is none, or the problem makes no sense (``problem_fault``).
    """
    if FAR_M < max(abs(start[0]), abs(start[1])) <= FARTHEST_M:
        x, y = offset = (float(round(start[0])), float(round(start[1])))
        start, goal = (start[0] - x, start[1] - y, start[2]), (goal[0] - x, goal[1] - y)
        bounds = (bounds[0] - x, bounds[1] - y, bounds[2] - x, bounds[3] - y)
        points = points - offset
    else:
        offset = (0.0, 0.0)
    problem = Problem(
        problem_id,
        class_name,
        (start[0] / scale, start[1] / scale, start[2]),
        (goal[0] / scale, goal[1] / scale),
        goal_radius / scale,
        (bounds[0] / scale, bounds[1] / scale, bounds[2] / scale, bounds[3] / scale),
        NO_OBSTACLES,
        scale,
        (start_motion[0] / scale, *start_motion[1:]) if start_motion else (),
        arrival
        and arrival._replace(least_speed=arrival.least_speed / scale, most_speed=arrival.most_speed / scale),
        offset,
    )
    fault = frame_fault(problem)  # else obstacles in other units would be blamed first
    if fault is not None:
        raise ValueError(fault)
    with np.errstate(over="ignore"):  # what becomes infinite is refused with its polygon
        scaled = points if scale == 1.0 else points / scale
    obstacles = cut_polygons(scaled, polygon_starts)
    if groups is not None:
        ends = np.cumsum([0, *groups])
        obstacles = obstacles._replace(obstacle_starts=obstacles.obstacle_starts[ends])
    problem = replace(problem, obstacles=obstacles)
    fault = problem_fault(problem, vehicle, driving)
    if fault is not None:
        raise ValueError(fault)
    return problem
