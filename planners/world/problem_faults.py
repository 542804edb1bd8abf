"""Says in one line why a problem makes no sense to a planner."""

from __future__ import annotations

from typing import Final

import numpy as np

from planners.world.arrays import Bounds, Floats, Integers, Point
from planners.world.frame_faults import frame_fault, point_outside
from planners.world.geometry.collision import (
    CELL_M,
    box_is_inside,
    box_meets_piece,
    make_edges,
    piece_extent,
)
from planners.world.jit import jit
from planners.world.problem import Arrival, Problem, start_state
from planners.world.vehicles.dynamics import lateral_acceleration, load, slides, swept_bodies, turn_limit
from planners.world.vehicles.reach import REACH_M
from planners.world.vehicles.vehicle import (
    CAR,
    Vehicle,
    in_short_steps,
    name_of,
    state_names,
    trailers_of,
)

MOST_LISTED: Final = 4_000_000  # entries of these lists, 64 MB; a city map has some thousand


def problem_fault(problem: Problem, vehicle: Vehicle = CAR, driving: bool = False) -> str | None:
    """Return what is wrong with a problem and what to do about it, or None if it makes sense.

    The obstacles must be well formed. Checked are, in this order: the numbers (``frame_fault``), how the
    drive begins and is to end, and whether the footprint at the start and the goal's centre are free. Lengths
    are told as they are outside, in real metres. Who is ``driving`` along a plan may start nearer to what it
    passes than a new plan may.
    """
    fault = (
        frame_fault(problem)
        or motion_fault(problem, vehicle)
        or arrival_fault(problem.arrival, problem.scale, vehicle)
    )
    if fault is not None:
        return fault
    entries, start_is_free, goal_is_free = _room(
        problem.obstacles.vertices,
        problem.obstacles.piece_starts,
        problem.bounds,
        start_state(problem, vehicle)[np.newaxis],
        problem.goal,
        in_short_steps(vehicle) if driving else vehicle,
    )
    if entries > MOST_LISTED:
        return "obstacles cover the bounds too many times over; leave out those that others cover"
    if not start_is_free:
        size = "" if problem.scale == 1.0 else f" (scale {problem.scale:g})"
        at = point_outside(problem, problem.start)
        return (
            f"start footprint of {name_of(vehicle)}{size} at {at} is not free or leaves the bounds; move the "
            "start, or name the vehicle that the problem is for"
        )
    if not goal_is_free:
        at = point_outside(problem, problem.goal)
        return f"goal centre {at} lies in an obstacle or out of bounds; move the goal"
    return None


def motion_fault(problem: Problem, vehicle: Vehicle) -> str | None:
    """Return what is wrong with the motion at the start, which the vehicle must be able to have, or None."""
    names = state_names(vehicle)[3:]
    if len(problem.start_motion) > len(names):
        return f"start has {len(problem.start_motion)} numbers of motion, expected {', '.join(names)}"
    for name, value in zip(names, problem.start_motion, strict=False):
        low, high = _limits(name, vehicle)
        if not low <= value <= high:
            unit = {"speed": "m/s", "turn_rate": "rad/s"}.get(name, "rad")
            size = problem.scale if name == "speed" else 1.0
            allowed = f"{size * low:g} to {size * high:g}"
            return f"start {name} is {size * value:g} {unit}; the vehicle allows {allowed}"
    slid, lateral = _sliding(start_state(problem, vehicle)[np.newaxis], vehicle)
    if slid:
        most = problem.scale * vehicle.max_lateral_acceleration
        return (
            f"start motion needs {problem.scale * lateral:g} m/s^2 sideways; the vehicle's "
            f"lateral_acceleration is {most:g}; start more slowly, or straighter"
        )
    return None


@jit
def _sliding(start: Floats, vehicle: Vehicle) -> tuple[bool, float]:
    """Whether ``start [1, S]`` slides, and its lateral acceleration (m/s^2) without its sign."""
    state = load(start, 0, vehicle)
    return slides(state, vehicle), abs(lateral_acceleration(state, vehicle)[0])


