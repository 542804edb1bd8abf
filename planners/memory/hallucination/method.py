"""What a method of hallucination is: prepared once for a plan, then asked for obstacles many times."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from planners.memory.plans.experience import Experience
from planners.world.problem import Obstacles

DrawObstacles = Callable[[np.random.Generator], Obstacles]  # a fresh set of obstacles of the class
Sampler = Callable[[DrawObstacles, np.random.Generator], Obstacles]  # obstacles of one new problem


class Method(Protocol):
    """One way to hallucinate; its settings are its fields."""

    def around(self, experience: Experience, rng: np.random.Generator) -> Sampler:
        """Prepare for an experience: a sampler of obstacles among which its plan stays free."""
