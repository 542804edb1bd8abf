"""Whether a free plan that is at hand drives so long that it is worth looking for another.

The shortest path over the grid at full speed estimates how long the best plan drives, in some 15 µs. Where a
free plan takes hardly longer, the lattice finds no better one. Where it takes much longer, it mostly does.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from planners.search.guides.grid_path import grid_metres
from planners.world.arrays import Floats
from planners.world.problem import Plan, Problem
from planners.world.vehicles.dynamics import control_limits
from planners.world.vehicles.vehicle import Vehicle
from planners.world.view import View

SECOND_LOOK: Final = 400  # expansions in search of a quicker plan than one at hand
# A plan that takes this many times as long is a detour for the planner (docs/planners.md). The planners that
# are not named drive longer than most free plans: for them none is.
DETOURS: Final = {"lattice": 1.03}
CLOSE: Final = 1.01  # nor is a plan that takes hardly longer than straight on from rest


_FROM_MOTION: Final = 1.05  # the same where a drive begins in any direction, at any speed
_TURN_S: Final = (
    1.5  # time for each unit of 1 - cos of the angle to turn by, before the way goes straight ahead
)
_BEGINNING: Final = 8  # points of a way, which tell its direction


def seconds_along(way: Floats, start: Floats, vehicle: Vehicle) -> float:
    """Estimate how long a good plan drives from any motion along a way, to any motion at its end.

    Args:
        way: ``[M, 2]`` metres, the shortest one over the grid.
        start: ``[S]`` the state to begin with.
        vehicle: who drives.

    Returns:
        Seconds; infinite if the way has less than two points.
    """
    if len(way) < 2:
        return math.inf
    x, y = way[min(_BEGINNING, len(way) - 1)] - start[:2]
    turn = 1.0 - math.cos(math.atan2(y, x) - start[2])
    missing = vehicle.max_speed - start[3]
    slow_s = missing * missing / (2.0 * control_limits(vehicle)[0] * vehicle.max_speed)
    metres = float(np.hypot(*np.diff(way, axis=0).T).sum())
    return float(metres / vehicle.max_speed + slow_s + _TURN_S * turn)


def is_detour_from_motion(plan: Plan, seconds: float, planner: str, problem: Problem) -> bool:
    """Whether a planner is expected to find a quicker plan than a free one, from any motion to a place.

    Args:
        plan: the free plan.
        seconds: what ``seconds_along`` estimates.
        planner: one of ``PLANNERS``.
        problem: that the plan solves.
    """
    return planner in DETOURS and problem.arrival is None and plan.duration_s > _FROM_MOTION * seconds


def is_detour(plan: Plan, planner: str, view: View, vehicle: Vehicle) -> bool:
    """Whether a planner is expected to find a quicker plan than a free one.

    Args:
        plan: the free plan.
        planner: one of ``PLANNERS``.
        view: the problem that the plan solves.
        vehicle: who drives.
    """
    if planner not in DETOURS:
        return False
    problem = view.problem
    straight_m = math.dist(problem.start[:2], problem.goal) - problem.goal_radius
    fastest_s = straight_m / vehicle.max_speed + vehicle.max_speed / (2.0 * control_limits(vehicle)[0])
    if plan.duration_s <= CLOSE * fastest_s:
        return False
    metres = grid_metres(view.bits, problem.start[:2], problem.goal, problem.goal_radius, view.workspace)
    view.lap("guide")
    return plan.duration_s > DETOURS[planner] * metres / vehicle.max_speed
