"""Whether a free plan that is at hand drives so long that it is worth looking for another.

The shortest path over the grid at full speed estimates how long the best plan drives, in some 15 µs. Where a
free plan takes hardly longer, the lattice finds no better one. Where it takes much longer, it mostly does.
"""

from __future__ import annotations

import math
from typing import Final

from planners.search.guides.grid_path import grid_metres
from planners.world.problem import Plan, Problem
from planners.world.vehicles.dynamics import control_limits
from planners.world.vehicles.vehicle import Vehicle
from planners.world.view import View

SECOND_LOOK: Final = 400  # expansions in search of a quicker plan than one at hand
# A plan that takes this many times as long is a detour for the planner (docs/planners.md). The planners that
# are not named drive longer than most free plans: for them none is.
DETOURS: Final = {"lattice": 1.03}
CLOSE: Final = 1.01  # nor is a plan that takes hardly longer than straight on from rest

# From any motion a plan is a detour that takes so many times as long as what ``seconds_for`` estimates.
_FROM_MOTION: Final = 1.5
_SLOW: Final = 0.56  # of the time that it takes to reach full speed first, this share is lost
_TURN_S: Final = 0.68  # time for each unit of 1 - cos of the angle to turn by


def seconds_for(metres: float, turn: float, speed: float, vehicle: Vehicle) -> float:
    """Estimate how long a good plan drives to a place.

    Half of the plans of the lattice take 5 % less or more than that, along the way that ``way_from`` finds.

    Args:
        metres: of the way.
        turn: 1 - cos of the angle to turn by before it goes straight ahead.
        speed: at the start, in m/s.
        vehicle: what is driven.
    """
    missing = vehicle.max_speed - speed
    slow_s = missing * missing / (2.0 * control_limits(vehicle)[0] * vehicle.max_speed)
    return float(metres / vehicle.max_speed + _SLOW * slow_s + _TURN_S * turn)


def is_long(takes_s: float, seconds: float) -> bool:
    """Whether a plan from any motion to a place takes much longer than what ``seconds_for`` estimates."""
    return takes_s > _FROM_MOTION * seconds


def is_detour_from_motion(plan: Plan, seconds: float, planner: str, problem: Problem) -> bool:
    """Whether a planner is expected to find a quicker plan than a free one, from any motion to a place.

    Args:
        plan: the free plan.
        seconds: what ``seconds_for`` estimates.
        planner: one of ``PLANNERS``.
        problem: that the plan solves.
    """
    return planner in DETOURS and problem.arrival is None and is_long(plan.duration_s, seconds)


def is_detour(plan: Plan, planner: str, view: View, vehicle: Vehicle) -> bool:
    """Whether a planner is expected to find a quicker plan than a free one.

    Args:
        plan: the free plan.
        planner: one of ``PLANNERS``.
        view: the problem that the plan solves.
        vehicle: what is driven.
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
