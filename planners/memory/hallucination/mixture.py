"""The methods by name, and problems that a mix of them makes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from planners.memory.encoder.encoder import Weights
from planners.memory.hallucination.learned_obstacles import Learned
from planners.memory.hallucination.maximal import Maximal
from planners.memory.hallucination.method import DrawObstacles, Method
from planners.memory.hallucination.minimal import Minimal
from planners.memory.hallucination.rearrange import Rearrange
from planners.memory.plans.experience import Experience
from planners.memory.plans.free import ends_of, plan_fits
from planners.world.geometry.collision import scene_of
from planners.world.problem import Problem

METHODS: Final = ("rearrange", "maximal", "minimal", "learned")
LEARNED: Final = "learned"  # the method that needs weights


class Hallucination(NamedTuple):
    """A problem that was made for a plan, and the method that made it."""

    problem: Problem
    method: str


def method_named(name: str, weights: Weights | None = None) -> Method:
    """Return one of the ``METHODS`` with its default settings; only ``learned`` uses ``weights``.

    Raises ValueError if there is no such method, or ``learned`` has no weights.
    """
    if name == LEARNED:
        if weights is None:
            raise ValueError("Learned hallucination needs weights: train some with train_learned.")
        return Learned(weights)
    plain: dict[str, Method] = {"rearrange": Rearrange(), "maximal": Maximal(), "minimal": Minimal()}
    if name not in plain:
        raise ValueError(f"Unknown hallucination method {name!r}; choose one of {', '.join(METHODS)}.")
    return plain[name]


def hallucinate(
    experience: Experience,
    mixture: Mapping[str, float],
    draw: DrawObstacles,
    rng: np.random.Generator,
    weights: Weights | None = None,
) -> Iterator[Hallucination]:
    """Make problems for an experience's plan, without end.

    Args:
        experience: whose plan the problems are made for.
        mixture: the share of each method.
        draw: draws new obstacles of the class.
        rng: the source of all random choices.
        weights: of the network of ``learned``, if the mixture has it.

    Raises:
        RuntimeError: The plan does not solve its own problem.
    """
    origin = experience.problem
    if not plan_fits(experience.sweep, 0, ends_of(origin), scene_of(origin))[0]:
        raise RuntimeError(f"{origin.id} is not solved by its own plan; collect it again")
    samplers = [method_named(name, weights).around(experience, rng) for name in mixture]
    names, limits = list(mixture), np.cumsum(list(mixture.values()))
    index = 0
    while True:
        index += 1
        which = int(np.searchsorted(limits[:-1], limits[-1] * rng.random(), side="right"))
        made = f"{origin.id}~{names[which]}-{index}"
        problem = replace(origin, id=made, obstacles=samplers[which](draw, rng))
        yield Hallucination(problem, names[which])
