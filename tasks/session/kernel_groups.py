"""The kernels of a run in three groups, in the order in which it needs them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from planners.memory.hallucination.mixture import hallucinate
from planners.memory.hallucination.no_plan import no_plan
from planners.memory.labelling import label_problems
from planners.memory.plans.experience import Experience
from planners.optimisation.polish import polish
from planners.search.registry import PLANNERS
from planners.solve import solve
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.geometry.collision import scene_of
from planners.world.problem import Plan, start_state
from planners.world.randomness import generator
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace
from tasks.attempts.compile_assists import EMPTY, compile_assists
from tasks.settings.run_settings import COLLECTOR, DEFAULT_MIXTURE


def _compile_collecting(vehicle: Vehicle) -> None:
    """Compile the planner that collects experiences, and what polishes its plans."""
    found = solve(EMPTY, COLLECTOR, vehicle=vehicle, polished=False).plan
    if found is not None:
        polish(EMPTY, found, vehicle, scene_of(EMPTY), Workspace())


def _compile_hallucination(vehicle: Vehicle) -> None:
    """Compile the drawing of problems and the default mixture of hallucination."""
    controls = np.tile([vehicle.max_acceleration, 0.0], (140, 1))
    plan = Plan(simulate(start_state(EMPTY, vehicle), controls, vehicle), controls)
    end = (float(plan.states[-1, 0]), float(plan.states[-1, 1]))
    experience = Experience(replace(EMPTY, goal=end), plan, vehicle)
    for name in CLASSES:
        draw = problem_class(name, vehicle=vehicle).draw_obstacles
        hallucinated = next(hallucinate(experience, dict(DEFAULT_MIXTURE), draw, generator(0)))
        label_problems([hallucinated.problem], experience.sweep)
        no_plan(experience.sweep, draw, generator(0), name, 0)


def _compile_rest(vehicle: Vehicle) -> None:
    """Compile what only the benchmark needs."""
    compile_assists(vehicle)
    for planner in PLANNERS:
        for assist in ("none", "fresh"):
            solve(EMPTY, planner, assist, vehicle=vehicle, polished=False)


# With two workers, each compiles one of the first two groups, and the
# one that finishes first compiles the last.
GROUPS: Final[tuple[Callable[[Vehicle], object], ...]] = (
    _compile_collecting,
    _compile_hallucination,
    _compile_rest,
)
