"""How a drive's end comes near to a place: what it costs to be off the straight way there."""

from __future__ import annotations

from typing import NamedTuple

from planners.optimisation.local_model import Model
from planners.world.arrays import Floats
from planners.world.jit import inlined, lean
from planners.world.trigonometry import length


class Aim(NamedTuple):
    """What the last state is to come near to: how far it is from the goal along the approach."""

    x: float  # metres
    y: float
    radius: float
    away_x: float  # unit vector from the goal to the last state
    away_y: float
    distance: float  # metres, for how much it costs to be beside the approach


@lean
def aim_from(model: Model, steps: int, goal: Floats) -> Aim:
    """The way on from where a drive of some ``steps`` ends now to a place, that of ``goal_of``."""
    dx = model.states[steps, 0] - goal[0]
    dy = model.states[steps, 1] - goal[1]
    far = max(length(dx, dy), 1e-9)
    return Aim(goal[0], goal[1], goal[2], dx / far, dy / far, max(far, goal[2]))


@inlined
def miss(x: float, y: float, aim: Aim) -> float:
    """The distance from the goal along the approach, negative beyond it; to be beside it costs, too."""
    dx = x - aim.x
    dy = y - aim.y
    across = dx * aim.away_y - dy * aim.away_x
    return dx * aim.away_x + dy * aim.away_y + 0.5 * across * across / aim.distance


@lean
def pull(model: Model, steps: int, aim: Aim) -> None:
    """Add what ``miss`` costs to gradient and curvature of the last state."""
    gradient, curvature = model.gradient[steps], model.curvature[steps]
    dx = model.states[steps, 0] - aim.x
    dy = model.states[steps, 1] - aim.y
    beside = (dx * aim.away_y - dy * aim.away_x) / aim.distance
    gradient[0] += aim.away_x + beside * aim.away_y
    gradient[1] += aim.away_y - beside * aim.away_x
    curvature[0, 0] += aim.away_y * aim.away_y / aim.distance
    curvature[1, 1] += aim.away_x * aim.away_x / aim.distance
    curvature[0, 1] -= aim.away_x * aim.away_y / aim.distance
    curvature[1, 0] -= aim.away_x * aim.away_y / aim.distance
