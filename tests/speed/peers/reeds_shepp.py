"""OMPL's geometric planners over Reeds-Shepp curves, from its Python wheel. ImportError without it.

What comes of it is a path for a car that steers at once and stands wherever its curvature changes: no plan
by our definition, so only whether one was found, how soon and how long it is can be compared. Paths are
checked with our jitted collision check of the vehicle at rest, called from OMPL.
"""

from __future__ import annotations

import math
from time import thread_time
from typing import Any, NamedTuple

from ompl import base, geometric, util

from planners.world.geometry.collision import scene_of, state_is_free
from planners.world.jit import jit
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Car

_STEP_M = 0.05  # between two states of a path that are checked


class Path(NamedTuple):
    """One attempt."""

    solved: bool
    seconds: float  # of its processor
    metres: float | None


@jit
def _is_free(x: float, y: float, heading: float, vehicle: Car, scene: Any) -> bool:
    return state_is_free((x, y, heading, 0.0, 0.0), vehicle, scene)


def reeds_shepp_path(problem: Problem, vehicle: Car, planner: str, seed: int, limit_s: float) -> Path:
    """The first path of a ``planner`` of OMPL, such as ``RRTConnect``, to the goal pose of a problem."""
    assert problem.arrival is not None
    util.noOutputHandler()
    util.RNG.setSeed(seed)
    began = thread_time()
    scene = scene_of(problem)
    space = base.ReedsSheppStateSpace(vehicle.wheelbase / math.tan(vehicle.max_steering))
    bounds = base.RealVectorBounds(2)
    for i in range(2):
        bounds.setLow(i, problem.bounds[i])
        bounds.setHigh(i, problem.bounds[i + 2])
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    setup.setStateValidityChecker(
        lambda state: _is_free(state.getX(), state.getY(), state.getYaw(), vehicle, scene)
    )
    space.setLongestValidSegmentFraction(_STEP_M / space.getMaximumExtent())
    ends = []
    for x, y, heading in (problem.start, (*problem.goal, float(problem.arrival.heading or 0.0))):
        end = space.allocState()
        end.setX(x)
        end.setY(y)
        end.setYaw(math.remainder(heading, math.tau))
        ends.append(end)
    setup.setStartAndGoalStates(*ends)
    setup.setPlanner(getattr(geometric, planner)(setup.getSpaceInformation()))
    setup.solve(limit_s)
    seconds = thread_time() - began
    solved = setup.haveExactSolutionPath()
    metres = problem.scale * setup.getSolutionPath().length() if solved else None
    setup.clear()
    return Path(solved, seconds, metres)
