"""Aims at a pose that is free within what is tolerated, where the pose that is asked for is not.

Planners aim at the pose itself, and drive to it with a margin, so a goal a centimetre from a wall would be
out of their reach although they may end beside it.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Final

import numpy as np

from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene, count_free_prefix
from planners.world.problem import Problem
from planners.world.vehicles.dynamics import control_limits
from planners.world.vehicles.vehicle import Vehicle, state_size, trailers_of
from planners.world.view import View
from planners.world.workspace import Workspace

# shares of the tolerated distance by which poses beside are off, nearest first
OFF: Final = (0.25, 0.5, 0.75, 0.9)
BEARINGS: Final = 16  # of these poses
TURNED: Final = (0.0, 0.5, -0.5)  # shares of the tolerated angle by which they are turned


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


def has_free_goal(problem: Problem, vehicle: Vehicle, scene: Scene) -> bool:
    """Whether the goal pose of a problem is free, or the problem asks for none; arguments as before."""
    last = _last(problem, vehicle)
    return last is None or _is_free(last, vehicle, scene)


def _last(problem: Problem, vehicle: Vehicle) -> Floats | None:
    """The state ``[S]`` that is asked for at the end, as slow as may be; None if that is not one pose."""
    arrival = problem.arrival
    if arrival is None or arrival.heading is None or (trailers_of(vehicle) and not arrival.hitches):
        return None
    last = np.zeros(state_size(vehicle))
    last[:4] = *problem.goal, arrival.heading, min(max(0.0, arrival.least_speed), arrival.most_speed)
    last[5:] = arrival.hitches
    return last


def _is_free(state: Floats, vehicle: Vehicle, scene: Scene) -> bool:
    return bool(count_free_prefix(state[np.newaxis], vehicle, scene))
