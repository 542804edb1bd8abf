"""What a hallucination method is: it prepares once for a plan, and then makes obstacles many times."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from planners.memory.plans.experience import Experience
from planners.world.problem import Obstacles

DrawObstacles = Callable[[np.random.Generator], Obstacles]  # draws new obstacles of the class
Sampler = Callable[[DrawObstacles, np.random.Generator], Obstacles]  # makes the obstacles of one problem
Range = tuple[float, float]  # a number is drawn evenly from it


class Method(Protocol):
    """A method, whose settings are its fields."""

    def around(self, experience: Experience, rng: np.random.Generator) -> Sampler:
        """Return a sampler of obstacles among which the plan of an experience stays free."""
