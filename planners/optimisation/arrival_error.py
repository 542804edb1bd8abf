"""What it costs that a drive does not end as asked: at its place, heading and hitch angles."""

from __future__ import annotations

import math
from typing import Final

from planners.optimisation.local_model import Model
from planners.world.arrays import Floats
from planners.world.goal import (
    HEADING,
    HEADING_TOLERANCE,
    HITCHES,
    LEAST_SPEED,
    MOST_SPEED,
    MOST_TURN,
    RADIUS,
    X,
    Y,
)
from planners.world.jit import inlined, lean
from planners.world.trigonometry import length, wrapped
from planners.world.vehicles.vehicle import FIRST_HITCH

OFF: Final = 0.25  # metres; what it costs to be off the aim by the usual share of what is tolerated
USUAL: Final = 0.5  # share of what is tolerated by which the aim lies inside of it
WIDE: Final = 0.1  # metres or radians; more is not counted as tolerated here


@inlined
def _edge(tolerance: float, inside: float) -> float:
    return max(inside * min(tolerance, WIDE), 1e-9)


@inlined
def bend_of_error(tolerance: float) -> float:
    """What it costs to be one metre or radian off the aim, twice."""
    edge = _edge(tolerance, USUAL)
    return OFF / (edge * edge)


@lean
def aim_near(end: Floats, goal: Floats, aim: Floats, inside: float) -> None:
    """Aim at a last state ``[S]``, or at what is next to it and by a share ``inside`` of what is asked."""
    for c in range(aim.shape[0]):
        aim[c] = end[c]
    dx = end[0] - goal[X]
    dy = end[1] - goal[Y]
    share = min((goal[RADIUS] - _edge(goal[RADIUS], inside)) / max(length(dx, dy), 1e-9), 1.0)
    aim[0] = goal[X] + share * dx
    aim[1] = goal[Y] + share * dy
    if goal[HEADING_TOLERANCE] < math.inf:
        most = goal[HEADING_TOLERANCE] - _edge(goal[HEADING_TOLERANCE], inside)
        off = wrapped(end[2] - goal[HEADING])
        aim[2] = end[2] - off + min(max(off, -most), most)
    aim[3] = min(max(end[3], goal[LEAST_SPEED]), goal[MOST_SPEED])
    aim[4] = min(max(end[4], -goal[MOST_TURN]), goal[MOST_TURN])
    for k in range((goal.shape[0] - HITCHES) // 2):
        most = goal[HITCHES + 2 * k + 1] - _edge(goal[HITCHES + 2 * k + 1], inside)
        off = end[FIRST_HITCH + k] - goal[HITCHES + 2 * k]
        aim[FIRST_HITCH + k] = goal[HITCHES + 2 * k] + min(max(off, -most), most)


@lean
def aim_at(model: Model, steps: int, goal: Floats) -> None:
    """Aim at the end of ``model.best_states``, as ``aim_near`` does."""
    aim_near(model.best_states[steps], goal, model.vectors[5], USUAL)


@inlined
def error_cost(states: Floats, i: int, aim: Floats, goal: Floats) -> float:
    """What it costs that a state is not the aim."""
    dx = states[i, 0] - aim[0]
    dy = states[i, 1] - aim[1]
    cost = 0.5 * bend_of_error(goal[RADIUS]) * (dx * dx + dy * dy)
    if goal[HEADING_TOLERANCE] < math.inf:
        off = wrapped(states[i, 2] - aim[2])
        cost += 0.5 * bend_of_error(goal[HEADING_TOLERANCE]) * off * off
    for k in range((goal.shape[0] - HITCHES) // 2):
        off = states[i, FIRST_HITCH + k] - aim[FIRST_HITCH + k]
        cost += 0.5 * bend_of_error(goal[HITCHES + 2 * k + 1]) * off * off
    return float(cost)


@lean
def pull_to_aim(model: Model, steps: int, goal: Floats) -> None:
    """Add what ``error_cost`` costs to gradient and curvature of the last state."""
    gradient, curvature = model.gradient[steps], model.curvature[steps]
    last, aim = model.states[steps], model.vectors[5]
    for c in range(2):
        gradient[c] += bend_of_error(goal[RADIUS]) * (last[c] - aim[c])
        curvature[c, c] += bend_of_error(goal[RADIUS])
    if goal[HEADING_TOLERANCE] < math.inf:
        gradient[2] += bend_of_error(goal[HEADING_TOLERANCE]) * wrapped(last[2] - aim[2])
        curvature[2, 2] += bend_of_error(goal[HEADING_TOLERANCE])
    for k in range((goal.shape[0] - HITCHES) // 2):
        bend = bend_of_error(goal[HITCHES + 2 * k + 1])
        gradient[FIRST_HITCH + k] += bend * (last[FIRST_HITCH + k] - aim[FIRST_HITCH + k])
        curvature[FIRST_HITCH + k, FIRST_HITCH + k] += bend
