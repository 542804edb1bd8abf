"""What OMPL's planners may be told, and what ``python -m tests.speed.peers --tune`` found best for each."""

from __future__ import annotations

from typing import NamedTuple


class Kpiece1(NamedTuple):
    """KPIECE1 with the position as projection."""

    cell_m: float  # side of a square cell of the projection
    goal_bias: float
    border_fraction: float
    least_steps: int  # a control is kept for a uniform number of steps between these
    most_steps: int


class Rrt(NamedTuple):
    """RRT with a GNAT, which OMPL takes for each metric space."""

    goal_bias: float
    metric: float  # metres of distance for each rad, m/s, rad of difference; 0: position only
    intermediate: bool  # every step of an extension a vertex
    least_steps: int
    most_steps: int


# what OMPL takes when it is told nothing: cells of 1/20 of the bounds, 1 to 10 steps
KPIECE1_UNTUNED = Kpiece1(cell_m=3.2, goal_bias=0.05, border_fraction=0.8, least_steps=1, most_steps=10)
RRT_UNTUNED = Rrt(goal_bias=0.05, metric=1.0, intermediate=False, least_steps=1, most_steps=10)

KPIECE1 = Kpiece1(cell_m=1.0, goal_bias=0.7, border_fraction=0.9, least_steps=8, most_steps=12)
RRT = Rrt(goal_bias=0.1, metric=0.0, intermediate=False, least_steps=20, most_steps=20)
