"""Compile the kernels while servers start: Numba keeps what it compiled, so later processes only load it."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from planners.memory.experience import Experience
from planners.memory.hallucination import METHODS, hallucinate, no_plan
from planners.memory.labels import free_plans
from planners.solve import solve
from planners.world.classes import CLASSES, problem_class
from planners.world.collision import scene_of
from planners.world.occupancy import occupancy_of
from planners.world.randomness import generator
from tasks.engine import Client
from tasks.settings import COLLECTOR


@contextmanager
def warm_up(scheduler: str) -> Iterator[None]:
    """Have the workers behind ``scheduler`` compile, as long as the context lasts, beside other work."""
    with Client(scheduler, set_as_default=False) as client:
        work = [client.submit(group, pure=False) for group in GROUPS]
        yield
        client.cancel(work)


def _compile_collecting() -> None:
    """What collect needs."""
    for name in CLASSES:
        solve(problem_class(name).draw(0, 0), COLLECTOR)


def _compile_hallucination() -> None:
    """What hallucinate needs, and the planner without a roadmap."""
    origin = problem_class(CLASSES[0], "easy")
    for index in itertools.count():
        problem = origin.draw(0, index)
        attempt = solve(problem, "rrt")
        if attempt.plan is not None:
            experience = Experience(problem, attempt.plan)
            break
    for method in METHODS:
        made = hallucinate(method, experience, origin.draw_obstacles, generator(0), 0)
        free_plans(experience.sweep, scene_of(made))
        occupancy_of(made)
    no_plan(experience.sweep, origin.draw_obstacles, generator(0), origin.name, 0)


def _compile_rest() -> None:
    """What only the benchmark needs."""
    solve(problem_class(CLASSES[0]).draw(0, 0), "gust")


# In the order of need: of two workers each compiles one of the first two, and whoever is free the last.
GROUPS: Final[tuple[Callable[[], object], ...]] = (
    _compile_collecting,
    _compile_hallucination,
    _compile_rest,
)
