"""OMPL's geometric planners over Reeds-Shepp curves, from its Python wheel. ImportError without it.

What comes of it is a path for a car that steers at once. It is driven over its curves from rest to rest and
polished as our plans are, which counts. Paths are checked with our jitted collision check, called from OMPL
by way of Python, which takes longer than the check.
"""

from __future__ import annotations

import math
from time import thread_time
from typing import Any, Final, NamedTuple

from ompl import base, geometric, util

from planners.search.connection.connection import radius_at
from planners.search.manoeuvres.arcs import FINE_LOOKS, at_pace, stride_of
from planners.world.geometry.collision import scene_of, state_is_free
from planners.world.jit import jit
from planners.world.problem import Plan, Problem
from planners.world.vehicles.dynamics import tightest_bend, turning_speed
from planners.world.vehicles.vehicle import Car
from planners.world.workspace import Workspace
from tests.speed.peers.curves import driven_over

IMPROVING: Final = ("BITstar", "InformedRRTstar")  # these go on to shorten their paths; others are simplified
_STEP_M = 0.02  # between two states of a path that are checked


class Found(NamedTuple):
    """One attempt."""

    plan: Plan | None  # None also where a path was found whose curves cannot be driven
    seconds: float  # of its processor


@jit
def _is_free(x: float, y: float, heading: float, vehicle: Car, scene: Any) -> bool:
    """Whether a pose is free, with room for all within a step of it that is checked when it is driven."""
    speed = (_STEP_M + stride_of(1.0, vehicle) / FINE_LOOKS) / vehicle.dt
    for turn in (-1.0, 1.0):
        bend = turn * tightest_bend(turning_speed(vehicle), vehicle)
        if not state_is_free(at_pace((x, y, heading, 0.0, 0.0), speed, bend, vehicle), vehicle, scene):
            return False
    return True


def reeds_shepp_plan(
    problem: Problem, vehicle: Car, planner: str, seed: int, limit_s: float, workspace: Workspace
) -> Found:
    """Drive the path of a ``planner`` of OMPL to the goal pose: the first, or the best within the limit."""
    assert problem.arrival is not None
    util.noOutputHandler()
    util.RNG.setSeed(seed)
    began = thread_time()
    scene = scene_of(problem)
    space = base.ReedsSheppStateSpace(radius_at(turning_speed(vehicle), vehicle))
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
    plan = None
    if setup.haveExactSolutionPath():
        if planner not in IMPROVING:
            setup.simplifySolution()
        states = setup.getSolutionPath().getStates()
        poses = [(state.getX(), state.getY(), state.getYaw()) for state in states]
        plan = driven_over(poses, problem, vehicle, scene, workspace)
    seconds = thread_time() - began
    setup.clear()
    return Found(plan, seconds)