def arrival_fault(arrival: Arrival | None, scale: float, vehicle: Vehicle) -> str | None:
    """What is wrong with what is asked of a ``vehicle`` at the goal, as a clause; None if nothing is.

    Real metres are ``scale`` times those of the ``arrival``.
    """
    if arrival is None:
        return None
    if arrival.heading is not None and not arrival.heading_tolerance > 0.0:
        return (
            f"goal_tolerance (of an Arrival: heading_tolerance) is {arrival.heading_tolerance:g} rad; "
            "expected an angle above 0"
        )
    asked = f"goal_speed [{scale * arrival.least_speed:g}, {scale * arrival.most_speed:g}]"
    if not arrival.least_speed <= arrival.most_speed:
        return f"{asked} is inverted; expected the least and the most m/s"
    low, high = _limits("speed", vehicle)
    if arrival.least_speed > high or arrival.most_speed < low:
        return f"{asked} is beyond the vehicle, which drives {scale * low:g} to {scale * high:g} m/s"
    trailers = len(trailers_of(vehicle))
    angles, tolerances = len(arrival.hitches), len(arrival.hitch_tolerances)
    if (angles, tolerances) not in ((0, 0), (trailers, trailers)):
        wanted = f"{trailers} of each, or none" if trailers else "none, as there are no trailers"
        return f"goal_hitch has {angles} angles and {tolerances} tolerances; expected {wanted}"
    asked_hitches = zip(arrival.hitches, arrival.hitch_tolerances, strict=True)
    for (hitch, allowed), trailer in zip(asked_hitches, trailers_of(vehicle), strict=bool(arrival.hitches)):
        most = trailer.max_hitch
        if not (abs(hitch) <= most and allowed > 0.0):
            return (
                f"goal hitch is {hitch:g} within {allowed:g} rad; expected up to {most:g}, within more than 0"
            )
    return None


def _limits(name: str, vehicle: Vehicle) -> tuple[float, float]:
    """The least and the greatest value of a variable of the vehicle's state."""
    if name == "speed":
        return vehicle.min_speed, vehicle.max_speed
    if name.startswith("hitch_"):
        most = trailers_of(vehicle)[int(name.removeprefix("hitch_")) - 1].max_hitch
        return -most, most
    most = turn_limit(vehicle)
    return -most, most


@jit
def _room(
    vertices: Floats, piece_starts: Integers, bounds: Bounds, start: Floats, goal: Point, vehicle: Vehicle
) -> tuple[float, bool, bool]:
    """How many entries the cell lists of a problem's scene will have, and whether both its ends are free.

    The answers are those of its scene, which would take far longer to build. ``start [1, S]`` is the first
    state, with nothing folded.
    """
    entries = 0.0
    goal_box = (goal[0], goal[1], 1.0, 0.0, 0.0, 0.0)
    goal_is_free = box_is_inside(goal_box, bounds)
    start_is_free = True
    for box in swept_bodies(load(start, 0, vehicle), vehicle):
        start_is_free &= box_is_inside(box, bounds)
    edges = np.empty((vertices.shape[0], 5))
    for p in range(piece_starts.shape[0] - 1):
        first = piece_starts[p]
        last = piece_starts[p + 1]
        x_min, y_min, x_max, y_max = piece_extent(vertices, first, last)
        x_min -= REACH_M
        y_min -= REACH_M
        x_max += REACH_M
        y_max += REACH_M
        across = max(min(x_max, bounds[2]) - max(x_min, bounds[0]), 0.0)
        along = max(min(y_max, bounds[3]) - max(y_min, bounds[1]), 0.0)
        entries += (across / CELL_M + 1.0) * (along / CELL_M + 1.0)
        made = False
        for box in swept_bodies(load(start, 0, vehicle), vehicle):
            if x_min <= box[0] <= x_max and y_min <= box[1] <= y_max:
                if not made:
                    make_edges(vertices, first, last, edges, 0)
                    made = True
                start_is_free &= not box_meets_piece(box, 0, last - first, edges)
        if x_min <= goal[0] <= x_max and y_min <= goal[1] <= y_max:
            if not made:
                make_edges(vertices, first, last, edges, 0)
            goal_is_free &= not box_meets_piece(goal_box, 0, last - first, edges)
    return entries, start_is_free, goal_is_free
