"""Aims at a pose that is free within what is tolerated, where the pose that is asked for is not.

Planners aim at the pose itself, and drive to it with a margin, so a goal a centimetre from a wall would be
out of their reach although they may end beside it. Where no pose that is tolerated has room, there is
nothing to search for.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Final

import numpy as np

from planners.world.arrays import Flags, Floats
from planners.world.geometry.collision import Scene, count_free_prefix, note_free
from planners.world.problem import Problem, counter_clockwise
from planners.world.vehicles.dynamics import control_limits
from planners.world.vehicles.vehicle import FIRST_HITCH, Trailer, Vehicle, state_size, trailers_of
from planners.world.view import View
from planners.world.workspace import Workspace

# shares of the tolerated distance by which poses beside are off, nearest first
OFF: Final = (0.25, 0.5, 0.75, 0.9)
BEARINGS: Final = 16  # of these poses
TURNED: Final = (0.0, 0.5, -0.5)  # shares of the tolerated angle by which they are turned
STEP: Final = math.radians(1.0)  # between angles at which bodies are looked at for a proof
SLACK_M: Final = 1e-6  # for roundings
MOST_LOOKS: Final = 100_000  # at a body, some 15 ms; what would need more is no proof


def with_free_goal(problem: Problem, vehicle: Vehicle, scene: Scene) -> Problem:
    """Move the goal pose of a problem to a free one if it is not free itself, with what is then tolerated.

    Args:
        problem: that asks for a pose; others, and those with trailers whose angles are free, stay.
        vehicle: what is driven.
        scene: ``scene_of(problem)``.

    Returns:
        A problem whose plans are plans for the given one; the given one if its pose is free, or none is near.
    """
    arrival, last = problem.arrival, _last(problem, vehicle)
    if arrival is None or last is None or _is_free(last, vehicle, scene):
        return problem
    a_step = np.zeros(len(last))  # as fast as the vehicle is a step before it stands
    a_step[3] = min(control_limits(vehicle)[0] * vehicle.dt, 0.5 * vehicle.max_speed)
    beside = last.copy()
    for before in (a_step, 0.0 * a_step):
        for off, turned, bearing in itertools.product(OFF, TURNED, range(BEARINGS)):
            angle = last[2] + math.tau * bearing / BEARINGS
            beside[0] = last[0] + off * problem.goal_radius * math.cos(angle)
            beside[1] = last[1] + off * problem.goal_radius * math.sin(angle)
            beside[2] = last[2] + turned * arrival.heading_tolerance
            if _is_free(beside, vehicle, scene) and _is_free(beside + before, vehicle, scene):
                left = (1.0 - abs(turned)) * arrival.heading_tolerance
                return replace(
                    problem,
                    goal=(float(beside[0]), float(beside[1])),
                    goal_radius=(1.0 - off) * problem.goal_radius,
                    arrival=arrival._replace(heading=float(beside[2]), heading_tolerance=left),
                )
    return problem


def aimed_view(problem: Problem, vehicle: Vehicle, workspace: Workspace | None = None) -> View:
    """A problem as an attempt sees it: with a free goal pose, if there is one."""
    view = View(problem, workspace)
    if problem.arrival is not None:  # others do not need the scene for it
        view.problem = with_free_goal(problem, vehicle, view.scene)
    return view


def lacks_room(problem: Problem, vehicle: Vehicle, scene: Scene) -> bool:
    """Whether it is certain that the vehicle has no room in any pose that is tolerated, however it is folded.

    Boxes inside of the bodies are looked at in steps of an angle, each smaller on all sides by as much as it
    may stand elsewhere than where it is looked at.

    Args:
        problem: in any frame; of one that asks for no heading nothing is certain.
        vehicle: what is driven.
        scene: ``scene_of(problem)``.
    """
    arrival, straight = problem.arrival, unfolded(problem, vehicle)
    if arrival is None or arrival.heading is None or straight is None:
        return False
    if _is_free(straight, vehicle, scene):
        return False
    trailers = trailers_of(vehicle)
    hitches = arrival.hitches or (0.0,) * len(trailers)
    free = arrival.hitch_tolerances or tuple(trailer.max_hitch for trailer in trailers)
    headings = _angles(arrival.heading, arrival.heading_tolerance)
    poses = np.column_stack((np.tile(problem.goal, (len(headings), 1)), headings))
    elsewhere, turned = problem.goal_radius + SLACK_M, 0.5 * STEP  # by how much an axle may be off
    poses = poses[_may_stand(poses, vehicle, elsewhere, turned, scene)]
    for trailer, hitch, tolerance in zip(trailers, hitches, free, strict=True):
        angles = _angles(hitch, tolerance)
        if len(poses) * len(angles) > MOST_LOOKS:
            return False
        headings = (poses[:, 2:] - angles).ravel()
        back = trailer.hitch_length * np.column_stack((np.cos(headings), np.sin(headings)))
        poses = np.column_stack((np.repeat(poses[:, :2], len(angles), axis=0) - back, headings))
        turned += 0.5 * STEP
        elsewhere += trailer.hitch_length * turned
        poses = poses[_may_stand(poses, trailer, elsewhere, turned, scene)]
    return len(poses) == 0


def _angles(middle: float, tolerance: float) -> Floats:
    """Angles of which one lies within half a ``STEP`` of any that is tolerated, at most a turn."""
    tolerance = min(tolerance, math.pi)
    return middle + np.linspace(-tolerance, tolerance, 2 * math.ceil(tolerance / STEP) + 1)


def _may_stand(
    poses: Floats, body: Vehicle | Trailer, elsewhere: float, turned: float, scene: Scene
) -> Flags:
    """Whether a body may be free that stands as much elsewhere (m), and turned (rad), as given; ``[n]``."""
    may = np.ones(len(poses), bool)
    x, y, headings = poses.T
    cos, sin = np.cos(headings), np.sin(headings)
    for ahead, aside, half_length, half_width in _inner_boxes(body):
        reach = math.hypot(abs(ahead) + half_length, abs(aside) + half_width)
        halves = np.array([half_length, half_width]) - (elsewhere + turned * reach)
        if halves.min() <= 0.0:
            continue
        middles = x + ahead * cos - aside * sin, y + ahead * sin + aside * cos
        free = np.empty(len(poses), bool)
        note_free(np.column_stack((*middles, cos, sin, np.tile(halves, (len(poses), 1)))), scene, free)
        may &= free
    return may


def _inner_boxes(body: Vehicle | Trailer) -> list[tuple[float, float, float, float]]:
    """Boxes inside of a body: middle ahead of the reference point and aside, half length, half width (m).

    They are its own box, or one in each part of its outline, as long for its width as the part.
    """
    if not body.about.outline:
        return [
            (0.5 * (body.front - body.rear), 0.0, 0.5 * (body.front + body.rear), 0.5 * body.width),
        ]
    boxes = []
    for part in body.about.outline:
        corners = counter_clockwise(np.array(part))
        middle, halves = corners.mean(axis=0), 0.5 * np.ptp(corners, axis=0)
        along = np.roll(corners, -1, axis=0) - corners
        outwards = np.column_stack((along[:, 1], -along[:, 0]))
        gaps = ((corners - middle) * outwards).sum(axis=1)
        share = float((gaps / (np.abs(outwards) @ halves)).min())
        boxes.append((*middle.tolist(), *(share * halves).tolist()))
    return boxes


def _last(problem: Problem, vehicle: Vehicle) -> Floats | None:
    """The state ``[S]`` that is asked for at the end, as slow as may be; None if that is not one pose."""
    arrival = problem.arrival
    if arrival is not None and trailers_of(vehicle) and not arrival.hitches:
        return None
    return unfolded(problem, vehicle)


def unfolded(problem: Problem, vehicle: Vehicle) -> Floats | None:
    """The state ``[S]`` in a goal pose, trailers straight if their angles are free; None if it is a place."""
    arrival = problem.arrival
    if arrival is None or arrival.heading is None:
        return None
    last = np.zeros(state_size(vehicle))
    last[:4] = *problem.goal, arrival.heading, min(max(0.0, arrival.least_speed), arrival.most_speed)
    last[FIRST_HITCH : FIRST_HITCH + len(arrival.hitches)] = arrival.hitches
    return last


def _is_free(state: Floats, vehicle: Vehicle, scene: Scene) -> bool:
    return bool(count_free_prefix(state[np.newaxis], vehicle, scene))
