"""A plan that is to be judged, and where it comes from."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

from planners.attempt import Attempt
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Vehicle

POLISHED: Final = 3  # one attempt in so many is polished, as users get it


class Made(NamedTuple):
    """An attempt at a problem, with its plan in the frame of the problem."""

    problem: Problem
    vehicle: Vehicle
    asked: str  # what kind of problem it is
    source: str  # of the plan: recalled, repaired, searched, improved or polished
    attempt: Attempt


Maker = Callable[[int, int], Iterator[Made]]  # every attempt at the problem of a seed and a number
